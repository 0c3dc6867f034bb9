//! XIP_SSI, the serial interface to the flash chip (datasheet 4.10): as much of it as the boot ROM's
//! flash functions and a second stage (2.8.1.3.1) use.
//!
//! The second stage is executed as it is, at the start and after every flash operation: whether flash can be read by
//! address, and what a read takes, follows from what it has written here. Modelled are 03h on one line and EBh on four
//! without its command (continuous reads). The chip answers the serial commands that a second stage sends, and with its ids;
//! any other fails by name.

use std::collections::VecDeque;

use super::clock::Cycle;
use super::flash::{FlashMake, SerialChip};
use super::peripheral::Peripheral;
use super::register::{RegisterWrite, bit, field};
use super::xip_cache::LINE_BYTES;

const CTRLR0: u32 = 0x00;
const CTRLR1: u32 = 0x04;
const SSIENR: u32 = 0x08;
const BAUDR: u32 = 0x14;
const RXFLR: u32 = 0x24;
const SR: u32 = 0x28;
const DR0: u32 = 0x60;
const DR35: u32 = 0xec;
const SPI_CTRLR0: u32 = 0xf4;
/// One word each, up to SPI_CTRLR0 and TXD_DRIVE_EDGE.
const REGISTERS: usize = 0xfc / 4;

const SR_TX_NOT_FULL: u32 = 1 << 1;
const SR_TX_EMPTY: u32 = 1 << 2;
const SR_RX_NOT_EMPTY: u32 = 1 << 3;

/// CTRLR0.TMOD: "EEPROM_READ", in which the interface sends an address and receives data.
const TMOD_EEPROM_READ: u32 = 3;
/// CTRLR0.DFS_32, length of a frame less one.
const FRAME_OF_8: u32 = 7;
const FRAME_OF_32: u32 = 31;
/// CTRLR0.SPI_FRF: one line, or four.
const STANDARD: u32 = 0;
const QUAD: u32 = 2;

/// SPI_CTRLR0: 03h and 24 bits of address, on one line.
const SERIAL_READ: u32 = 0x03 << 24 | 2 << 8 | 6 << 2;
/// SPI_CTRLR0: 24 bits of address, mode bits 1010xxxx, by which the next read needs no command, and 4 clocks of pause.
const CONTINUOUS_READ: u32 = 0xa0 << 24 | 4 << 11 | 8 << 2 | 2;
/// "Fast Read Quad I/O", and the mode bits that follow its address.
const READ_QUAD: u32 = 0xeb;
const MODE_MASK: u32 = 0xf0;
const MODE_CONTINUOUS: u32 = 0xa0;

/// CTRLR0 of reads by address.
const READS: u32 = FRAME_OF_32 << 16 | TMOD_EEPROM_READ << 8;
const READS_MASK: u32 = 31 << 16 | 3 << 8;

/// BAUDR as the boot ROM sets it, and as second stages do.
const BAUDR_OF_ROM: u32 = 6;
const BAUDR_OF_QUAD: u32 = 2;

#[derive(Clone)]
pub struct Ssi {
    registers: [u32; REGISTERS],
    received: VecDeque<u8>,
    /// The command of quad reads was sent last.
    begins_quad_read: bool,
    /// Cycles for a line of the flash cache; `None` while flash can't be read by address.
    line_cycles: Option<Cycle>,
    /// Not touched by a reset.
    pub chip: SerialChip,
}

impl Ssi {
    /// The interface to a chip of this make.
    pub fn new(make: FlashMake) -> Self {
        Self::to(SerialChip::new(make))
    }

    fn to(chip: SerialChip) -> Self {
        Self {
            registers: [0; REGISTERS],
            received: VecDeque::new(),
            begins_quad_read: false,
            line_cycles: None,
            chip,
        }
    }

    /// Whether a read of the flash's address range is turned into a read of the chip.
    pub fn serves_reads(&self) -> bool {
        self.line_cycles.is_some()
    }

    /// Cycles that such a read takes for a line of the flash cache; `None` if there is none.
    pub fn line_cycles(&self) -> Option<Cycle> {
        self.line_cycles
    }

    /// What `flash_exit_xip` leaves: single bytes to and from the chip.
    pub fn set_up_for_commands(&mut self, now: Cycle) {
        self.chip.end_continuous_reads();
        self.set_up(STANDARD, FRAME_OF_8 << 16, 0, BAUDR_OF_ROM, now);
    }

    /// What `flash_enter_cmd_xip` leaves: reads on one line.
    pub fn set_up_for_serial_reads(&mut self, now: Cycle) {
        self.set_up(STANDARD, READS, SERIAL_READ, BAUDR_OF_ROM, now);
    }

    /// The state that a second stage leaves for a chip whose quad reads are enabled.
    pub fn set_up_for_quad_reads(&mut self, now: Cycle) {
        self.chip.begin_continuous_reads();
        self.set_up(QUAD, READS, CONTINUOUS_READ, BAUDR_OF_QUAD, now);
    }

    fn set_up(&mut self, format: u32, control: u32, read: u32, divider: u32, now: Cycle) {
        self.clear_fifos(now);
        *self.register_mut(CTRLR0) = format << 21 | control;
        *self.register_mut(SPI_CTRLR0) = read;
        *self.register_mut(BAUDR) = divider;
        *self.register_mut(SSIENR) = 1;
        self.line_cycles = self.find_line_cycles(now);
    }

    fn find_line_cycles(&self, now: Cycle) -> Option<Cycle> {
        let control = self.register(CTRLR0);
        if !self.is_enabled() || control & READS_MASK != READS || self.chip.is_busy(now) {
            return None;
        }
        let bits = 8 * LINE_BYTES;
        let clocks = match (field(control, 21, 2), self.register(SPI_CTRLR0)) {
            (STANDARD, SERIAL_READ) if !self.chip.reads_continuously() => 8 + 24 + bits,
            (QUAD, CONTINUOUS_READ) if self.chip.reads_continuously() => (24 + 8) / 4 + 4 + bits / 4,
            _ => return None,
        };
        Some(Cycle::from(clocks * self.register(BAUDR)))
    }

    fn register(&self, offset: u32) -> u32 {
        self.registers.get(offset as usize / 4).copied().unwrap_or(0)
    }

    fn register_mut(&mut self, offset: u32) -> &mut u32 {
        &mut self.registers[offset as usize / 4]
    }

    fn is_enabled(&self) -> bool {
        bit(self.register(SSIENR), 0)
    }

    fn status(&self) -> u32 {
        let received = if self.received.is_empty() {
            0
        } else {
            SR_RX_NOT_EMPTY
        };
        SR_TX_NOT_FULL | SR_TX_EMPTY | received
    }

    fn clear_fifos(&mut self, now: Cycle) {
        self.received.clear();
        self.begins_quad_read = false;
        self.chip.end_command(now);
    }

    /// A byte goes to the chip and one comes back; or a word of a read, the command, then address and mode bits.
    fn send(&mut self, value: u32, now: Cycle) {
        if !self.is_enabled() {
            return;
        }
        let control = self.register(CTRLR0);
        if field(control, 16, 5) != FRAME_OF_8 {
            self.send_word_of_read(value);
            return;
        }
        if field(control, 8, 2) == TMOD_EEPROM_READ {
            self.read_after(value as u8);
            return;
        }
        let received = self.chip.exchange(value as u8, now);
        self.received.push_back(received);
    }

    /// Of a read whose result is not used.
    fn send_word_of_read(&mut self, value: u32) {
        let is_quad = field(self.register(CTRLR0), 21, 2) == QUAD;
        if is_quad && self.begins_quad_read && value & MODE_MASK == MODE_CONTINUOUS {
            self.chip.begin_continuous_reads();
        }
        self.begins_quad_read = is_quad && value == READ_QUAD;
    }

    /// "EEPROM_READ": what comes back while the command is sent is dropped, and then as many frames are received as CTRLR1.NDF
    /// says, and one more (4.10.13).
    fn read_after(&mut self, command: u8) {
        let frames = field(self.register(CTRLR1), 0, 16) as usize + 1;
        self.received
            .extend(self.chip.read_after(command).into_iter().take(frames));
    }
}

impl Peripheral for Ssi {
    /// A program reads SR to wait until all is sent: the chip is deselected then.
    fn read(&mut self, offset: u32, now: Cycle) -> u32 {
        match offset {
            SR => {
                self.chip.end_command(now);
                self.status()
            }
            RXFLR => self.received.len() as u32,
            DR0..=DR35 => u32::from(self.received.pop_front().unwrap_or(0)),
            _ => self.register(offset),
        }
    }

    fn write(&mut self, offset: u32, write: RegisterWrite, now: Cycle) {
        match offset {
            DR0..=DR35 => self.send(write.value, now),
            _ if (offset as usize) < 4 * REGISTERS => {
                let register = self.register_mut(offset);
                *register = write.applied_to(*register);
                if !self.is_enabled() {
                    self.clear_fifos(now);
                }
            }
            _ => {}
        }
        self.line_cycles = self.find_line_cycles(now);
    }

    fn reset(&mut self, _now: Cycle) {
        *self = Self::to(self.chip.clone());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const READ_STATUS_1: u8 = 0x05;
    const WRITE_ENABLE: u8 = 0x06;
    const WRITE_STATUS_2: u8 = 0x31;
    const READ_STATUS_2: u8 = 0x35;
    const WRITE_ENABLE_VOLATILE: u8 = 0x50;
    const READ_UNIQUE_ID: u8 = 0x4b;

    fn to_chip(unique_id: [u8; 8]) -> Ssi {
        Ssi::new(FlashMake::w25q16jv(unique_id))
    }

    fn write(ssi: &mut Ssi, offset: u32, value: u32) {
        ssi.write(offset, RegisterWrite::plain(value), 0);
    }

    #[test]
    fn the_status_registers_are_read_as_a_second_stage_reads_them() {
        let mut ssi = to_chip([0; 8]);
        write(&mut ssi, CTRLR0, FRAME_OF_8 << 16);
        write(&mut ssi, SSIENR, 1);
        for (command, status) in [(READ_STATUS_2, 0b10), (READ_STATUS_1, 0)] {
            write(&mut ssi, DR0, command.into());
            write(&mut ssi, DR0, command.into());
            assert_eq!(ssi.read(SR, 0), SR_TX_NOT_FULL | SR_TX_EMPTY | SR_RX_NOT_EMPTY);
            ssi.read(DR0, 0);
            assert_eq!(ssi.read(DR0, 0), status, "{command:#x}");
            assert_eq!(ssi.read(SR, 0), SR_TX_NOT_FULL | SR_TX_EMPTY);
        }
    }

    #[test]
    fn the_unique_id_comes_after_four_dummy_bytes_and_outlasts_a_reset() {
        let mut ssi = to_chip([1, 2, 3, 4, 5, 6, 7, 8]);
        for _ in 0..2 {
            write(&mut ssi, CTRLR0, FRAME_OF_8 << 16 | TMOD_EEPROM_READ << 8);
            write(&mut ssi, CTRLR1, 11);
            write(&mut ssi, SSIENR, 1);
            write(&mut ssi, DR0, READ_UNIQUE_ID.into());
            assert_eq!(ssi.read(RXFLR, 0), 12);
            let received: Vec<u32> = (0..12).map(|_| ssi.read(DR0, 0)).collect();
            assert_eq!(received[4..], [1, 2, 3, 4, 5, 6, 7, 8]);
            ssi.reset(0);
        }
    }

    #[test]
    fn disabling_it_clears_what_was_received() {
        let mut ssi = to_chip([0; 8]);
        ssi.set_up_for_commands(0);
        write(&mut ssi, DR0, WRITE_ENABLE.into());
        assert_eq!(ssi.read(RXFLR, 0), 1);
        write(&mut ssi, SSIENR, 0);
        assert_eq!(ssi.read(RXFLR, 0), 0);
    }

    #[test]
    fn what_is_sent_between_two_looks_at_sr_is_one_command() {
        let mut ssi = Ssi::new(FlashMake::w25q16rv([0; 8]));
        ssi.set_up_for_commands(0);
        write(&mut ssi, DR0, WRITE_ENABLE_VOLATILE.into());
        ssi.read(SR, 0);
        for byte in [WRITE_STATUS_2, 0b10] {
            write(&mut ssi, DR0, byte.into());
        }
        assert_eq!(ssi.chip.status(), [0, 0]);
        ssi.read(SR, 0);
        assert_eq!(ssi.chip.status(), [0, 0b10]);
    }

    /// Sets it up for reads, with the clock divided by `divider`.
    fn set_up(ssi: &mut Ssi, format: u32, read: u32, divider: u32) {
        for (offset, value) in [
            (SSIENR, 0),
            (CTRLR0, format << 21 | READS),
            (SPI_CTRLR0, read),
            (BAUDR, divider),
            (SSIENR, 1),
        ] {
            write(ssi, offset, value);
        }
    }

    /// Sets it up for quad reads, as second stages do.
    fn set_up_for_quad_reads(ssi: &mut Ssi) {
        const FIRST_READ: u32 = 4 << 11 | 2 << 8 | 8 << 2 | 1;
        set_up(ssi, QUAD, FIRST_READ, 2);
        write(ssi, DR0, READ_QUAD);
        write(ssi, DR0, MODE_CONTINUOUS);
        set_up(ssi, QUAD, CONTINUOUS_READ, 2);
    }

    #[test]
    fn a_line_takes_the_clocks_of_its_bits_on_one_wire_or_on_four() {
        let mut ssi = to_chip([0; 8]);
        assert_eq!(ssi.line_cycles(), None);
        set_up(&mut ssi, STANDARD, SERIAL_READ, 4);
        assert_eq!(ssi.line_cycles(), Some(4 * 96));
        set_up_for_quad_reads(&mut ssi);
        assert_eq!(ssi.line_cycles(), Some(2 * 28));
        write(&mut ssi, SSIENR, 0);
        assert!(!ssi.serves_reads());
    }

    #[test]
    fn reads_without_a_command_need_one_that_has_begun_them_and_quad_reads_that_are_enabled() {
        let mut ssi = to_chip([0; 8]);
        set_up(&mut ssi, QUAD, CONTINUOUS_READ, 2);
        assert!(!ssi.serves_reads(), "none has");
        set_up_for_quad_reads(&mut ssi);
        assert!(ssi.serves_reads());
        set_up(&mut ssi, STANDARD, SERIAL_READ, 4);
        assert!(!ssi.serves_reads(), "the chip takes no command");
        ssi.set_up_for_commands(0);
        assert!(!ssi.serves_reads());
        ssi.set_up_for_serial_reads(0);
        assert!(ssi.serves_reads());

        let mut ssi = Ssi::new(FlashMake::w25q16rv([0; 8]));
        set_up_for_quad_reads(&mut ssi);
        assert!(!ssi.serves_reads(), "they are not");
    }

    #[test]
    fn a_chip_that_stores_its_registers_is_not_read() {
        let mut ssi = to_chip([0; 8]);
        ssi.set_up_for_commands(0);
        for command in [&[WRITE_ENABLE][..], &[WRITE_STATUS_2, 0b10]] {
            command
                .iter()
                .for_each(|byte| write(&mut ssi, DR0, u32::from(*byte)));
            ssi.read(SR, 0);
        }
        set_up_for_quad_reads(&mut ssi);
        assert!(!ssi.serves_reads());
    }
}
