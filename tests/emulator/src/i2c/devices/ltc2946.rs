//! LTC2946: 12-bit power monitor with charge, energy and time accumulators (datasheet table 2).
//!
//! Left out: extremes, thresholds and alerts, GPIO pins, the external clock, the order in which the
//! converter takes its inputs, snapshots, "auto-reset" of the accumulators. What is not measured reads
//! back what was written. A current in the other direction reads as zero.

use super::super::super::clock::{CLK_SYS_HZ, Cycle};
use super::super::device::{Ack, I2cDevice, I2cDirection};
use super::unsigned_code;

const CTRLA: u8 = 0x00;
const CTRLB: u8 = 0x01;
const POWER: u8 = 0x05;
const DELTA_SENSE: u8 = 0x14;
const VIN: u8 = 0x1e;
const ADIN: u8 = 0x28;
const TIME_COUNTER: u8 = 0x34;
const CHARGE: u8 = 0x38;
const ENERGY: u8 = 0x3c;
const STATUS2: u8 = 0x40;
const FAULT2: u8 = 0x41;
const MFR_SPECIAL_ID: u8 = 0xe7;

const CTRLA_RESET: u8 = 0x18;
const FAULT2_RESERVED: u8 = 0x80;
/// The second byte is not confirmed.
const SPECIAL_ID: [u8; 2] = [0x60, 0x01];

/// Overflow bits of STATUS2 and FAULT2.
const TIME_OVERFLOW: u8 = 1;
const CHARGE_OVERFLOW: u8 = 1 << 1;
const ENERGY_OVERFLOW: u8 = 1 << 2;

const FULL_SCALE: f64 = 4095.0;
const DELTA_SENSE_LSB_V: f64 = 0.1024 / FULL_SCALE;
const VIN_LSB_V: f64 = 102.4 / FULL_SCALE;
const ADIN_LSB_V: f64 = 2.048 / FULL_SCALE;
const RESULT_BITS: u32 = 12;
/// A result is in the upper bits of its two bytes.
const LEFT_ALIGNED: u32 = 4;

/// The accumulators take the last result 250 kHz / 4101 times a second.
const TICK: f64 = CLK_SYS_HZ as f64 * 4101.0 / 250_000.0;
/// How many bits of what is added up are below those that can be read.
const CHARGE_FRACTION: u32 = 4;
const ENERGY_FRACTION: u32 = 16;
const REGISTER_BITS: u32 = 32;

/// CTRLB.ACC: bits 3 and 2. CTRLB.RESET: bits 1 and 0.
const ACCUMULATE: u8 = 0b11 << 2;
const SHUT_DOWN: u8 = 1 << 6;
const RESET_MASK: u8 = 0b11;
const RESET_ACCUMULATORS: u8 = 0b10;
const RESET_ALL: u8 = 0b11;

/// A sum that starts again from 0 when it is full.
#[derive(Clone, Copy, Default)]
struct Accumulator {
    sum: u64,
}

impl Accumulator {
    /// Whether it has overflowed.
    fn add(&mut self, count: u64, fraction: u32) -> bool {
        let capacity = 1 << (REGISTER_BITS + fraction);
        let sum = self.sum + count;
        self.sum = sum % capacity;
        sum >= capacity
    }

    fn register(self, fraction: u32) -> u32 {
        (self.sum >> fraction) as u32
    }
}

#[derive(Clone, Copy)]
struct State {
    registers: [u8; 256],
    time: Accumulator,
    charge: Accumulator,
    energy: Accumulator,
    overflows: u8,
}

impl State {
    fn after_reset() -> Self {
        let mut registers = [0; 256];
        registers[usize::from(CTRLA)] = CTRLA_RESET;
        Self {
            registers,
            time: Accumulator::default(),
            charge: Accumulator::default(),
            energy: Accumulator::default(),
            overflows: 0,
        }
    }

    fn clear_accumulators(&mut self) {
        *self = Self {
            registers: self.registers,
            ..Self::after_reset()
        };
    }
}

pub struct Ltc2946 {
    shunt_ohm: f64,
    volts: f64,
    amperes: f64,
    adin_volts: f64,
    /// How much faster its oscillator is than it should be, as a fraction.
    clock_error: f64,
    state: State,
    /// Ticks counted since the emulation began; `None`: from the moment it is addressed next.
    ticked: Option<u64>,
    pointer: Option<u8>,
}

impl Ltc2946 {
    pub fn new(shunt_ohm: f64) -> Self {
        Self {
            shunt_ohm,
            volts: 0.0,
            amperes: 0.0,
            adin_volts: 0.0,
            clock_error: 0.0,
            state: State::after_reset(),
            ticked: Some(0),
            pointer: None,
        }
    }

    /// The accumulators take this load from the moment it was addressed last. SENSE+ and VDD are
    /// connected to each other.
    pub fn set(&mut self, volts: f64, amperes: f64) {
        (self.volts, self.amperes) = (volts, amperes);
    }

    pub fn set_adin(&mut self, volts: f64) {
        self.adin_volts = volts;
    }

    /// Five percent either way without a crystal. To be set before it is used.
    pub fn set_clock_error(&mut self, fraction: f64) {
        self.clock_error = fraction;
    }

    /// The supply of the device is gone and back. What it is connected to stays.
    pub fn power_cycle(&mut self) {
        self.state = State::after_reset();
        self.ticked = None;
        self.pointer = None;
    }

    fn delta_sense_code(&self) -> u32 {
        unsigned_code(self.amperes * self.shunt_ohm, DELTA_SENSE_LSB_V, RESULT_BITS) as u32
    }

    fn adin_code(&self) -> u32 {
        unsigned_code(self.adin_volts, ADIN_LSB_V, RESULT_BITS) as u32
    }

    /// What CTRLA has selected as the voltage: the current input, VDD, ADIN or SENSE+.
    fn voltage_code(&self) -> u32 {
        match self.register(CTRLA) >> 3 & 3 {
            0 => self.delta_sense_code(),
            2 => self.adin_code(),
            _ => unsigned_code(self.volts, VIN_LSB_V, RESULT_BITS) as u32,
        }
    }

    /// The full 24 bits: the product of both results.
    fn power_code(&self) -> u32 {
        self.delta_sense_code() * self.voltage_code()
    }

    fn register(&self, address: u8) -> u8 {
        self.state.registers[usize::from(address)]
    }

    fn is_accumulating(&self) -> bool {
        let stopped = ACCUMULATE | SHUT_DOWN;
        let ctrlb = self.register(CTRLB);
        ctrlb & stopped == 0 && ctrlb & RESET_MASK != RESET_ACCUMULATORS
    }

    fn count_ticks(&mut self, now: Cycle) {
        let ticks = (now as f64 * (1.0 + self.clock_error) / TICK) as u64;
        let elapsed = ticks - self.ticked.replace(ticks).unwrap_or(ticks);
        if !self.is_accumulating() {
            return;
        }
        let (charge, energy) = (u64::from(self.delta_sense_code()), u64::from(self.power_code()));
        let state = &mut self.state;
        for (overflowed, flag) in [
            (state.time.add(elapsed, 0), TIME_OVERFLOW),
            (
                state.charge.add(elapsed * charge, CHARGE_FRACTION),
                CHARGE_OVERFLOW,
            ),
            (
                state.energy.add(elapsed * energy, ENERGY_FRACTION),
                ENERGY_OVERFLOW,
            ),
        ] {
            state.overflows |= if overflowed { flag } else { 0 };
        }
    }

    fn byte_at(&self, address: u8) -> u8 {
        let aligned = |code: u32| code << LEFT_ALIGNED;
        let state = &self.state;
        let (first, value, size) = match address {
            POWER..0x08 => (POWER, self.power_code(), 3),
            DELTA_SENSE..0x16 => (DELTA_SENSE, aligned(self.delta_sense_code()), 2),
            VIN..0x20 => (VIN, aligned(self.voltage_code()), 2),
            ADIN..0x2a => (ADIN, aligned(self.adin_code()), 2),
            TIME_COUNTER..CHARGE => (TIME_COUNTER, state.time.register(0), 4),
            CHARGE..ENERGY => (CHARGE, state.charge.register(CHARGE_FRACTION), 4),
            ENERGY..STATUS2 => (ENERGY, state.energy.register(ENERGY_FRACTION), 4),
            STATUS2 => return state.overflows,
            FAULT2 => return state.overflows | FAULT2_RESERVED,
            MFR_SPECIAL_ID..0xe9 => return SPECIAL_ID[usize::from(address - MFR_SPECIAL_ID)],
            _ => return self.register(address),
        };
        (value >> (8 * (size - 1 - (address - first)))) as u8
    }

    fn store(&mut self, address: u8, byte: u8) {
        match address {
            CTRLB if byte & RESET_MASK == RESET_ALL => self.state = State::after_reset(),
            CTRLB if byte & RESET_MASK == RESET_ACCUMULATORS => {
                self.state.clear_accumulators();
                self.state.registers[usize::from(CTRLB)] = byte;
            }
            FAULT2 => self.state.overflows &= byte,
            _ => self.state.registers[usize::from(address)] = byte,
        }
    }
}

impl I2cDevice for Ltc2946 {
    fn start(&mut self, direction: I2cDirection, now: Cycle) -> Ack {
        self.count_ticks(now);
        if direction == I2cDirection::Write {
            self.pointer = None;
        }
        Ack::Ack
    }

    /// The address of a register, then bytes for it and those after it.
    fn write(&mut self, byte: u8) -> Ack {
        match self.pointer {
            None => self.pointer = Some(byte),
            Some(address) => {
                self.store(address, byte);
                self.pointer = Some(address.wrapping_add(1));
            }
        }
        Ack::Ack
    }

    fn read(&mut self) -> u8 {
        let address = self.pointer.unwrap_or(0);
        self.pointer = Some(address.wrapping_add(1));
        self.byte_at(address)
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::super::clock::cycles;
    use super::super::register_map::driver::{read, read_at};
    use super::*;

    const SECOND: Cycle = CLK_SYS_HZ;

    fn write(device: &mut Ltc2946, address: u8, byte: u8, now: Cycle) {
        device.start(I2cDirection::Write, now);
        device.write(address);
        device.write(byte);
        device.stop();
    }

    /// 40 A and 50 V at half a milliohm: 20 mV are 799.8 steps of 25.006 uV, 50 V 1999.5 of 25.006 mV.
    fn example() -> Ltc2946 {
        let mut device = Ltc2946::new(0.0005);
        device.set(50.0, 40.0);
        device
    }

    /// The time at which this many ticks of 16.404 ms are over.
    fn after_ticks(ticks: u64) -> Cycle {
        ticks * cycles(16_404)
    }

    #[test]
    fn results_are_left_aligned_and_power_is_their_product() {
        let mut device = example();
        assert_eq!(read(&mut device, DELTA_SENSE, 2), 800 << 4);
        assert_eq!(read(&mut device, VIN, 2), 2000 << 4);
        assert_eq!(read(&mut device, POWER, 3), 1_600_000, "2 kW in 1.2506 mW");
        device.set_adin(1.024);
        assert_eq!(read(&mut device, ADIN, 2), 2048 << 4);
        device.set(200.0, 1000.0);
        assert_eq!(read(&mut device, DELTA_SENSE, 2), 4095 << 4);
        assert_eq!(read(&mut device, VIN, 2), 4095 << 4);
        device.set(50.0, -1.0);
        assert_eq!(read(&mut device, DELTA_SENSE, 2), 0);
    }

    #[test]
    fn ctrla_says_which_voltage_it_is() {
        let mut device = example();
        device.set_adin(0.512);
        assert_eq!(read(&mut device, CTRLA, 1), 0x18);
        for (ctrla, voltage) in [(0x00, 800), (0x08, 2000), (0x10, 1024), (0x18, 2000)] {
            write(&mut device, CTRLA, ctrla, 0);
            assert_eq!(read(&mut device, VIN, 2), voltage << 4, "{ctrla:#x}");
            assert_eq!(read(&mut device, POWER, 3), 800 * voltage, "{ctrla:#x}");
        }
    }

    #[test]
    fn the_accumulators_add_up_a_result_at_every_tick() {
        let mut device = example();
        let now = after_ticks(1000);
        assert_eq!(read_at(&mut device, TIME_COUNTER, 4, now - 1), 999);
        assert_eq!(read_at(&mut device, TIME_COUNTER, 4, now), 1000);
        assert_eq!(read_at(&mut device, CHARGE, 4, now), 800 * 1000 / 16);
        assert_eq!(read_at(&mut device, ENERGY, 4, now), 1_600_000 * 1000 / 65_536);
        // Steps of 13.1264 mC and 1.344471 J.
        let hour = after_ticks(1000) + 3600 * SECOND;
        let coulombs = read_at(&mut device, CHARGE, 4, hour) as f64 * 13.1264e-3;
        assert!((coulombs - 40.0 * 3616.404).abs() < 50.0, "{coulombs}");
        let joules = read_at(&mut device, ENERGY, 4, hour) as f64 * 1.344471;
        assert!((joules - 2000.0 * 3616.404).abs() < 5000.0, "{joules}");
    }

    #[test]
    fn twelve_bytes_of_accumulators_are_read_in_one_go() {
        let mut device = example();
        let read = u128::from(read_at(&mut device, TIME_COUNTER, 8, after_ticks(1000)));
        assert_eq!(read, 1000 << 32 | 50_000);
        assert_eq!(
            [device.read(), device.read(), device.read(), device.read()],
            24_414u32.to_be_bytes()
        );
    }

    #[test]
    fn ctrlb_stops_and_resets_them() {
        let mut device = example();
        write(&mut device, CTRLB, 0b01 << 2, after_ticks(1000));
        assert_eq!(read_at(&mut device, CHARGE, 4, after_ticks(2000)), 50_000);
        write(&mut device, CTRLB, RESET_ACCUMULATORS, after_ticks(2000));
        assert_eq!(
            read_at(&mut device, CHARGE, 4, after_ticks(3000)),
            0,
            "held at zero"
        );
        write(&mut device, CTRLB, 0, after_ticks(3000));
        assert_eq!(read_at(&mut device, TIME_COUNTER, 4, after_ticks(3016)), 16);
        assert_eq!(read_at(&mut device, CHARGE, 4, after_ticks(3016)), 800);
        write(&mut device, CTRLA, 0, after_ticks(3016));
        write(&mut device, CTRLB, RESET_ALL, after_ticks(3016));
        assert_eq!(read_at(&mut device, CTRLA, 2, after_ticks(3016)), 0x1800);
        assert_eq!(read_at(&mut device, CHARGE, 4, after_ticks(3016)), 0);
    }

    #[test]
    fn a_full_accumulator_starts_again_and_says_so_until_it_is_cleared() {
        let mut device = Ltc2946::new(0.0005);
        device.set(102.4, 204.8);
        // 2^36 / 4095 ticks are 3.2 days.
        let full = (1 << 36) / 4095;
        assert_eq!(read_at(&mut device, FAULT2, 1, after_ticks(full)), 0x80);
        assert_eq!(read_at(&mut device, CHARGE, 4, after_ticks(full)) >> 16, 0xffff);
        let now = after_ticks(full + 17);
        assert!(read_at(&mut device, CHARGE, 4, now) < 5000);
        assert_ne!(read_at(&mut device, STATUS2, 1, now) as u8 & CHARGE_OVERFLOW, 0);
        write(&mut device, FAULT2, 0, now);
        assert_eq!(read_at(&mut device, FAULT2, 1, now), 0x80);
    }

    #[test]
    fn a_fast_oscillator_counts_too_much() {
        let mut device = example();
        device.set_clock_error(0.05);
        assert_eq!(read_at(&mut device, TIME_COUNTER, 4, after_ticks(1000)), 1050);
    }

    #[test]
    fn it_says_what_it_is_and_a_power_cycle_forgets_what_it_has_counted() {
        let mut device = example();
        write(&mut device, CTRLA, 0x10, after_ticks(1000));
        assert_eq!(read_at(&mut device, MFR_SPECIAL_ID, 1, after_ticks(1000)), 0x60);
        device.power_cycle();
        assert_eq!(read_at(&mut device, CHARGE, 4, after_ticks(2000)), 0);
        assert_eq!(read_at(&mut device, CTRLA, 1, after_ticks(2000)), 0x18);
        assert_eq!(
            read_at(&mut device, CHARGE, 4, after_ticks(2016)),
            800,
            "from then on"
        );
        assert_eq!(read_at(&mut device, DELTA_SENSE, 2, after_ticks(2016)), 800 << 4);
    }
}
