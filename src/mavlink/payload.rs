//! Reads the fields of a received payload, at their places on the wire.

use heapless::Vec;

/// A payload. MAVLink 2 cuts off zeros at its end, so whatever lies beyond the end reads as zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Payload<'a>(pub &'a [u8]);

impl Payload<'_> {
    /// Bytes as they stand.
    pub fn bytes<const N: usize>(&self, offset: usize) -> [u8; N] {
        core::array::from_fn(|i| self.0.get(offset + i).copied().unwrap_or(0))
    }

    /// An unsigned byte.
    // Inlined, this and the next would be repeated for nearly each field of each message.
    #[inline(never)]
    pub fn u8(&self, offset: usize) -> u8 {
        u8::from_le_bytes(self.bytes(offset))
    }

    /// An unsigned 16-bit number.
    #[inline(never)]
    pub fn u16(&self, offset: usize) -> u16 {
        u16::from_le_bytes(self.bytes(offset))
    }

    /// A signed 16-bit number.
    pub fn i16(&self, offset: usize) -> i16 {
        self.u16(offset).cast_signed()
    }

    /// An unsigned 32-bit number.
    pub fn u32(&self, offset: usize) -> u32 {
        u32::from_le_bytes(self.bytes(offset))
    }

    /// A signed 32-bit number.
    pub fn i32(&self, offset: usize) -> i32 {
        i32::from_le_bytes(self.bytes(offset))
    }

    /// A signed 64-bit number.
    pub fn i64(&self, offset: usize) -> i64 {
        i64::from_le_bytes(self.bytes(offset))
    }

    /// An unsigned 64-bit number.
    pub fn u64(&self, offset: usize) -> u64 {
        u64::from_le_bytes(self.bytes(offset))
    }

    /// A single-precision number.
    pub fn f32(&self, offset: usize) -> f32 {
        f32::from_le_bytes(self.bytes(offset))
    }

    /// The characters of a field of `N` bytes, ended by a zero or by its length.
    pub fn text<const N: usize>(&self, offset: usize) -> Vec<u8, N> {
        let mut text = Vec::new();
        for character in self.bytes::<N>(offset).into_iter().take_while(|byte| *byte != 0) {
            // There is room for the whole field.
            let _ = text.push(character);
        }
        text
    }

    /// A name of at most 16 characters, ended by a zero or by its length.
    pub fn name(&self, offset: usize) -> Name {
        Name(self.bytes(offset))
    }
}

/// The name of a parameter as it stands in a message: 16 bytes, padded with zeros.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Name(pub [u8; 16]);

impl Name {
    /// The characters up to the first zero.
    pub fn as_bytes(&self) -> &[u8] {
        self.0.split(|byte| *byte == 0).next().unwrap_or(&[])
    }
}

impl From<&str> for Name {
    /// Names longer than 16 characters are cut off.
    fn from(text: &str) -> Self {
        let mut name = [0; 16];
        for (to, from) in name.iter_mut().zip(text.bytes()) {
            *to = from;
        }
        Self(name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_beyond_the_end_are_zero() {
        let payload = Payload(&[1, 2, 3]);
        assert_eq!(payload.u16(0), 0x0201);
        assert_eq!(payload.u16(2), 3);
        assert_eq!(payload.u8(200), 0);
        assert_eq!(payload.f32(usize::MAX - 4), 0.0);
    }

    #[test]
    fn a_name_ends_at_a_zero_or_after_16_characters() {
        assert_eq!(Name::from("SR0_EXTRA1").as_bytes(), b"SR0_EXTRA1");
        assert_eq!(Name::from("SIXTEEN_LETTERS_").as_bytes(), b"SIXTEEN_LETTERS_");
        assert_eq!(Payload(b"ABC").name(0).as_bytes(), b"ABC");
        assert_eq!(Payload(&[]).name(0).as_bytes(), b"");
    }
}
