//! BQ76952: monitor of up to 16 cells in series (SLUUBY2B, SLUAA11B).
//!
//! Its words are in the units of DA Configuration (SLUUBY2B table 13-23); the current ends at 200 mV over its shunt (SLUSDZ7 7.18),
//! in its word at 16 bits, while the charge is counted on. Left out: its protection, which finds nothing, thermistors at pins
//! other than TS1 to TS3, modes of less power, a sealed data memory, writes to it, the check byte behind each byte that can be
//! set up. Its set-up is in its one-time memory, so it is there again after a reset. The time of its first measurements is
//! assumed.

use super::super::super::clock::{CLK_SYS_HZ, Cycle, cycles};
use super::super::device::{Ack, I2cDevice, I2cDirection};
use super::signed_code;

const CELLS: usize = 16;

const BATTERY_STATUS: u8 = 0x12;
const FIRST_CELL: u8 = 0x14;
const LAST_CELL: u8 = 0x32;
const STACK: u8 = 0x34;
const PACK_PIN: u8 = 0x36;
const LD_PIN: u8 = 0x38;
const CC2_CURRENT: u8 = 0x3a;
const SUBCOMMAND: u8 = 0x3e;
const SUBCOMMAND_HIGH: u8 = 0x3f;
const BUFFER: u8 = 0x40;
const BUFFER_END: u8 = 0x5f;
const CHECKSUM: u8 = 0x60;
const LENGTH: u8 = 0x61;
const INT_TEMPERATURE: u8 = 0x68;
const TS1_TEMPERATURE: u8 = 0x70;
const TS3_TEMPERATURE: u8 = 0x74;

const DEVICE_NUMBER: u16 = 0x0001;
const MANUFACTURING_STATUS: u16 = 0x0057;
const DASTATUS6: u16 = 0x0076;
/// The data memory, and what is set up in it.
const DATA_MEMORY: u16 = 0x9180;
const DATA_MEMORY_END: u16 = 0x93ff;
const TS1_CONFIG: u16 = 0x92fd;
const TS3_CONFIG: u16 = 0x92ff;
const DA_CONFIGURATION: u16 = 0x9303;
const VCELL_MODE: u16 = 0x9304;

/// Battery Status: the data memory can be read.
const FULL_ACCESS: u16 = 1 << 8;

/// DA Configuration unless it is set up: 10 mV and 1 mA.
const DA_CONFIGURATION_RESET: u8 = 0x05;

/// The shunt, and the end of what is measured over it.
const SHUNT_OHM: f64 = 0.001;
const MOST_SENSE_V: f64 = 0.2;

/// Until all cells have been measured after a reset.
const FIRST_SCAN: Cycle = cycles(100_000);

/// The time that a subcommand takes.
const BUSY: Cycle = cycles(500);
const BUSY_BYTE: u8 = 0xff;

/// The accumulated charge starts at half a step.
const CHARGE_RESET: i64 = 1 << 31;

#[derive(Clone, Copy)]
struct State {
    /// In 2^-32 of the unit of current times an hour.
    charge: i64,
    charge_since: Cycle,
    measured_at: Cycle,
    subcommand: u16,
    ready_at: Cycle,
}

impl State {
    fn after_reset(now: Cycle) -> Self {
        Self {
            charge: CHARGE_RESET,
            charge_since: now,
            measured_at: now + FIRST_SCAN,
            subcommand: 0,
            ready_at: 0,
        }
    }
}

pub struct Bq76952 {
    cells_mv: [u16; CELLS],
    amperes: f64,
    /// Share of the time in which the current flows.
    pulses: f64,
    celsius: f64,
    da_configuration: u8,
    vcell_mode: u16,
    /// The use of each pin, and the temperature of the thermistor there.
    thermistors: [(u8, f64); 3],
    state: State,
    now: Cycle,
    pointer: u8,
    /// The data of the last subcommand, as they were when it was written.
    buffer: Vec<u8>,
    /// Bytes since the START.
    written: Vec<u8>,
}

impl Default for Bq76952 {
    fn default() -> Self {
        Self::new()
    }
}

impl Bq76952 {
    /// Connected to nothing.
    pub fn new() -> Self {
        Self {
            cells_mv: [0; CELLS],
            amperes: 0.0,
            pulses: 1.0,
            celsius: 25.0,
            da_configuration: DA_CONFIGURATION_RESET,
            vcell_mode: 0,
            thermistors: [(0, 0.0); 3],
            state: State::after_reset(0),
            now: 0,
            pointer: 0,
            buffer: Vec::new(),
            written: Vec::new(),
        }
    }

    /// Cells at the inputs from the first on; the current is positive when it flows out of them.
    pub fn set(&mut self, cells_mv: &[u16], amperes: f64, celsius: f64) {
        self.cells_mv = [0; CELLS];
        self.cells_mv[..cells_mv.len()].copy_from_slice(cells_mv);
        self.amperes = amperes;
        self.celsius = celsius;
    }

    /// The current flows for this share of the time, in pulses that are much shorter than its 3 ms.
    pub fn set_pulses(&mut self, share: f64) {
        self.pulses = share;
    }

    /// Sets up DA Configuration, and Vcell Mode: the inputs that have a cell, the first in bit 0.
    pub fn set_up_units(&mut self, da_configuration: u8, vcell_mode: u16) {
        (self.da_configuration, self.vcell_mode) = (da_configuration, vcell_mode);
    }

    /// The charge that it has counted, in 2^-32 of the unit of current times an hour, into the pack.
    pub fn set_charge(&mut self, charge: i64) {
        self.state.charge = charge;
    }

    /// Sets up TS1 to TS3 for these uses, with thermistors at these temperatures.
    pub fn set_thermistors(&mut self, thermistors: [(u8, f64); 3]) {
        self.thermistors = thermistors;
    }

    /// The supply of the device is gone and back. What it is connected to stays.
    pub fn power_cycle(&mut self) {
        self.state = State::after_reset(self.now);
        self.buffer.clear();
        self.written.clear();
    }

    fn user_volts(&self) -> f64 {
        if self.da_configuration & 1 << 2 != 0 {
            1e-2
        } else {
            1e-3
        }
    }

    fn user_amperes(&self) -> f64 {
        [1e-4, 1e-3, 1e-2, 1e-1][usize::from(self.da_configuration & 0b11)]
    }

    /// The mean current that it measures.
    fn shown_amperes(&self) -> f64 {
        let most = MOST_SENSE_V / SHUNT_OHM;
        self.amperes.clamp(-most, most) * self.pulses
    }

    /// Counts the charge until `now`.
    fn advance(&mut self, now: Cycle) {
        let hours = (now - self.now) as f64 / CLK_SYS_HZ as f64 / 3600.0;
        let into = -self.shown_amperes() / self.user_amperes() * hours;
        self.state.charge += (into * 2f64.powi(32)).round() as i64;
        self.now = now;
    }

    fn word(&self, command: u8) -> u16 {
        let stack_v = f64::from(self.cells_mv.iter().map(|mv| u32::from(*mv)).sum::<u32>()) / 1000.0;
        match command {
            BATTERY_STATUS => FULL_ACCESS,
            FIRST_CELL..=CC2_CURRENT if self.now < self.state.measured_at => 0,
            FIRST_CELL..=LAST_CELL => self.cells_mv[usize::from(command - FIRST_CELL) / 2],
            STACK | PACK_PIN | LD_PIN => signed_code(stack_v, self.user_volts(), 16) as u16,
            CC2_CURRENT => signed_code(-self.shown_amperes(), self.user_amperes(), 16) as u16,
            INT_TEMPERATURE => tenths_k(self.celsius),
            TS1_TEMPERATURE..=TS3_TEMPERATURE => {
                let (_, celsius) = self.thermistors[usize::from(command - TS1_TEMPERATURE) / 2];
                tenths_k(celsius)
            }
            _ => 0,
        }
    }

    /// What the last subcommand gives now.
    fn answer(&self) -> Vec<u8> {
        match self.state.subcommand {
            DEVICE_NUMBER => 0x7695u16.to_le_bytes().to_vec(),
            MANUFACTURING_STATUS => vec![0; 2],
            DASTATUS6 => {
                let seconds = ((self.now - self.state.charge_since) / CLK_SYS_HZ) as u32;
                let integer = (self.state.charge >> 32) as i32;
                let fraction = self.state.charge as u32;
                [
                    integer.to_le_bytes(),
                    fraction.to_le_bytes(),
                    seconds.to_le_bytes(),
                ]
                .concat()
            }
            // A read of the data memory gives a whole buffer.
            DATA_MEMORY..=DATA_MEMORY_END => {
                let addresses = (self.state.subcommand..).take(32);
                addresses.map(|address| self.set_up(address)).collect()
            }
            _ => Vec::new(),
        }
    }

    /// A byte of the data memory.
    fn set_up(&self, address: u16) -> u8 {
        match address {
            TS1_CONFIG..=TS3_CONFIG => self.thermistors[usize::from(address - TS1_CONFIG)].0,
            DA_CONFIGURATION => self.da_configuration,
            VCELL_MODE => self.vcell_mode as u8,
            address if address == VCELL_MODE + 1 => (self.vcell_mode >> 8) as u8,
            _ => 0,
        }
    }

    fn byte(&self, address: u8) -> u8 {
        let [low, high] = self.state.subcommand.to_le_bytes();
        match address {
            SUBCOMMAND..=LENGTH if self.now < self.state.ready_at => BUSY_BYTE,
            SUBCOMMAND => low,
            SUBCOMMAND_HIGH => high,
            BUFFER..=BUFFER_END => {
                let byte = self.buffer.get(usize::from(address - BUFFER));
                byte.copied().unwrap_or(0)
            }
            CHECKSUM => {
                let bytes = [low, high].into_iter().chain(self.buffer.iter().copied());
                !bytes.fold(0u8, u8::wrapping_add)
            }
            LENGTH => self.buffer.len() as u8 + 4,
            _ => self.word(address & !1).to_le_bytes()[usize::from(address & 1)],
        }
    }
}

fn tenths_k(celsius: f64) -> u16 {
    signed_code(celsius + 273.15, 0.1, 16) as u16
}

impl I2cDevice for Bq76952 {
    fn start(&mut self, direction: I2cDirection, now: Cycle) -> Ack {
        self.advance(now);
        if direction == I2cDirection::Write {
            self.written.clear();
        }
        Ack::Ack
    }

    fn write(&mut self, byte: u8) -> Ack {
        self.written.push(byte);
        match self.written[..] {
            [pointer] => self.pointer = pointer,
            [SUBCOMMAND, low, high] => {
                self.state.subcommand = u16::from_le_bytes([low, high]);
                self.state.ready_at = self.now + BUSY;
                self.buffer = self.answer();
            }
            _ => {}
        }
        Ack::Ack
    }

    fn read(&mut self) -> u8 {
        let byte = self.byte(self.pointer);
        self.pointer = self.pointer.wrapping_add(1);
        byte
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_at(device: &mut Bq76952, command: u8, bytes: usize, now: Cycle) -> Vec<u8> {
        device.start(I2cDirection::Write, now);
        device.write(command);
        device.start(I2cDirection::Read, now);
        (0..bytes).map(|_| device.read()).collect()
    }

    fn ask(device: &mut Bq76952, subcommand: u16, now: Cycle) {
        let [low, high] = subcommand.to_le_bytes();
        device.start(I2cDirection::Write, now);
        for byte in [SUBCOMMAND, low, high] {
            device.write(byte);
        }
        device.stop();
    }

    #[test]
    fn ti_s_examples_read_as_they_say() {
        // SLUAA11B 1.2 to 1.4: 3700 mV, 298.2 K, 7 mA. SLAAEB3, table 4-6: 16 cells of 1532 mV and a little less, 24.4 V.
        for (cells, command, bytes) in [
            (&[3700][..], FIRST_CELL, [0x74, 0x0e]),
            (&[3700], INT_TEMPERATURE, [0xa6, 0x0b]),
            (&[3700], CC2_CURRENT, [0x07, 0x00]),
            (&[1525; 16], STACK, [0x88, 0x09]),
        ] {
            let mut device = Bq76952::new();
            device.set(cells, -0.007, 25.05);
            assert_eq!(
                read_at(&mut device, command, 2, FIRST_SCAN),
                bytes,
                "{command:#x}"
            );
        }
    }

    #[test]
    fn nothing_is_measured_before_the_first_scan() {
        let mut device = Bq76952::new();
        device.set(&[3700; 4], 1.0, 25.0);
        let words = |device: &mut Bq76952, now| [FIRST_CELL, STACK].map(|at| read_at(device, at, 2, now));
        assert_eq!(words(&mut device, FIRST_SCAN - 1), [[0; 2]; 2]);
        assert_eq!(words(&mut device, FIRST_SCAN), [[0x74, 0x0e], [0xc8, 0x05]]);
        device.power_cycle();
        assert_eq!(words(&mut device, 2 * FIRST_SCAN - 1), [[0; 2]; 2]);
    }

    #[test]
    fn the_word_of_the_current_ends_before_the_count_which_ends_at_200_mv() {
        let mut device = Bq76952::new();
        let mut now = FIRST_SCAN;
        device.advance(now);
        for (amperes, pulses, word, counted_a) in [
            (32.0, 1.0, -32_000, 32.0),
            (100.0, 1.0, i16::MIN, 100.0),
            (-100.0, 1.0, i16::MAX, -100.0),
            // 200 A are shown of 300.
            (300.0, 0.1, -20_000, 20.0),
        ] {
            device.set(&[3700; 4], amperes, 25.0);
            device.set_pulses(pulses);
            let before = device.state.charge;
            now += CLK_SYS_HZ;
            assert_eq!(read_at(&mut device, CC2_CURRENT, 2, now), word.to_le_bytes());
            let into = (device.state.charge - before) as f64 / 2f64.powi(32) * 3.6;
            assert!((into + counted_a).abs() < 0.01 * counted_a.abs(), "{into}");
        }
    }

    #[test]
    fn a_subcommand_is_answered_after_its_time_with_checksum_and_length() {
        let mut device = Bq76952::new();
        ask(&mut device, DEVICE_NUMBER, 0);
        assert_eq!(read_at(&mut device, 0x3e, 2, BUSY - 1), [0xff, 0xff]);
        assert_eq!(read_at(&mut device, 0x3e, 4, BUSY), [0x01, 0x00, 0x95, 0x76]);
        assert_eq!(read_at(&mut device, 0x60, 2, BUSY), [!0x0c, 6]);
    }

    #[test]
    fn charge_out_of_the_pack_counts_down_from_a_half() {
        let mut device = Bq76952::new();
        device.set(&[4000; 3], 3.6, 25.0);
        // 1 mAh in a second.
        ask(&mut device, DASTATUS6, CLK_SYS_HZ);
        let read = read_at(&mut device, 0x40, 12, CLK_SYS_HZ + BUSY);
        assert_eq!(read[..4], (-1i32).to_le_bytes());
        assert!(u32::from_le_bytes([read[4], read[5], read[6], read[7]]).abs_diff(1 << 31) < 1 << 22);
        assert_eq!(read[8..], 1u32.to_le_bytes());
    }

    #[test]
    fn a_read_of_the_data_memory_gives_a_whole_buffer() {
        let mut device = Bq76952::new();
        ask(&mut device, DA_CONFIGURATION, 0);
        assert_eq!(read_at(&mut device, BUFFER, 3, BUSY), [0x05, 0, 0]);
        assert_eq!(read_at(&mut device, LENGTH, 1, BUSY), [0x24]);
        assert_eq!(read_at(&mut device, BATTERY_STATUS, 2, BUSY), [0x00, 0x01]);
    }
}
