//! Texas Instruments' BQ76952: monitor and protector of a stack of 3 to 16 cells.
//!
//! It is only read. What it protects, which transistors it drives and how it is calibrated stays as the maker of the pack has
//! set it up; so does the resistor that it measures the current with.
//!
//! Commands are as in SLUUBY2B, SLUAA11B and SLAAEB3, all of Texas Instruments. Their forum alone has how several commands are
//! read at once (962018) and how the two halves of the charge go together (970294); published drivers alone have the meaning of
//! the bits of the unit of current.

use core::ops::RangeInclusive;

use super::{CELL_SUM_TOLERANCE, COUNTING_READINGS, deviation, positive_voltage};
use crate::battery::{
    BusError, CellVoltages, Consumed, Counted, CurrentRange, Faults, Measurement, Modes, ReadError, Reported,
    Thermometer,
};
use crate::log::info;
use crate::sensor::bus::part::{FAST_MODE_HZ, Part};
use crate::sensor::bus::registers::Registers;
use crate::sensor::bus::{Address, SensorBus, Wiring};

// Direct commands: words, the lowest byte first.
/// Safety A, B and C: an alert in the low byte, a status in the high one. Behind six other words follow the voltages of 16 cells,
/// of the stack and of two pins, and the current.
const SAFETY: u8 = 0x02;
const BATTERY_STATUS: u8 = 0x12;
const ALARM_RAW_STATUS: u8 = 0x64;
/// Temperatures of the chip, and of six pins, from the fourth on TS1 to TS3, in tenths of a kelvin.
const TEMPERATURES: u8 = 0x68;

// Subcommands are written to one place and answered at others.
const SUBCOMMAND: u8 = 0x3e;
const ANSWER: u8 = 0x40;
/// The checksum of the answer, then its length.
const CHECKSUM: u8 = 0x60;

const DEVICE_NUMBER: u16 = 0x0001;
const MANUFACTURING_STATUS: u16 = 0x0057;
/// The charge that was counted, and the time since then.
const DA_STATUS_6: u16 = 0x0076;
/// In the data memory: the uses of TS1 to TS3, those of three other pins, the units of voltage and current, then the inputs that
/// have a cell.
const CONFIGURATION: u16 = 0x92fd;

/// Use of a pin: for a thermistor, of cells that are protected by it, or that is just measured. Another one is that of the
/// transistors.
const PIN_USE: u8 = 0x0f;
const THERMISTORS_OF_CELLS: [u8; 2] = [0x07, 0x0b];

/// A thermistor that is not connected, or is shorted, is outside of this.
const THERMISTOR_C: RangeInclusive<f32> = -40.0..=125.0;

const BQ76952: u16 = 0x7695;

/// Manufacturing status: it drives the transistors by what its protection finds.
const FET_ENABLED: u8 = 1 << 4;

// Alarm status: a status of its protection, or a permanent failure; no discharge, balancing.
const PROTECTION: u16 = 0b111 << 13;
const DISCHARGE_OFF: u16 = 1 << 5;
const BALANCING: u16 = 1 << 2;

/// The faults of its safety status: A, B and C from the lowest byte on.
const SAFETY_FAULTS: [(u32, Faults); 6] = [
    (1 << 2, Faults::DEEP_DISCHARGE),
    (1 << 3 | 1 << 20, Faults::SPIKES),
    (0b111 << 4 | 0b101 << 21, Faults::OVER_CURRENT),
    (1 << 7 | 1 << 22, Faults::SHORT_CIRCUIT),
    (0b111 << 8, Faults::UNDER_TEMPERATURE),
    (0b1111 << 12, Faults::OVER_TEMPERATURE),
];

// Places among the words from `SAFETY` on.
const CELLS: usize = 16;
const FIRST_CELL: usize = 9;
const STACK: usize = FIRST_CELL + CELLS;
const CURRENT: usize = STACK + 3;
const WORDS: usize = CURRENT + 1;

const LONGEST_ANSWER: usize = 32;

/// The length counts the subcommand, the checksum and itself, too.
const LENGTH_OF_REST: usize = 4;

/// An answer is there after about half a millisecond, at the latest after 2 ms (SLUAA11B); a look for it takes 0.12 ms.
const LOOKS_FOR_ANSWER: usize = 50;

/// Battery status: the data memory can't be read.
const SEALED: u16 = 0b11 << 8;

const CENTIVOLTS: u8 = 1 << 2;
const UNITS_OF_CURRENT_A: [f32; 4] = [1e-4, 1e-3, 1e-2, 1e-1];

/// The units it has unless it is set up otherwise: 10 mV and 1 mA.
const DEFAULT_UNITS: u8 = 0x05;

/// An input without a cell is connected to its neighbour and reads about zero; a cell that is connected is above, in millivolts.
const LOWEST_CELL_MV: u16 = 500;

const ZERO_CELSIUS_K: f32 = 273.15;

const ADDRESSES: [Address; 1] = [Address::I2c(0x08)];

/// A BQ76952 that answered.
#[derive(Debug)]
pub(in crate::sensor::bus) struct Bq76952 {
    address: Address,
    setup: Setup,
    /// Its inputs that have a cell, the first in bit 0; 0 if they are not known.
    cells: u16,
    /// Readings in which they were counted.
    counting: u8,
    last: Option<Charge>,
}

/// Its set-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Setup {
    units: u8,
    /// Inputs that have a cell, the first in bit 0; 0 if that is not set up.
    cells: u16,
    /// Pins that have a thermistor of cells, TS1 in bit 0.
    thermistors: u8,
    /// `PROTECTED`, or nothing.
    protection: Modes,
}

/// Its count.
#[derive(Clone, Copy, Debug)]
struct Charge {
    /// Charge that flowed into the pack, in 2^-32 of the unit of current times an hour.
    count: u64,
    /// For how long it has counted, in seconds.
    duration_s: u32,
}

impl Part for Bq76952 {
    type Model = ();

    const INTERVAL_US: u64 = 100_000;
    const HIGHEST_CLOCK_HZ: u32 = FAST_MODE_HZ;

    fn addresses((): &()) -> &'static [Address] {
        &ADDRESSES
    }

    async fn set_up(
        bus: &mut impl SensorBus,
        address: Address,
        _: &Wiring,
        (): &(),
    ) -> Result<Self, ReadError> {
        if u16::from_le_bytes(ask(bus, address, DEVICE_NUMBER).await?) != BQ76952 {
            return Err(ReadError::OtherPart);
        }
        let setup = Setup::read(bus, address).await?;
        info!(
            "BQ76952 {:?}, units {:x}, cells {:x}",
            address, setup.units, setup.cells
        );
        Ok(Self {
            address,
            setup,
            cells: setup.cells,
            counting: 0,
            last: None,
        })
    }

    async fn read(&mut self, bus: &mut impl SensorBus, _: &Wiring) -> Result<Measurement, ReadError> {
        let words: [u16; WORDS] = words_from(bus, self.address, SAFETY).await?;
        let [alarms] = words_from(bus, self.address, ALARM_RAW_STATUS).await?;
        let temperatures = words_from(bus, self.address, TEMPERATURES).await?;
        let charge = Charge::read(bus, self.address).await?;
        if Setup::read(bus, self.address).await? != self.setup {
            return Err(ReadError::OtherPart);
        }
        let value = |place: usize| {
            let word = words.get(place).map_or(0, |word: &u16| *word as i16);
            (f32::from(word), CurrentRange::of_word(word))
        };
        let (voltage, range) = value(STACK);
        let voltage_v = positive_voltage(voltage * self.setup.unit_v(), range)?;
        if voltage_v == 0.0 {
            // The stack supplies it: nothing has been measured yet.
            return Err(ReadError::Implausible);
        }
        let (current, current_range) = value(CURRENT);
        let last = self.last.replace(charge);
        let (temperature_c, thermometer) = self.setup.temperature(temperatures);
        Ok(Measurement {
            voltage_v: Some(voltage_v),
            // It counts what flows into the pack.
            current_a: Some(-current * self.setup.unit_a()),
            // The charge is counted in more bits.
            current_range: current_range.counted(),
            counted: last.and_then(|last| {
                let charge_mah = charge.since(&last)? * self.setup.unit_a() * 1e3;
                Some(Counted::Increment(Consumed {
                    charge_mah,
                    energy_wh: charge_mah * 1e-3 * voltage_v,
                }))
            }),
            temperature_c: Some(temperature_c),
            thermometer,
            cells: self.cell_voltages(&words, voltage_v),
            reported: self.reported(&words, alarms),
            ..Measurement::default()
        })
    }
}

impl Bq76952 {
    fn reported(&self, [a, b, c, ..]: &[u16; WORDS], alarms: u16) -> Reported {
        let [a, b, c] = [a, b, c].map(|word| (word >> 8) as u8);
        let mut reported = Reported {
            faults: Faults::of_flags(u32::from_le_bytes([a, b, c, 0]), &SAFETY_FAULTS),
            modes: self.setup.protection,
            ..Reported::NONE
        };
        reported.modes.set(Modes::BALANCING, alarms & BALANCING != 0);
        let is_off = alarms & DISCHARGE_OFF != 0 && alarms & PROTECTION != 0;
        reported.faults.set(Faults::SWITCHED_OFF, is_off);
        reported
    }

    /// Which cells there are is set up, or shows a reading in which they add up to the stack. A cell that fails later is still one.
    fn cell_voltages(&mut self, words: &[u16], stack_v: f32) -> CellVoltages {
        let inputs = || {
            let words = words.iter().skip(FIRST_CELL).take(CELLS);
            words.map(|word| cell_mv(*word)).enumerate()
        };
        if self.cells == 0 && self.counting < COUNTING_READINGS {
            self.counting += 1;
            let connected = inputs().filter(|(_, mv)| *mv >= LOWEST_CELL_MV);
            let add =
                |(cells, sum_mv), (input, mv): (usize, u16)| (cells | 1u16 << input, sum_mv + u32::from(mv));
            let (cells, sum_mv) = connected.fold((0, 0), add);
            if deviation(stack_v, sum_mv as f32 * 1e-3) <= CELL_SUM_TOLERANCE {
                self.cells = cells;
            }
        }
        let mut voltages = CellVoltages::NONE;
        for (_, mv) in inputs().filter(|(input, _)| self.cells >> input & 1 != 0) {
            voltages.push(mv);
        }
        voltages
    }
}

impl Setup {
    async fn read(bus: &mut impl SensorBus, address: Address) -> Result<Self, ReadError> {
        let [status] = words_from(bus, address, BATTERY_STATUS).await?;
        let [manufacturing, _] = ask(bus, address, MANUFACTURING_STATUS).await?;
        let protection = match manufacturing & FET_ENABLED {
            0 => Modes::empty(),
            _ => Modes::PROTECTED,
        };
        if status & SEALED == SEALED {
            return Ok(Self {
                units: DEFAULT_UNITS,
                cells: 0,
                thermistors: 0,
                protection,
            });
        }
        let [ts1, ts2, ts3, _, _, _, units, low, high] = ask(bus, address, CONFIGURATION).await?;
        let pins = [ts1, ts2, ts3].into_iter().enumerate();
        let of_cells = pins.filter(|(_, pin)| THERMISTORS_OF_CELLS.contains(&(pin & PIN_USE)));
        Ok(Self {
            units,
            cells: u16::from_le_bytes([low, high]),
            thermistors: of_cells.fold(0, |thermistors, (pin, _)| thermistors | 1 << pin),
            protection,
        })
    }

    /// Of the hottest place at a thermistor of the pack; without one, of the chip.
    fn temperature(self, [chip, _, _, _, pins @ ..]: [u16; 7]) -> (f32, Thermometer) {
        let celsius = |tenths_k: u16| f32::from(tenths_k as i16) * 0.1 - ZERO_CELSIUS_K;
        let pins = pins.map(celsius).into_iter().enumerate();
        let of_cells = pins.filter(|(pin, _)| self.thermistors >> pin & 1 != 0);
        let measured = of_cells.map(|(_, c)| c).filter(|c| THERMISTOR_C.contains(c));
        match measured.reduce(f32::max) {
            Some(temperature_c) => (temperature_c, Thermometer::Pack),
            None => (celsius(chip), Thermometer::Device),
        }
    }

    fn unit_v(self) -> f32 {
        if self.units & CENTIVOLTS != 0 { 1e-2 } else { 1e-3 }
    }

    fn unit_a(self) -> f32 {
        let [unit_0, unit_1, unit_2, unit_3] = UNITS_OF_CURRENT_A;
        match self.units & 0b11 {
            0 => unit_0,
            1 => unit_1,
            2 => unit_2,
            _ => unit_3,
        }
    }
}

impl Charge {
    async fn read(bus: &mut impl SensorBus, address: Address) -> Result<Self, ReadError> {
        let [i0, i1, i2, i3, f0, f1, f2, f3, s0, s1, s2, s3] = ask(bus, address, DA_STATUS_6).await?;
        Ok(Self {
            count: u64::from_le_bytes([f0, f1, f2, f3, i0, i1, i2, i3]),
            duration_s: u32::from_le_bytes([s0, s1, s2, s3]),
        })
    }

    /// Charge drawn from the pack since `earlier`, in the unit of current times an hour. `None` if the count was restarted, as it
    /// may have been within its first second.
    fn since(&self, earlier: &Self) -> Option<f32> {
        const STEPS: f32 = (1u64 << 32) as f32;
        let into = self.count.wrapping_sub(earlier.count) as i64;
        let goes_on = (1..=self.duration_s).contains(&earlier.duration_s);
        goes_on.then(|| -(into as f32) / STEPS)
    }
}

/// The voltage of an input in millivolts; a cell that has reversed has none.
fn cell_mv(word: u16) -> u16 {
    (word as i16).max(0) as u16
}

/// The words at this command and at those after it.
async fn words_from<const N: usize>(
    bus: &mut impl SensorBus,
    address: Address,
    command: u8,
) -> Result<[u16; N], ReadError> {
    let mut bytes = [[0; 2]; N];
    bus.write_read(address, &[command], bytes.as_flattened_mut())
        .await?;
    Ok(bytes.map(u16::from_le_bytes))
}

/// The first `N` bytes of the answer to a subcommand, or of the data memory from this address on.
async fn ask<const N: usize>(
    bus: &mut impl SensorBus,
    address: Address,
    subcommand: u16,
) -> Result<[u8; N], ReadError> {
    let [low, high] = subcommand.to_le_bytes();
    bus.write(address, &[SUBCOMMAND, low, high]).await?;
    wait_for_answer(bus, address, subcommand).await?;
    let [checksum, length] = Registers::new(bus, address).read(CHECKSUM).await?;
    let length = usize::from(length).checked_sub(LENGTH_OF_REST);
    let mut buffer = [0; LONGEST_ANSWER];
    let answer = length
        .filter(|length| *length >= N)
        .and_then(|length| buffer.get_mut(..length))
        .ok_or(ReadError::OtherPart)?;
    bus.write_read(address, &[ANSWER], answer).await?;
    let sum = answer
        .iter()
        .fold(low.wrapping_add(high), |sum, byte| sum.wrapping_add(*byte));
    if !sum != checksum {
        return Err(BusError::Checksum.into());
    }
    answer.first_chunk().copied().ok_or(ReadError::OtherPart)
}

/// It repeats the subcommand as soon as its answer is there.
async fn wait_for_answer(
    bus: &mut impl SensorBus,
    address: Address,
    subcommand: u16,
) -> Result<(), ReadError> {
    for _ in 0..LOOKS_FOR_ANSWER {
        let [repeated] = words_from(bus, address, SUBCOMMAND).await?;
        if repeated == subcommand {
            return Ok(());
        }
    }
    Err(ReadError::OtherPart)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn charge(integer: i32, fraction: u32, duration_s: u32) -> Charge {
        Charge {
            count: (integer as u32 as u64) << 32 | u64::from(fraction),
            duration_s,
        }
    }

    #[test]
    fn what_flows_into_the_pack_counts_down_across_zero() {
        // From 0.5 to -0.5.
        let (before, now) = (charge(0, 1 << 31, 10), charge(-1, 1 << 31, 11));
        assert_eq!(now.since(&before), Some(1.0));
        assert_eq!(before.since(&charge(-1, 1 << 31, 9)), Some(-1.0));
    }

    #[test]
    // Requirement: S-10
    fn a_count_that_was_restarted_is_no_charge() {
        assert_eq!(charge(0, 1 << 31, 0).since(&charge(-500, 0, 1_000)), None);
        assert_eq!(charge(0, 1 << 31, 0).since(&charge(-5, 0, 0)), None);
    }
}
