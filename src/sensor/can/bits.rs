//! Fields of messages, as DSDL packs them.

/// Reads the fields of a message one after the other. A field is little-endian by bytes; what is left of it in its last byte
/// comes from the highest bit on. (DroneCAN specification, 3. Data serialization.)
pub(super) struct BitReader<'a> {
    bytes: &'a [u8],
    position: usize,
}

impl<'a> BitReader<'a> {
    /// From the first field.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, position: 0 }
    }

    /// The next field, of up to 32 bits; `None` behind the end, here and below.
    pub fn unsigned(&mut self, bits: usize) -> Option<u32> {
        let mut value = 0;
        for start in (0..bits).step_by(8) {
            value |= u32::from(self.part((bits - start).min(8))?) << start;
        }
        Some(value)
    }

    /// The next byte, or fewer bits.
    pub fn byte(&mut self, bits: usize) -> Option<u8> {
        self.unsigned(bits).map(|value| value as u8)
    }

    /// The next number of 16 bits.
    pub fn word(&mut self) -> Option<u16> {
        self.unsigned(16).map(|value| value as u16)
    }

    /// The next float of 16 bits, which may be infinite or NaN.
    fn float16(&mut self) -> Option<f32> {
        self.word().map(from_half)
    }

    /// The next float of 16 bits; `None` inside if it is not finite, which means unknown.
    pub fn known(&mut self) -> Option<Option<f32>> {
        self.float16()
            .map(|value| Some(value).filter(|value| value.is_finite()))
    }

    /// Leaves out the next bits.
    pub fn skip(&mut self, bits: usize) -> Option<()> {
        self.position += bits;
        (self.position <= 8 * self.bytes.len()).then_some(())
    }

    /// What is left, from a whole byte on.
    pub fn rest(self) -> &'a [u8] {
        self.bytes.get(self.position.div_ceil(8)..).unwrap_or(&[])
    }

    /// At most 8 bits, the highest first.
    fn part(&mut self, bits: usize) -> Option<u8> {
        let start = self.position;
        self.skip(bits)?;
        let first = *self.bytes.get(start / 8)?;
        let second = self.bytes.get(start / 8 + 1).copied().unwrap_or(0);
        let both = u16::from_be_bytes([first, second]);
        Some(((both << (start % 8)) >> (16 - bits)) as u8)
    }
}

/// An IEEE 754 float of 16 bits.
fn from_half(half: u16) -> f32 {
    /// The difference between the exponents' offsets.
    const REBIAS: u32 = 127 - 15;
    /// The smallest number above zero, 2 to the power of -24.
    const SMALLEST: f32 = 5.960_464_5e-8;
    let sign = u32::from(half & 0x8000) << 16;
    let exponent = u32::from(half >> 10 & 0x1f);
    let fraction = u32::from(half & 0x3ff);
    let magnitude = match exponent {
        0 => (fraction as f32 * SMALLEST).to_bits(),
        0x1f => f32::INFINITY.to_bits() | fraction << 13,
        _ => (exponent + REBIAS) << 23 | fraction << 13,
    };
    f32::from_bits(sign | magnitude)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn halves_have_the_values_of_the_standard() {
        // IEEE 754-2008, binary16: one, -2, the largest, the smallest normal and subnormal, zeros, infinities.
        for (half, value) in [
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0x0400, 2f32.powi(-14)),
            (0x0001, 2f32.powi(-24)),
            (0x83ff, -1023.0 * 2f32.powi(-24)),
            (0x0000, 0.0),
            (0x7c00, f32::INFINITY),
            (0xfc00, f32::NEG_INFINITY),
        ] {
            assert_eq!(from_half(half), value, "{half:#x}");
        }
        assert!(from_half(0x7e00).is_nan() && from_half(0xfc01).is_nan());
        assert!(from_half(0x8000).is_sign_negative());
    }

    #[test]
    fn odd_fields_span_bytes() {
        // 1025 in 11 bits, then 97 in 7: bytes of the golden BatteryInfo in `messages.rs`.
        let mut reader = BitReader::new(&[0x01, 0x98, 0x68]);
        assert_eq!(reader.unsigned(11), Some(1025));
        assert_eq!(reader.unsigned(7), Some(97));
        assert_eq!(reader.unsigned(7), None, "six bits are left");
    }

    /// The bits of a field, in the order in which they are sent.
    fn written(value: u32, bits: usize) -> Vec<bool> {
        (0..bits)
            .step_by(8)
            .flat_map(|start| (start..bits.min(start + 8)).rev())
            .map(|bit| value >> bit & 1 == 1)
            .collect()
    }

    fn packed(bits: &[bool]) -> Vec<u8> {
        let byte = |eight: &[bool]| {
            let bits = eight.iter().enumerate();
            bits.map(|(place, bit)| u8::from(*bit) << (7 - place)).sum()
        };
        bits.chunks(8).map(byte).collect()
    }

    proptest! {
        #[test]
        fn fields_are_read_as_they_were_written(fields in prop::collection::vec((any::<u32>(), 1usize..33), 1..20)) {
            let fields: Vec<(u32, usize)> = fields
                .into_iter()
                .map(|(value, bits)| ((u64::from(value) & ((1 << bits) - 1)) as u32, bits))
                .collect();
            let all: Vec<bool> = fields.iter().flat_map(|(value, bits)| written(*value, *bits)).collect();
            let bytes = packed(&all);
            let mut reader = BitReader::new(&bytes);
            for (value, bits) in fields {
                prop_assert_eq!(reader.unsigned(bits), Some(value));
            }
            prop_assert_eq!(reader.unsigned(8), None);
        }
    }
}
