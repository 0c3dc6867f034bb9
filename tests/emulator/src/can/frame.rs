//! Data frames, and how long they are on the wires.

/// Identifier of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CanId {
    /// Of 11 bits.
    Standard(u16),
    /// Of 29 bits.
    Extended(u32),
}

/// A data frame with 8 bytes at most.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CanFrame {
    pub id: CanId,
    pub data: Vec<u8>,
}

/// CRC delimiter, acknowledge slot and its delimiter, end of frame (3.1.1).
const TRAILER_BITS: u64 = 10;
/// Intermission (3.1.5).
pub const INTERMISSION_BITS: u64 = 3;
/// After this many equal bits the sender inserts one of the other value (5).
const STUFF_AFTER: usize = 5;
const CRC_BITS: usize = 15;
const CRC_POLYNOMIAL: u16 = 0x4599;

impl CanFrame {
    pub fn extended(id: u32, data: &[u8]) -> Self {
        assert!(id < 1 << 29 && data.len() <= 8, "no frame: {id:#x} {data:?}");
        Self {
            id: CanId::Extended(id),
            data: data.to_vec(),
        }
    }

    pub fn standard(id: u16, data: &[u8]) -> Self {
        assert!(id < 1 << 11 && data.len() <= 8, "no frame: {id:#x} {data:?}");
        Self {
            id: CanId::Standard(id),
            data: data.to_vec(),
        }
    }

    /// The arbitration field with IDE as a number: the lower wins.
    pub fn priority(&self) -> u32 {
        const SRR_AND_IDE: u32 = 0b11 << 19;
        match self.id {
            CanId::Standard(id) => u32::from(id) << 21,
            CanId::Extended(id) => id >> 18 << 21 | SRR_AND_IDE | (id & 0x3_ffff) << 1,
        }
    }

    /// Bits from the start of the frame to the end of the intermission behind it.
    pub fn bits(&self) -> u64 {
        let stuffed = stuffed_length(&self.stuffed_part());
        stuffed as u64 + TRAILER_BITS + INTERMISSION_BITS
    }

    /// From the start of the frame to the end of the CRC sequence, without stuff bits.
    fn stuffed_part(&self) -> Vec<bool> {
        let mut bits = Vec::new();
        push(&mut bits, 0, 1);
        match self.id {
            // RTR, IDE, r0.
            CanId::Standard(id) => {
                push(&mut bits, id.into(), 11);
                push(&mut bits, 0, 3);
            }
            // SRR and IDE between the two parts; RTR, r1, r0 behind them.
            CanId::Extended(id) => {
                push(&mut bits, id >> 18, 11);
                push(&mut bits, 0b11, 2);
                push(&mut bits, id, 18);
                push(&mut bits, 0, 3);
            }
        }
        push(&mut bits, self.data.len() as u32, 4);
        for byte in &self.data {
            push(&mut bits, (*byte).into(), 8);
        }
        let crc = crc(&bits);
        push(&mut bits, crc.into(), CRC_BITS);
        bits
    }
}

fn push(bits: &mut Vec<bool>, value: u32, count: usize) {
    bits.extend((0..count).rev().map(|place| value >> place & 1 != 0));
}

fn crc(bits: &[bool]) -> u16 {
    bits.iter().fold(0, |crc, bit| {
        let carry = (crc >> (CRC_BITS - 1) & 1 != 0) != *bit;
        let shifted = crc << 1 & 0x7fff;
        if carry { shifted ^ CRC_POLYNOMIAL } else { shifted }
    })
}

fn stuffed_length(bits: &[bool]) -> usize {
    let (mut length, mut run, mut last) = (0, 0, None);
    for &bit in bits {
        run = if last == Some(bit) { run + 1 } else { 1 };
        (length, last) = (length + 1, Some(bit));
        if run == STUFF_AFTER {
            // The stuff bit counts in the run that follows.
            (length, run, last) = (length + 1, 1, Some(!bit));
        }
    }
    length
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bits_of(bytes: &[u8]) -> Vec<bool> {
        let mut bits = Vec::new();
        bytes.iter().for_each(|byte| push(&mut bits, (*byte).into(), 8));
        bits
    }

    #[test]
    fn the_crc_is_crc_15_can() {
        // "Catalogue of parametrised CRC algorithms", CRC-15/CAN: check 0x059e.
        assert_eq!(crc(&bits_of(b"123456789")), 0x059e);
    }

    #[test]
    fn a_frame_without_stuff_bits_has_the_length_of_its_fields() {
        // 3.1.1 of part B: 128 bits with 8 bytes and 29 bits of identifier, 108 with 11, and the intermission.
        let stuffed = |frame: &CanFrame| stuffed_length(&frame.stuffed_part()) - frame.stuffed_part().len();
        for (frame, bits) in [
            (CanFrame::extended(0x0aaa_aaaa, &[0x55; 8]), 131),
            (CanFrame::standard(0x2aa, &[0x55; 8]), 111),
            (CanFrame::extended(0x0aaa_aaaa, &[]), 67),
        ] {
            assert_eq!(frame.bits() - stuffed(&frame) as u64, bits, "{frame:?}");
        }
    }

    #[test]
    fn stuff_bits_count_in_the_run_behind_them() {
        assert_eq!(stuffed_length(&[false; 4]), 4);
        assert_eq!(stuffed_length(&[false; 5]), 6);
        // 00000 1 1111 0: the stuff bit is the first of five.
        let mut bits = vec![false; 5];
        bits.extend([true; 4]);
        assert_eq!(stuffed_length(&bits), 11);
        // At most one in four.
        assert!(CanFrame::extended(0, &[0; 8]).bits() <= 131 + (128 - 10) / 4);
    }

    #[test]
    fn standard_wins_against_extended_with_the_same_first_eleven_bits() {
        let standard = CanFrame::standard(0x123, &[]);
        let extended = CanFrame::extended(0x123 << 18, &[]);
        let lower = CanFrame::extended(0x122 << 18 | 0x3_ffff, &[]);
        assert!(standard.priority() < extended.priority());
        assert!(lower.priority() < standard.priority());
    }
}
