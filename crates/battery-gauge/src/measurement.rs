//! Measurements of a pack, their times, their errors, and the scale under which they were made.

use core::fmt;
use core::ops::RangeInclusive;

use crate::time::Instant;
use crate::{PackDetails, Reported};

/// Plausibility limits of a reading, in volts and amperes.
const HIGHEST_VOLTAGE_V: f32 = 1_000.0;
const HIGHEST_CURRENT_A: f32 = 10_000.0;

/// Range of a temperature, in degrees Celsius: that of the usual sensors of packs, and the highest of motors, controllers and
/// generators.
const LOWEST_TEMPERATURE_C: f32 = -40.0;
const HIGHEST_OF_PACKS_C: f32 = 125.0;
const HIGHEST_OF_DEVICES_C: f32 = 200.0;

/// Plausibility limits of charge, energy and capacity, in milliampere-hours and watt-hours.
const HIGHEST_CHARGE_MAH: f32 = 10_000_000.0;
const HIGHEST_ENERGY_WH: f32 = 1_000_000.0;
const LOWEST_CAPACITY_MAH: f32 = 1.0;

/// Contents of a pack. As in ArduPilot, a fuel tank is a pack, too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Contents {
    /// Electric charge.
    #[default]
    Charge,
    /// Liquid fuel: in a [`Measurement`], values in milliampere-hours are millilitres then, and those in amperes are litres
    /// per hour. It has neither voltage nor energy.
    Fuel,
}

/// Whether a current is within its sensor's range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CurrentRange {
    /// It was measured.
    #[default]
    Within,
    /// It is at least what the sensor shows, whose own counter measures it all the same.
    OverAndCounted,
    /// It is at least what the sensor shows, and so is the charge that is counted from it.
    Over,
}

impl CurrentRange {
    /// Of a current that has one of the end codes of its sensor's range, or lies beyond them.
    pub fn of_code(code: i32, ends: RangeInclusive<i32>) -> Self {
        if *ends.start() < code && code < *ends.end() {
            Self::Within
        } else {
            Self::Over
        }
    }

    /// Of a current in a word with a sign.
    pub fn of_word(word: i16) -> Self {
        Self::of_code(word.into(), i16::MIN.into()..=i16::MAX.into())
    }

    /// Of a current in a word without a sign.
    pub fn of_unsigned_word(word: u16) -> Self {
        Self::of_code(word.into(), -1..=u16::MAX.into())
    }

    /// Of a sensor whose own counter measures what is over range, too.
    #[must_use]
    pub fn counted(self) -> Self {
        self.min(Self::OverAndCounted)
    }
}

/// One reading of a pack. `None` is not measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measurement {
    /// Electric charge or fuel.
    pub contents: Contents,
    /// Voltage between the pack's terminals, in volts.
    pub voltage_v: Option<f32>,
    /// Current drawn from the pack, in amperes; negative while charging.
    pub current_a: Option<f32>,
    /// Power drawn from the pack, in watts, where voltage and current are measured together: the mean of a product is another
    /// than the product of the means while both change. `None`: it is that product.
    pub power_w: Option<f32>,
    /// Fuel drawn from a tank, in litres per hour.
    pub fuel_l_h: Option<f32>,
    /// Whether the current is within its sensor's range.
    pub current_range: CurrentRange,
    /// Charge and energy, if the sensor counts them.
    pub counted: Option<Counted>,
    /// Report of the pack's own fuel gauge.
    pub gauge: GaugeReading,
    /// State of charge, 0 to 1, if the sensor reports it without a capacity.
    pub state_of_charge: Option<f32>,
    /// Temperature, in degrees Celsius.
    pub temperature_c: Option<f32>,
    /// Place of this temperature.
    pub thermometer: Thermometer,
    /// Voltage of each cell.
    pub cells: CellVoltages,
    /// Identity and ratings, of a smart battery.
    pub details: PackDetails,
    /// Condition as reported by the pack.
    pub reported: Reported,
    /// Time until the pack is empty, in seconds, if the pack or its sensor reports it.
    pub time_remaining_s: Option<f32>,
    /// Whether the pack is about to power off.
    pub supply: Supply,
    /// The members of a sum, a bit each, which the caller chooses; 0 for a sensor.
    pub members: u16,
    /// The lost ones of them: unhealthy, or unplugged under load.
    pub lost_members: u16,
    /// Full capacity of the members of a sum together, in milliampere-hours; `None` unless every member's is known.
    pub members_capacity_mah: Option<f32>,
    /// By how much the highest resting voltage of a sum's members exceeds the lowest, relative to it.
    pub members_spread: Option<f32>,
    /// Cells that a sum's members may have although their voltage is that of fewer.
    pub doubtful_cells: Option<u8>,
    /// Exchanges of the packs that are chosen for a sum, and charges elsewhere (wraps).
    pub exchanges: u8,
}

/// Extremes of single conversions, where the board's converter measures: they show a spike that a mean hides.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Extremes {
    /// Lowest voltage between the pack's terminals, in volts.
    pub lowest_voltage_v: Option<f32>,
    /// Highest current drawn from the pack, in amperes.
    pub highest_current_a: Option<f32>,
}

impl Extremes {
    /// Includes those of another time.
    pub fn include(&mut self, other: Self) {
        let voltages = self.lowest_voltage_v.into_iter().chain(other.lowest_voltage_v);
        self.lowest_voltage_v = voltages.reduce(f32::min);
        let currents = self.highest_current_a.into_iter().chain(other.highest_current_a);
        self.highest_current_a = currents.reduce(f32::max);
    }
}

/// A larger current, in amperes, shows that the current sensor has power while the voltage is missing: without, it may read
/// its offset. One that has power reads at least the negative of it.
const DRAWN_A: f32 = 0.5;

impl Measurement {
    /// Whether a current sensor has power by this reading, whose voltage is missing; `before`: by those before it.
    pub(super) fn shows_powered_sensor(&self, before: bool) -> bool {
        match self.current_a {
            Some(current_a) if current_a > DRAWN_A => true,
            Some(current_a) => before && current_a >= -DRAWN_A,
            None => before,
        }
    }

    /// The reading of a pack that supplies the load although its voltage is missing, if it is one: its current sensor is
    /// known to have power, or the source counts.
    pub(super) fn without_voltage(&self, sensor_has_power: bool) -> Option<Self> {
        let current_a = self
            .current_a
            .filter(|_| self.shows_powered_sensor(sensor_has_power));
        (current_a.is_some() || self.counted.is_some()).then_some(Self {
            voltage_v: None,
            current_a,
            power_w: None,
            ..*self
        })
    }

    /// Amperes drawn from a pack, or litres per hour from a tank, which is counted as one.
    pub(super) fn rate(&self) -> Option<f32> {
        self.current_a.or(self.fuel_l_h)
    }

    /// The temperature, in degrees Celsius, if it is possible.
    pub fn possible_temperature_c(&self) -> Option<f32> {
        self.thermometer.possible_c(self.temperature_c)
    }

    /// The reading, if each value is finite and possible. An impossible temperature alone is unknown.
    ///
    /// # Errors
    /// [`ReadError::Implausible`].
    pub(super) fn check_plausible(&self) -> Result<&Self, ReadError> {
        // NaN is within no limit.
        let is_within = |value: Option<f32>, limit: f32| value.is_none_or(|value| value.abs() <= limit);
        let is_gauge = |gauge: &Gauge| {
            (0.0..=HIGHEST_CHARGE_MAH).contains(&gauge.remaining_mah)
                && gauge.full_mah >= LOWEST_CAPACITY_MAH
                && gauge.full_mah <= HIGHEST_CHARGE_MAH
        };
        let is_count = |counted: Counted| {
            let (charge_mah, energy_wh, drawn_mah) = match counted {
                Counted::Total(consumed) | Counted::Increment(consumed) => {
                    (consumed.charge_mah, Some(consumed.energy_wh), None)
                }
                Counted::TotalCharge(number) | Counted::Volume(number) => (number, None, None),
                Counted::Members { consumed, drawn_mah } => {
                    (consumed.charge_mah, Some(consumed.energy_wh), drawn_mah)
                }
            };
            is_within(Some(charge_mah), HIGHEST_CHARGE_MAH)
                && is_within(energy_wh, HIGHEST_ENERGY_WH)
                && is_within(drawn_mah, HIGHEST_CHARGE_MAH)
        };
        if is_within(self.voltage_v, HIGHEST_VOLTAGE_V)
            && is_within(self.rate(), HIGHEST_CURRENT_A)
            && is_within(self.power_w, HIGHEST_VOLTAGE_V * HIGHEST_CURRENT_A)
            && self.gauge.read().is_none_or(is_gauge)
            && self.state_of_charge.is_none_or(|soc| (0.0..=1.0).contains(&soc))
            && self.counted.is_none_or(is_count)
        {
            Ok(self)
        } else {
            Err(ReadError::Implausible)
        }
    }
}

/// Place of a temperature.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Thermometer {
    /// The pack.
    #[default]
    Pack,
    /// A device that it supplies, or is charged by: a motor or its controller, or a charger. 70 °C are usual there.
    Device,
}

impl Thermometer {
    /// A temperature that was measured there, in degrees Celsius; `None` if it is unknown or impossible, as that of a broken
    /// sensor is.
    // Inlined, it would be repeated for each source.
    #[inline(never)]
    pub fn possible_c(self, temperature_c: Option<f32>) -> Option<f32> {
        let highest_c = match self {
            Self::Pack => HIGHEST_OF_PACKS_C,
            Self::Device => HIGHEST_OF_DEVICES_C,
        };
        temperature_c.filter(|temperature_c| (LOWEST_TEMPERATURE_C..=highest_c).contains(temperature_c))
    }
}

/// Whether a pack is about to power off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Supply {
    /// Not as far as known.
    #[default]
    On,
    /// Its power button is held.
    PoweringOff,
}

/// Charge and energy counted by a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Counted {
    /// Drawn since the previous reading, by a counter that also runs between readings.
    Increment(Consumed),
    /// Total drawn.
    Total(Consumed),
    /// Total charge drawn, in milliampere-hours; the sensor does not count energy.
    TotalCharge(f32),
    /// Fuel used since the previous reading, in millilitres.
    Volume(f32),
    /// Of a sum.
    Members {
        /// Consumption of its members together.
        consumed: Consumed,
        /// Charge drawn from them since the start, in milliampere-hours, which a battery reset or another pack does not
        /// change; `None` unless every member counts it and none is lost.
        drawn_mah: Option<f32>,
    },
}

/// Charge and energy drawn from a pack; negative after net charging.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Consumed {
    /// Charge, in milliampere-hours.
    pub charge_mah: f32,
    /// Energy, in watt-hours.
    pub energy_wh: f32,
}

/// A charge of a milliampere-hour, in coulombs.
pub(super) const COULOMBS_PER_MAH: f32 = 3.6;
const JOULES_PER_WH: f32 = 3600.0;

impl Consumed {
    /// A charge, in milliampere-hours, without its energy.
    pub fn charge(charge_mah: f32) -> Self {
        Self {
            charge_mah,
            energy_wh: 0.0,
        }
    }

    /// From SI units, which sensors count in.
    pub fn from_si(charge_c: f32, energy_j: f32) -> Self {
        Self {
            charge_mah: charge_c / COULOMBS_PER_MAH,
            energy_wh: energy_j / JOULES_PER_WH,
        }
    }
}

/// State of the pack's own fuel gauge in one reading.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum GaugeReading {
    /// The source has none, or it is not to be used: the charge is estimated here.
    #[default]
    Absent,
    /// The reading came without it.
    Missing,
    /// Its report.
    Read(Gauge),
}

impl GaugeReading {
    /// Of a source that should have one.
    pub fn expected(gauge: Option<Gauge>) -> Self {
        gauge.map_or(Self::Missing, Self::Read)
    }

    /// Its report, if there is one.
    pub fn read(&self) -> Option<&Gauge> {
        match self {
            Self::Absent | Self::Missing => None,
            Self::Read(gauge) => Some(gauge),
        }
    }
}

/// Count of a smart battery's own fuel gauge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gauge {
    /// Remaining charge, in milliampere-hours.
    pub remaining_mah: f32,
    /// Present full capacity, in milliampere-hours.
    pub full_mah: f32,
}

impl Gauge {
    /// The count of a tank that holds `remaining_ml` of `full_ml`, in millilitres: a tank's are counted as a pack's
    /// milliampere-hours.
    pub fn of_tank(remaining_ml: f32, full_ml: f32) -> Self {
        Self {
            remaining_mah: remaining_ml,
            full_mah: full_ml,
        }
    }

    /// State of charge, from 0 to 1.
    pub fn state_of_charge(&self) -> f32 {
        (self.remaining_mah / self.full_mah).clamp(0.0, 1.0)
    }

    /// Charge drawn from the full pack, in milliampere-hours; 0 if it holds more than its full capacity.
    pub fn consumed_mah(&self) -> f32 {
        (self.full_mah - self.remaining_mah).max(0.0)
    }
}

/// Why a read of a sensor failed. It is one byte as long as only one variant holds another enum; a second one would take
/// 1.2 KB of flash, in the `async` drivers that pass it on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ReadError {
    /// There was no reading in time.
    Timeout,
    /// The ADC reported a failed conversion.
    Conversion,
    /// The pack's own fuel gauge has not reported in time what is left.
    GaugeTimeout,
    /// The current was measured before, and is not any more; nothing else counts the charge.
    CurrentLost,
    /// The value is not finite or beyond its plausible range.
    Implausible,
    /// The voltage is at or above the end of the converter's range, or another value that a pack needs is at the end of its own.
    OverRange,
    /// The part at the address is not the one that is set, or is not set up any more.
    OtherPart,
    /// No member of the sum is healthy.
    NoHealthyMember,
    /// A member of the sum has been lost for so long that the charge is unknown.
    LostMember,
    /// The wires to the sensor failed.
    Bus(BusError),
    /// Configuration: no pin is set, or no such channel.
    NoPin,
    /// Configuration: no capacity is set, which the fill level is computed from.
    NoCapacity,
    /// Configuration: what scales the reading is not set, such as the volume of a pulse.
    NoScale,
    /// Configuration: another pack's sensor uses the address.
    AddressTaken,
    /// Configuration: the pin is the clock of this board's Wi-Fi radio.
    PinOfRadio,
    /// Configuration: another sensor that is set up uses the pin.
    PinTaken,
    /// Configuration: what connects the sensor is not set up: the CAN bus, or the protocol of the serial port.
    NotSetUp,
}

/// Fault on the wires to a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BusError {
    /// Nothing answers, or a byte was not acknowledged.
    NoAnswer,
    /// The transfer did not end in time.
    Timeout,
    /// A line is held low.
    Stuck,
    /// The packet error code does not match.
    Checksum,
    /// The transfer failed in another way.
    Transfer,
}

const _: () = assert!(size_of::<ReadError>() == 1);

impl From<BusError> for ReadError {
    fn from(error: BusError) -> Self {
        Self::Bus(error)
    }
}

impl ReadError {
    /// Whether a setting is missing or wrong: until it is changed, the sensor can't be read.
    pub fn is_configuration(self) -> bool {
        matches!(
            self,
            Self::NoPin
                | Self::NoCapacity
                | Self::NoScale
                | Self::AddressTaken
                | Self::PinOfRadio
                | Self::PinTaken
                | Self::NotSetUp
        )
    }
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Timeout | Self::Bus(BusError::Timeout) => "no reading in time",
            Self::Conversion => "conversion failed",
            Self::GaugeTimeout => "its gauge reports no charge",
            Self::CurrentLost => "current lost",
            Self::Implausible => "impossible value",
            Self::OverRange => "over range",
            Self::OtherPart => "unknown part",
            Self::NoHealthyMember => "no healthy pack to sum",
            Self::LostMember => "one of its packs is lost",
            Self::Bus(BusError::NoAnswer) => "no answer",
            Self::Bus(BusError::Stuck) => "bus held low",
            Self::Bus(BusError::Checksum) => "wrong checksum",
            Self::Bus(BusError::Transfer) => "bus error",
            Self::NoPin => "no pin set",
            Self::NoCapacity => "no capacity set",
            Self::NoScale => "no scale set",
            Self::AddressTaken => "address already in use",
            Self::PinOfRadio => "GP29 is the Wi-Fi radio's",
            Self::PinTaken => "pin already in use",
            Self::NotSetUp => "port not set up",
        })
    }
}

/// An amount of what a pack stores, in the unit of its contents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Amount {
    /// Electric charge, in milliampere-hours.
    Mah(f32),
    /// Fuel, in millilitres.
    Ml(f32),
}

// The unit takes the place that the option takes of a bare number.
const _: () = assert!(size_of::<Option<Amount>>() == size_of::<Option<f32>>());

impl Amount {
    /// This many milliampere-hours of charge, or millilitres of fuel.
    pub fn of(contents: Contents, number: f32) -> Self {
        match contents {
            Contents::Charge => Self::Mah(number),
            Contents::Fuel => Self::Ml(number),
        }
    }

    /// A charge in milliampere-hours; `None` for fuel.
    pub fn mah(self) -> Option<f32> {
        match self {
            Self::Mah(mah) => Some(mah),
            Self::Ml(_) => None,
        }
    }

    /// A volume of fuel in millilitres; `None` for charge.
    pub fn ml(self) -> Option<f32> {
        match self {
            Self::Ml(ml) => Some(ml),
            Self::Mah(_) => None,
        }
    }

    /// The number without its unit, for what takes either: as in ArduPilot, `BATT_LOW_MAH` and BATTERY_STATUS do.
    pub fn number(self) -> f32 {
        match self {
            Self::Mah(number) | Self::Ml(number) => number,
        }
    }
}

/// Cells in series that are kept one by one, as many as a BQ76952 measures.
pub const MAX_CELLS: usize = 16;

/// The voltage of each cell in series, from the negative end; empty if not measured.
#[derive(Clone, Copy, Debug, PartialEq)]
// Copied at every reading: by words.
#[repr(align(4))]
pub struct CellVoltages {
    millivolts: [u16; MAX_CELLS],
    lowest_mv: u16,
    highest_mv: u16,
    count: u8,
}

impl CellVoltages {
    /// Not measured.
    pub const NONE: Self = Self {
        millivolts: [0; MAX_CELLS],
        lowest_mv: 0,
        highest_mv: 0,
        count: 0,
    };

    /// From millivolts.
    pub fn from_millivolts(cells: &[u16]) -> Self {
        let mut voltages = Self::NONE;
        for cell_mv in cells {
            voltages.push(*cell_mv);
        }
        voltages
    }

    /// Adds a cell. One beyond the 16th counts, and may be the lowest or highest.
    // Inlined, each driver would have a copy.
    #[inline(never)]
    pub fn push(&mut self, cell_mv: u16) {
        if let Some(place) = self.millivolts.get_mut(usize::from(self.count)) {
            *place = cell_mv;
        }
        if self.count == 0 || cell_mv < self.lowest_mv {
            self.lowest_mv = cell_mv;
        }
        self.highest_mv = self.highest_mv.max(cell_mv);
        self.count = self.count.saturating_add(1);
    }

    /// Number of measured cells.
    pub fn count(&self) -> usize {
        self.count.into()
    }

    /// Number of measured cells; `None` if none is measured.
    pub fn number(&self) -> Option<u8> {
        (self.count > 0).then_some(self.count)
    }

    /// The measured cells up to the 16th, in millivolts.
    pub fn millivolts(&self) -> &[u16] {
        self.millivolts.get(..self.count()).unwrap_or(&self.millivolts)
    }

    /// Highest minus lowest cell voltage, in volts.
    pub fn imbalance_v(&self) -> Option<f32> {
        let imbalance_mv = self.highest_mv.saturating_sub(self.lowest_mv);
        (self.count > 0).then(|| f32::from(imbalance_mv) / 1000.0)
    }

    /// The lowest cell voltage, in volts.
    pub fn lowest_v(&self) -> Option<f32> {
        (self.count > 0).then(|| f32::from(self.lowest_mv) / 1000.0)
    }
}

impl Default for CellVoltages {
    fn default() -> Self {
        Self::NONE
    }
}

/// Whether what the pack supplies may draw current: it decides about the meaning of a voltage and of a current.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LoadState {
    /// It is switched off, but for a small constant load. A current into the pack is a charge; the pack may be taken out and
    /// exchanged, and a voltage that is missing is no fault. Failsafe levels are kept, and none is reached.
    #[default]
    Off,
    /// It may draw current at any moment, and brake into the pack. The pack stays where it is: a voltage that is missing is a loose
    /// wire, and counts as a loss of the pack. Failsafe levels are reached.
    On,
}

/// When an update happens, and whether there may be a load then.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tick {
    /// When; may stall or jump.
    pub now: Instant,
    /// Whether there may be a load.
    pub load_state: LoadState,
}

/// The scale of a pack's voltage and current, with the pin of the voltage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measuring {
    /// The scale.
    pub scale: MeasuringScale,
    /// `BATT_VOLT_PIN`.
    pub voltage_pin: i32,
}

/// The scale of a pack's voltage and current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuringScale {
    /// Pack voltage divided by pin voltage (`BATT_VOLT_MULT`).
    pub volt_multiplier: f32,
    /// Pin voltage at zero pack voltage, in volts (`BATT_VLT_OFFSET`).
    pub volt_offset_v: f32,
    /// Amperes per volt at the pin (`BATT_AMP_PERVLT`).
    pub amperes_per_volt: f32,
}

impl MeasuringScale {
    /// `None` if no parameters have these values.
    pub fn if_plausible(self) -> Option<Self> {
        let is_plausible = self.volt_multiplier > 0.0
            && self.volt_multiplier.is_finite()
            && self.volt_offset_v.is_finite()
            && self.amperes_per_volt.is_finite();
        is_plausible.then_some(self)
    }

    /// By how much the voltage is higher than under the scale `before`, in volts, if it is `voltage_v` now.
    pub fn voltage_change_v(&self, before: &Self, voltage_v: f32) -> f32 {
        let pin_v = voltage_v / self.volt_multiplier + self.volt_offset_v;
        voltage_v - (pin_v - before.volt_offset_v) * before.volt_multiplier
    }
}
