//! XIP_SSI, the serial interface to the flash chip (datasheet 4.10): as much of it as the boot ROM's
//! flash functions and a second stage (2.8.1.3.1) use.
//!
//! The firmware runs its copy of the second stage after every flash operation to read flash by
//! address again. It is executed as it is; whether reads work follows from what it has written here.
//! The chip answers the serial commands that a second stage sends, and with its ids; any other fails by name.

use std::collections::VecDeque;

use super::clock::Cycle;
use super::flash::{FlashMake, SerialChip};
use super::peripheral::Peripheral;
use super::register::{RegisterWrite, bit, field};

const CTRLR0: u32 = 0x00;
const CTRLR1: u32 = 0x04;
const SSIENR: u32 = 0x08;
const RXFLR: u32 = 0x24;
const SR: u32 = 0x28;
const DR0: u32 = 0x60;
const DR35: u32 = 0xec;
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

#[derive(Clone)]
pub struct Ssi {
    registers: [u32; REGISTERS],
    received: VecDeque<u8>,
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
            chip,
        }
    }

    /// Whether a read of the flash's address range is turned into a read of the chip.
    pub fn serves_reads(&self) -> bool {
        let control = self.register(CTRLR0);
        self.is_enabled() && field(control, 8, 2) == TMOD_EEPROM_READ && field(control, 16, 5) == FRAME_OF_32
    }

    /// What `flash_exit_xip` leaves: single bytes to and from the chip.
    pub fn set_up_for_commands(&mut self) {
        self.set_up(FRAME_OF_8 << 16);
    }

    /// What `flash_enter_cmd_xip` and a second stage leave.
    pub fn set_up_for_reads(&mut self) {
        self.set_up(FRAME_OF_32 << 16 | TMOD_EEPROM_READ << 8);
    }

    fn set_up(&mut self, control: u32) {
        self.clear_fifos();
        *self.register_mut(CTRLR0) = control;
        *self.register_mut(SSIENR) = 1;
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

    fn clear_fifos(&mut self) {
        self.received.clear();
        self.chip.end_command();
    }

    /// A byte goes to the chip and one comes back. The address and mode bits of a read are no
    /// bytes; what that read returns is not used.
    fn send(&mut self, value: u32, now: Cycle) {
        let control = self.register(CTRLR0);
        let sends_bytes = field(control, 16, 5) == FRAME_OF_8;
        if !self.is_enabled() || !sends_bytes {
            return;
        }
        if field(control, 8, 2) == TMOD_EEPROM_READ {
            self.read_after(value as u8);
            return;
        }
        let received = self.chip.exchange(value as u8, now);
        self.received.push_back(received);
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
    fn read(&mut self, offset: u32, _now: Cycle) -> u32 {
        match offset {
            SR => self.status(),
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
                    self.clear_fifos();
                }
            }
            _ => {}
        }
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
    const READ_STATUS_2: u8 = 0x35;
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
        ssi.set_up_for_commands();
        write(&mut ssi, DR0, WRITE_ENABLE.into());
        assert_eq!(ssi.read(RXFLR, 0), 1);
        write(&mut ssi, SSIENR, 0);
        assert_eq!(ssi.read(RXFLR, 0), 0);
    }

    #[test]
    fn reads_are_served_when_it_is_enabled_and_set_up_for_them() {
        let mut ssi = to_chip([0; 8]);
        assert!(!ssi.serves_reads());
        // Quad I/O, as the W25Q080 second stage sets it up.
        write(&mut ssi, CTRLR0, 2 << 21 | 31 << 16 | 3 << 8);
        assert!(!ssi.serves_reads());
        write(&mut ssi, SSIENR, 1);
        assert!(ssi.serves_reads());
        ssi.set_up_for_commands();
        assert!(!ssi.serves_reads());
    }
}
