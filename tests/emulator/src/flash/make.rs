//! Makes of flash chips: their ids and status registers, which are reached by serial commands.

use super::super::clock::{Cycle, cycles};

/// Commands of the W25Q16JV, which its copies have, too.
const WRITE_STATUS_1: u8 = 0x01;
const WRITE_DISABLE: u8 = 0x04;
const READ_STATUS_1: u8 = 0x05;
const WRITE_ENABLE: u8 = 0x06;
const WRITE_STATUS_2: u8 = 0x31;
const READ_STATUS_2: u8 = 0x35;
/// "Read Unique ID Number": after four dummy bytes the chip's id, first byte first (8.2).
const READ_UNIQUE_ID: u8 = 0x4b;
const UNIQUE_ID_DUMMY_BYTES: usize = 4;
/// "Write Enable for Volatile Status Register".
const WRITE_ENABLE_VOLATILE: u8 = 0x50;
const READ_JEDEC_ID: u8 = 0x9f;

const STATUS_1_BUSY: u8 = 1 << 0;
const STATUS_1_READ_ONLY: u8 = 0b11;
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
    /// Status registers 1 and 2 as it leaves the factory.
    pub stored_status: [u8; 2],
    /// Bits of status register 2 that are set whatever is written to it.
    pub fixed_status_2: u8,
    /// Commands that write status register 2.
    pub status_2_write: Status2Write,
    /// Effect of a write of a status register behind 50h.
    pub write_behind_50h: StatusWrite,
}

/// Commands that write a chip's status register 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status2Write {
    /// 31h, and 01h with both registers.
    Either,
    /// 31h. It takes only the first byte of 01h.
    Own,
    /// 01h with both registers. It does not know 31h.
    WithStatus1,
    /// None.
    Never,
}

/// Effect of a write of a status register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StatusWrite {
    Nothing,
    /// It lasts until the power fails.
    Volatile,
    Stored,
}

impl FlashMake {
    /// A W25Q16JV with this id, which leaves the factory with quad reads enabled.
    pub fn w25q16jv(unique_id: [u8; 8]) -> Self {
        let mut padded = [0xff; 16];
        padded[..8].copy_from_slice(&unique_id);
        Self {
            jedec_id: [0xef, 0x40, 0x15],
            unique_id: padded,
            stored_status: [0, STATUS_2_QUAD_ENABLED],
            fixed_status_2: 0,
            status_2_write: Status2Write::Either,
            write_behind_50h: StatusWrite::Volatile,
        }
    }

    /// A W25Q16RV with this id, of an ordering option without quad reads.
    pub fn w25q16rv(unique_id: [u8; 8]) -> Self {
        Self {
            jedec_id: [0xef, 0x70, 0x15],
            stored_status: [0, 0],
            status_2_write: Status2Write::Own,
            ..Self::w25q16jv(unique_id)
        }
    }
}

/// A chip behind its serial interface.
#[derive(Clone)]
pub struct SerialChip {
    make: FlashMake,
    /// Status registers 1 and 2, until the power fails.
    status: [u8; 2],
    /// Status registers 1 and 2 from then on.
    stored_status: [u8; 2],
    status_writes: u64,
    busy_until: Cycle,
    /// Effect of the next write.
    status_write: StatusWrite,
    /// The bytes of the command that is under way.
    command: Vec<u8>,
    /// It takes addresses without a command.
    reads_continuously: bool,
}

impl SerialChip {
    pub fn new(make: FlashMake) -> Self {
        let mut chip = Self {
            make,
            status: [0; 2],
            stored_status: make.stored_status,
            status_writes: 0,
            busy_until: 0,
            status_write: StatusWrite::Nothing,
            command: Vec::new(),
            reads_continuously: false,
        };
        chip.lose_power();
        chip
    }

    /// Number of times its status registers were stored.
    pub fn status_writes(&self) -> u64 {
        self.status_writes
    }

    /// Status registers 1 and 2.
    pub fn status(&self) -> [u8; 2] {
        self.status
    }

    /// It forgets what is not stored.
    pub fn lose_power(&mut self) {
        let [status_1, status_2] = self.stored_status;
        self.status = [status_1, status_2 | self.make.fixed_status_2];
        self.busy_until = 0;
        self.status_write = StatusWrite::Nothing;
        self.command.clear();
        self.reads_continuously = false;
    }

    /// Whether it stores its status registers.
    pub fn is_busy(&self, now: Cycle) -> bool {
        now < self.busy_until
    }

    /// The bytes it returns behind a command, as many as it has.
    pub fn read_after(&self, command: u8) -> Vec<u8> {
        match command {
            READ_UNIQUE_ID => [0xff; UNIQUE_ID_DUMMY_BYTES]
                .into_iter()
                .chain(self.make.unique_id)
                .collect(),
            READ_JEDEC_ID => self.make.jedec_id.to_vec(),
            READ_STATUS_2 => vec![self.status[1]],
            _ => panic!("the firmware reads after the command {command:#04x}, which is not modelled"),
        }
    }

    /// It receives a byte and returns one.
    pub fn exchange(&mut self, byte: u8, now: Cycle) -> u8 {
        self.command.push(byte);
        match self.command[..] {
            [READ_STATUS_1, _, ..] if self.is_busy(now) => self.status[0] | STATUS_1_BUSY,
            [READ_STATUS_1, _, ..] => self.status[0],
            [READ_STATUS_2, _, ..] => self.status[1],
            _ => 0,
        }
    }

    /// It is deselected, and carries out what it has received.
    pub fn end_command(&mut self, now: Cycle) {
        let command = std::mem::take(&mut self.command);
        let [status_1, status_2] = self.status;
        match command[..] {
            [] | [READ_STATUS_1 | READ_STATUS_2, ..] => {}
            [WRITE_ENABLE] => self.status_write = StatusWrite::Stored,
            [WRITE_ENABLE_VOLATILE] => self.status_write = self.make.write_behind_50h,
            [WRITE_DISABLE] => self.status_write = StatusWrite::Nothing,
            [WRITE_STATUS_1, one] => self.write_status([one, status_2], now),
            [WRITE_STATUS_1, one, two] => {
                let two = if self.takes_status_2_with_1() {
                    two
                } else {
                    status_2
                };
                self.write_status([one, two], now);
            }
            [WRITE_STATUS_2, two] if self.takes_status_2_alone() => self.write_status([status_1, two], now),
            [WRITE_STATUS_2, _] => {}
            _ => panic!("the firmware sent the flash chip the command {command:02x?}, which is not modelled"),
        }
    }

    fn takes_status_2_alone(&self) -> bool {
        matches!(self.make.status_2_write, Status2Write::Either | Status2Write::Own)
    }

    fn takes_status_2_with_1(&self) -> bool {
        matches!(
            self.make.status_2_write,
            Status2Write::Either | Status2Write::WithStatus1
        )
    }

    fn write_status(&mut self, [status_1, status_2]: [u8; 2], now: Cycle) {
        let write = std::mem::replace(&mut self.status_write, StatusWrite::Nothing);
        if write == StatusWrite::Nothing || self.is_busy(now) {
            return;
        }
        self.status = [
            status_1 & !STATUS_1_READ_ONLY,
            status_2 | self.make.fixed_status_2,
        ];
        if write == StatusWrite::Stored {
            self.stored_status = self.status;
            self.status_writes += 1;
            self.busy_until = now + STATUS_WRITE;
        }
    }

    /// Quad reads without a command begin, if they are enabled: else it does not know the read before them.
    pub fn begin_continuous_reads(&mut self) {
        self.reads_continuously = self.status[1] & STATUS_2_QUAD_ENABLED != 0;
    }

    /// It takes commands again.
    pub fn end_continuous_reads(&mut self) {
        self.reads_continuously = false;
    }

    pub fn reads_continuously(&self) -> bool {
        self.reads_continuously
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sends a command at a moment; the last byte that came back.
    fn send(chip: &mut SerialChip, bytes: &[u8], now: Cycle) -> u8 {
        let answer = bytes.iter().fold(0, |_, byte| chip.exchange(*byte, now));
        chip.end_command(now);
        answer
    }

    /// A chip that leaves the factory without quad reads.
    fn without_quad_reads(status_2_write: Status2Write) -> SerialChip {
        SerialChip::new(FlashMake {
            status_2_write,
            ..FlashMake::w25q16rv([0; 8])
        })
    }

    #[test]
    fn a_stored_status_takes_10_ms_and_leaves_fixed_bits_as_they_are() {
        for (fixed, expected) in [(0, 0b10), (0x40, 0x42)] {
            let mut chip = SerialChip::new(FlashMake {
                fixed_status_2: fixed,
                ..FlashMake::w25q16jv([0; 8])
            });
            send(&mut chip, &[WRITE_ENABLE], 0);
            send(&mut chip, &[WRITE_STATUS_1, 0, 0b10], 0);
            assert_eq!(send(&mut chip, &[READ_STATUS_2, 0], 0), expected);
            assert_eq!(send(&mut chip, &[READ_STATUS_1, 0], STATUS_WRITE - 1), 1);
            assert_eq!(send(&mut chip, &[READ_STATUS_1, 0], STATUS_WRITE), 0);
            assert_eq!(chip.status_writes(), 1);
        }
    }

    #[test]
    fn a_volatile_status_takes_no_time_and_lasts_as_long_as_the_power() {
        let mut chip = without_quad_reads(Status2Write::Either);
        send(&mut chip, &[WRITE_ENABLE_VOLATILE], 0);
        send(&mut chip, &[WRITE_STATUS_2, 0b10], 0);
        assert_eq!(send(&mut chip, &[READ_STATUS_1, 0], 0), 0);
        assert_eq!((chip.status(), chip.status_writes()), ([0, 0b10], 0));
        chip.lose_power();
        assert_eq!(chip.status(), [0, 0]);
    }

    #[test]
    fn a_chip_may_take_a_volatile_write_for_none_or_for_one_that_is_stored() {
        for (write_behind_50h, expected, stored) in [
            (StatusWrite::Nothing, [0, 0], 0),
            (StatusWrite::Stored, [0, 0b10], 1),
        ] {
            let mut chip = SerialChip::new(FlashMake {
                write_behind_50h,
                ..FlashMake::w25q16rv([0; 8])
            });
            send(&mut chip, &[WRITE_ENABLE_VOLATILE], 0);
            send(&mut chip, &[WRITE_STATUS_2, 0b10], 0);
            assert_eq!(chip.is_busy(0), stored > 0);
            chip.lose_power();
            assert_eq!((chip.status(), chip.status_writes()), (expected, stored));
        }
    }

    #[test]
    fn a_status_is_written_once_after_it_was_enabled() {
        let mut chip = without_quad_reads(Status2Write::Either);
        send(&mut chip, &[WRITE_STATUS_2, 0b10], 0);
        assert_eq!(chip.status(), [0, 0], "it was not");
        send(&mut chip, &[WRITE_ENABLE_VOLATILE], 0);
        send(&mut chip, &[WRITE_STATUS_1, 0b1100, 0b10], 0);
        send(&mut chip, &[WRITE_STATUS_2, 0], 0);
        assert_eq!(chip.status(), [0b1100, 0b10], "not twice");
    }

    #[test]
    fn makes_take_status_register_2_by_different_commands() {
        for (status_2_write, alone, with_1) in [
            (Status2Write::Either, 0b10, 0b10),
            (Status2Write::Own, 0b10, 0),
            (Status2Write::WithStatus1, 0, 0b10),
            (Status2Write::Never, 0, 0),
        ] {
            for (command, expected) in [
                (&[WRITE_STATUS_2, 0b10][..], [0, alone]),
                (&[WRITE_STATUS_1, 0b100, 0b10], [0b100, with_1]),
            ] {
                let mut chip = without_quad_reads(status_2_write);
                send(&mut chip, &[WRITE_ENABLE_VOLATILE], 0);
                send(&mut chip, command, 0);
                assert_eq!(chip.status(), expected, "{status_2_write:?} {command:02x?}");
            }
        }
    }

    #[test]
    fn quad_reads_need_their_bit() {
        for (make, reads) in [
            (FlashMake::w25q16jv([0; 8]), true),
            (FlashMake::w25q16rv([0; 8]), false),
        ] {
            let mut chip = SerialChip::new(make);
            chip.begin_continuous_reads();
            assert_eq!(chip.reads_continuously(), reads);
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
    #[should_panic(expected = "command [9e]")]
    fn a_command_that_is_not_modelled_fails_by_name() {
        send(&mut SerialChip::new(FlashMake::w25q16jv([0; 8])), &[0x9e], 0);
    }
}
