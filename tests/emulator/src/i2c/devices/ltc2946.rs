//! LTC2946: 12-bit power monitor with charge and energy accumulators (2946fa: registers in table 2, CTRLA and CTRLB in 3 and 4).
//!
//! After a reset nothing is in its results before it has taken offset, voltage and current, and what was under way (the data sheet
//! has "XXh" there). Left out: power, the accumulator of time, extremes, thresholds and alerts, ADIN and GPIO pins, the external
//! clock, the order in which the converter takes its inputs later, snapshots, "auto-reset" of the accumulators. What is not
//! measured reads back what was written. A current in the other direction reads as zero.

use super::super::super::circuit::{Circuit, Meter};
use super::super::super::clock::{CLK_SYS_HZ, Cycle};
use super::super::device::{Ack, I2cDevice, I2cDirection};
use super::converter::{Converter, Setup};
use super::{Load, unsigned_code};

const CTRLA: u8 = 0x00;
const CTRLB: u8 = 0x01;
const DELTA_SENSE: u8 = 0x14;
const VIN: u8 = 0x1e;
const CHARGE: u8 = 0x38;
const ENERGY: u8 = 0x3c;
const ENERGY_END: u8 = 0x40;
const MFR_SPECIAL_ID: u8 = 0xe7;

const CTRLA_RESET: u8 = 0x18;
/// The first of two bytes.
const SPECIAL_ID: u8 = 0x60;

const FULL_SCALE: f64 = 4095.0;
const DELTA_SENSE_LSB_V: f64 = 0.1024 / FULL_SCALE;
const VIN_LSB_V: f64 = 102.4 / FULL_SCALE;
/// The ADC's ranges; the pins must not be above 100 V.
const MOST_VOLTS: f64 = 102.4;
const MOST_SENSE_V: f64 = 0.1024;
const RESULT_BITS: u32 = 12;
/// A result is in the upper bits of its two bytes.
const LEFT_ALIGNED: u32 = 4;

/// The accumulators take the last result 250 kHz / 4101 times a second.
const TICK: Cycle = CLK_SYS_HZ * 4101 / 250_000;
/// Of the first results after a reset, before the last one begins.
const FIRST_RESULTS: Cycle = 3 * TICK;
/// The number of bits of a sum that are below the 32 that can be read.
const CHARGE_FRACTION: u32 = 4;
const ENERGY_FRACTION: u32 = 16;

/// CTRLB.ACC: bits 3 and 2. CTRLB.RESET: bits 1 and 0.
const ACCUMULATE: u8 = 0b11 << 2;
const SHUT_DOWN: u8 = 1 << 6;
const RESET_MASK: u8 = 0b11;
const RESET_ACCUMULATORS: u8 = 0b10;
const RESET_ALL: u8 = 0b11;

#[derive(Clone, Copy)]
struct State {
    registers: [u8; 256],
    /// The results.
    sense: u32,
    voltage: u32,
    /// Sums that start again from 0 when the bits that can be read are full.
    charge: u64,
    energy: u64,
}

impl State {
    fn after_reset() -> Self {
        let mut registers = [0; 256];
        registers[usize::from(CTRLA)] = CTRLA_RESET;
        Self {
            registers,
            sense: 0,
            voltage: 0,
            charge: 0,
            energy: 0,
        }
    }
}

pub struct Ltc2946 {
    shunt_ohm: f64,
    converter: Converter,
    state: State,
    pointer: Option<u8>,
    /// `None`: it measures what a test sets.
    meter: Option<Meter>,
}

impl Ltc2946 {
    pub fn new(shunt_ohm: f64) -> Self {
        let mut device = Self {
            shunt_ohm,
            converter: Converter::default(),
            state: State::after_reset(),
            pointer: None,
            meter: None,
        };
        device.reset();
        device
    }

    /// Connected to the pack of the board's circuit.
    pub fn measuring_circuit(self) -> Self {
        Self {
            meter: Some(Meter::default()),
            ..self
        }
    }

    /// From the moment on at which it was addressed last. SENSE+ and VDD are connected to each other.
    pub fn set(&mut self, volts: f64, amperes: f64) {
        self.converter.set_load(Load::of(volts, amperes));
    }

    /// The current flows for this share of the time, in pulses that are much shorter than a conversion.
    pub fn set_pulses(&mut self, share: f64) {
        self.converter.set_pulses(share);
    }

    /// The supply of the device is gone, and back when it is addressed next. What it is connected to stays.
    pub fn power_cycle(&mut self) {
        self.reset();
        self.converter.power_cycle();
        self.pointer = None;
    }

    fn reset(&mut self) {
        self.state = State::after_reset();
        self.converter.restart(FIRST_RESULTS);
    }

    fn register(&self, address: u8) -> u8 {
        self.state.registers[usize::from(address)]
    }

    fn is_accumulating(&self) -> bool {
        let ctrlb = self.register(CTRLB);
        ctrlb & ACCUMULATE == 0 && ctrlb & RESET_MASK != RESET_ACCUMULATORS
    }

    fn setup(&self) -> Setup {
        let is_on = self.register(CTRLB) & SHUT_DOWN == 0;
        Setup {
            result: if is_on { TICK } else { 0 },
            measures_voltage: true,
            measures_current: true,
            is_continuous: true,
            most_volts: MOST_VOLTS,
            amperes: [0.0, MOST_SENSE_V / self.shunt_ohm],
        }
    }

    fn advance(&mut self, now: Cycle) {
        for results in self.converter.advance(now, &self.setup()) {
            let sense =
                unsigned_code(results.amperes * self.shunt_ohm, DELTA_SENSE_LSB_V, RESULT_BITS) as u32;
            self.state.sense = sense;
            // The voltage that CTRLA has selected: the current input, VDD, ADIN, to which nothing is connected, or SENSE+.
            self.state.voltage = match self.register(CTRLA) >> 3 & 3 {
                0 => sense,
                2 => 0,
                _ => unsigned_code(results.volts, VIN_LSB_V, RESULT_BITS) as u32,
            };
            if self.is_accumulating() {
                let charge = results.count * u64::from(sense);
                self.state.charge += charge;
                self.state.energy += charge * u64::from(self.state.voltage);
            }
        }
    }

    fn byte_at(&self, address: u8) -> u8 {
        let aligned = |code: u32| code << LEFT_ALIGNED;
        let (first, value, size) = match address {
            DELTA_SENSE..0x16 => (DELTA_SENSE, aligned(self.state.sense), 2),
            VIN..0x20 => (VIN, aligned(self.state.voltage), 2),
            CHARGE..ENERGY => (CHARGE, (self.state.charge >> CHARGE_FRACTION) as u32, 4),
            ENERGY..ENERGY_END => (ENERGY, (self.state.energy >> ENERGY_FRACTION) as u32, 4),
            MFR_SPECIAL_ID => return SPECIAL_ID,
            _ => return self.register(address),
        };
        (value >> (8 * (size - 1 - (address - first)))) as u8
    }

    fn store(&mut self, address: u8, byte: u8) {
        match address {
            CTRLB if byte & RESET_MASK == RESET_ALL => self.reset(),
            CTRLB if byte & RESET_MASK == RESET_ACCUMULATORS => {
                (self.state.charge, self.state.energy) = (0, 0);
                self.state.registers[usize::from(CTRLB)] = byte;
            }
            _ => self.state.registers[usize::from(address)] = byte,
        }
    }
}

impl I2cDevice for Ltc2946 {
    fn sense(&mut self, circuit: &Circuit) {
        let totals = circuit.totals();
        let means = self.meter.as_mut().and_then(|meter| meter.means(totals));
        if let Some(means) = means {
            self.set(means.volts, means.shown_amperes);
            self.advance(totals.at);
        }
    }

    fn start(&mut self, direction: I2cDirection, now: Cycle) -> Ack {
        self.advance(now);
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
    use super::super::register_map::driver::{now, read, read_at};
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

    /// The time at which this many ticks have been counted since the first results after a reset at `reset`.
    fn after(reset: Cycle, ticks: u64) -> Cycle {
        reset + (3 + ticks) * TICK
    }

    #[test]
    fn results_are_left_aligned_and_held_at_the_ends_of_their_range() {
        let mut device = example();
        assert_eq!(read(&mut device, MFR_SPECIAL_ID, 1), 0x60);
        for (volts, amperes, voltage, sense) in [
            (50.0, 40.0, 2000, 800),
            (200.0, 1000.0, 4095, 4095),
            (50.0, -1.0, 2000, 0),
        ] {
            device.set(volts, amperes);
            assert_eq!(read(&mut device, VIN, 2), voltage << 4, "{volts} V");
            assert_eq!(read(&mut device, DELTA_SENSE, 2), sense << 4, "{amperes} A");
        }
    }

    #[test]
    fn ctrla_says_which_voltage_it_is() {
        let mut device = example();
        assert_eq!(read(&mut device, CTRLA, 1), 0x18);
        for (ctrla, voltage) in [(0x00, 800), (0x08, 2000), (0x10, 0), (0x18, 2000)] {
            write(&mut device, CTRLA, ctrla, now());
            assert_eq!(read(&mut device, VIN, 2), voltage << 4, "{ctrla:#x}");
        }
    }

    #[test]
    fn nothing_is_in_its_results_before_four_conversions_after_a_reset() {
        let mut device = example();
        let results =
            |device: &mut Ltc2946, now| [VIN, DELTA_SENSE].map(|at| read_at(device, at, 2, now) >> 4);
        let resets: [fn(&mut Ltc2946, Cycle); 3] = [
            |_, _| (),
            |device, _| device.power_cycle(),
            |device, now| write(device, CTRLB, RESET_ALL, now),
        ];
        for (reset_device, seconds) in resets.into_iter().zip(0..) {
            let reset = seconds * SECOND;
            reset_device(&mut device, reset);
            read_at(&mut device, CTRLA, 1, reset);
            assert_eq!(results(&mut device, reset + 4 * TICK - 1), [0, 0]);
            assert_eq!(results(&mut device, reset + 4 * TICK), [2000, 800]);
        }
    }

    #[test]
    fn pulses_above_102_4_mv_are_cut_off() {
        let mut device = example();
        device.set(12.0, 400.0);
        device.set_pulses(0.25);
        // 204.8 of 400 A.
        assert_eq!(read(&mut device, DELTA_SENSE, 2), 1024 << 4);
    }

    #[test]
    fn the_accumulators_add_up_a_result_at_every_tick() {
        let mut device = example();
        let now = after(0, 1000);
        assert_eq!(read_at(&mut device, CHARGE, 4, now - 1), 800 * 999 / 16);
        assert_eq!(read_at(&mut device, CHARGE, 4, now), 800 * 1000 / 16);
        assert_eq!(read_at(&mut device, ENERGY, 4, now), 1_600_000 * 1000 / 65_536);
        // Steps of 13.1264 mC and 1.344471 J.
        let hour = now + 3600 * SECOND;
        let both = read_at(&mut device, CHARGE, 8, hour);
        let coulombs = (both >> 32) as f64 * 13.1264e-3;
        assert!((coulombs - 40.0 * 3616.404).abs() < 50.0, "{coulombs}");
        let joules = f64::from(both as u32) * 1.344471;
        assert!((joules - 2000.0 * 3616.404).abs() < 5000.0, "{joules}");
    }

    #[test]
    fn ctrlb_stops_and_resets_them() {
        let mut device = example();
        write(&mut device, CTRLB, 0b01 << 2, after(0, 1000));
        assert_eq!(read_at(&mut device, CHARGE, 4, after(0, 2000)), 50_000);
        write(&mut device, CTRLB, RESET_ACCUMULATORS, after(0, 2000));
        let held = read_at(&mut device, CHARGE, 4, after(0, 3000));
        assert_eq!(held, 0, "held at zero");
        write(&mut device, CTRLB, 0, after(0, 3000));
        assert_eq!(read_at(&mut device, CHARGE, 4, after(0, 3016)), 800);
        write(&mut device, CTRLA, 0, after(0, 3016));
        write(&mut device, CTRLB, RESET_ALL, after(0, 3016));
        assert_eq!(read_at(&mut device, CTRLA, 2, after(0, 3016)), 0x1800);
        assert_eq!(read_at(&mut device, CHARGE, 4, after(0, 3016)), 0);
    }

    #[test]
    fn a_full_accumulator_starts_again() {
        let mut device = Ltc2946::new(0.0005);
        device.set(102.4, 204.8);
        // 2^36 / 4095 ticks are 3.2 days.
        let full = (1 << 36) / 4095;
        assert_eq!(read_at(&mut device, CHARGE, 4, after(0, full)) >> 16, 0xffff);
        assert!(read_at(&mut device, CHARGE, 4, after(0, full + 17)) < 5000);
    }

    #[test]
    fn a_power_cycle_sets_everything_to_its_reset_value_and_measuring_goes_on() {
        let mut device = example();
        write(&mut device, CTRLA, 0x10, after(0, 1000));
        device.power_cycle();
        let reset = after(0, 2000);
        assert_eq!(read_at(&mut device, CHARGE, 4, reset), 0);
        assert_eq!(read_at(&mut device, CTRLA, 1, reset), 0x18);
        let since = read_at(&mut device, CHARGE, 4, after(reset, 16));
        assert_eq!(since, 800, "from then on");
        assert_eq!(read_at(&mut device, DELTA_SENSE, 2, after(reset, 16)), 800 << 4);
    }
}
