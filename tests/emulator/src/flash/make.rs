//! Makes of flash chips: their ids and status registers, which are reached by serial commands.

use super::super::clock::{Cycle, cycles};

/// Commands of the W25Q16JV, which its copies have, too.
const WRITE_STATUS: u8 = 0x01;
const WRITE_DISABLE: u8 = 0x04;
const READ_STATUS_1: u8 = 0x05;
const WRITE_ENABLE: u8 = 0x06;
const READ_STATUS_2: u8 = 0x35;
/// "Read Unique ID Number": after four dummy bytes the chip's id, first byte first (8.2).
const READ_UNIQUE_ID: u8 = 0x4b;
const UNIQUE_ID_DUMMY_BYTES: usize = 4;
const READ_JEDEC_ID: u8 = 0x9f;

const STATUS_1_BUSY: u8 = 1 << 0;
const STATUS_2_QUAD_ENABLED: u8 = 1 << 1;
/// "Write Status Register Time", typical (9.6).
const STATUS_WRITE: Cycle = cycles(10_000);

/// The make of a flash chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashMake {
    /// Manufacturer, type and capacity.
    pub jedec_id: [u8; 3],
    /// Its unique id. Most chips have half of it: what follows reads as the line that nothing drives.
    pub unique_id: [u8; 16],
    /// Bits of status register 2 that are set whatever is written to it.
    pub fixed_status_2: u8,
}

impl FlashMake {
    /// A W25Q16JV with this id.
    pub fn w25q16jv(unique_id: [u8; 8]) -> Self {
        let mut padded = [0xff; 16];
        padded[..8].copy_from_slice(&unique_id);
        Self {
            jedec_id: [0xef, 0x40, 0x15],
            unique_id: padded,
            fixed_status_2: 0,
        }
    }
}

/// A chip behind its serial interface. It leaves the factory with quad reads enabled.
#[derive(Clone)]
pub struct SerialChip {
    make: FlashMake,
    status_2: u8,
    status_writes: u64,
    busy_until: Cycle,
    sequence: Sequence,
}

/// The command that is under way.
#[derive(Clone, Copy)]
enum Sequence {
    None,
    Answer(u8),
    /// Status register 1, then 2.
    WriteStatus1,
    WriteStatus2,
}

impl SerialChip {
    pub fn new(make: FlashMake) -> Self {
        Self {
            make,
            status_2: STATUS_2_QUAD_ENABLED | make.fixed_status_2,
            status_writes: 0,
            busy_until: 0,
            sequence: Sequence::None,
        }
    }

    /// Number of times its status registers were stored.
    pub fn status_writes(&self) -> u64 {
        self.status_writes
    }

    /// It is deselected.
    pub fn end_command(&mut self) {
        self.sequence = Sequence::None;
    }

    /// The bytes it returns behind a command, as many as it has.
    pub fn read_after(&self, command: u8) -> Vec<u8> {
        match command {
            READ_UNIQUE_ID => [0xff; UNIQUE_ID_DUMMY_BYTES]
                .into_iter()
                .chain(self.make.unique_id)
                .collect(),
            READ_JEDEC_ID => self.make.jedec_id.to_vec(),
            READ_STATUS_2 => vec![self.status_2],
            _ => panic!("the firmware reads after the command {command:#04x}, which is not modelled"),
        }
    }

    /// It receives a byte and returns one.
    pub fn exchange(&mut self, byte: u8, now: Cycle) -> u8 {
        let (next, answer) = match self.sequence {
            Sequence::None => (self.begin(byte, now), 0),
            Sequence::Answer(answer) => (Sequence::None, answer),
            Sequence::WriteStatus1 => (Sequence::WriteStatus2, 0),
            Sequence::WriteStatus2 => {
                self.status_2 = byte | self.make.fixed_status_2;
                self.status_writes += 1;
                self.busy_until = now + STATUS_WRITE;
                (Sequence::None, 0)
            }
        };
        self.sequence = next;
        answer
    }

    fn begin(&self, command: u8, now: Cycle) -> Sequence {
        match command {
            READ_STATUS_1 if now < self.busy_until => Sequence::Answer(STATUS_1_BUSY),
            READ_STATUS_1 => Sequence::Answer(0),
            READ_STATUS_2 => Sequence::Answer(self.status_2),
            WRITE_STATUS => Sequence::WriteStatus1,
            WRITE_ENABLE | WRITE_DISABLE => Sequence::None,
            _ => panic!("the firmware sent the flash chip the command {command:#04x}, which is not modelled"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn send(chip: &mut SerialChip, bytes: &[u8], now: Cycle) -> u8 {
        bytes.iter().fold(0, |_, byte| chip.exchange(*byte, now))
    }

    #[test]
    fn a_stored_status_takes_10_ms_and_leaves_fixed_bits_as_they_are() {
        for (fixed, expected) in [(0, 0b10), (0x40, 0x42)] {
            let mut chip = SerialChip::new(FlashMake {
                fixed_status_2: fixed,
                ..FlashMake::w25q16jv([0; 8])
            });
            send(&mut chip, &[WRITE_ENABLE], 0);
            send(&mut chip, &[WRITE_STATUS, 0, 0b10], 0);
            assert_eq!(send(&mut chip, &[READ_STATUS_2, 0], 0), expected);
            assert_eq!(send(&mut chip, &[READ_STATUS_1, 0], STATUS_WRITE - 1), 1);
            assert_eq!(send(&mut chip, &[READ_STATUS_1, 0], STATUS_WRITE), 0);
            assert_eq!(chip.status_writes(), 1);
        }
    }

    #[test]
    fn ids_are_read_behind_their_commands() {
        let chip = SerialChip::new(FlashMake::w25q16jv([1, 2, 3, 4, 5, 6, 7, 8]));
        assert_eq!(chip.read_after(READ_JEDEC_ID), [0xef, 0x40, 0x15]);
        assert_eq!(chip.read_after(READ_UNIQUE_ID)[4..12], [1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(chip.read_after(READ_STATUS_2), [0b10]);
    }

    #[test]
    #[should_panic(expected = "command 0x9e")]
    fn a_command_that_is_not_modelled_fails_by_name() {
        SerialChip::new(FlashMake::w25q16jv([0; 8])).exchange(0x9e, 0);
    }
}
