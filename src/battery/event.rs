//! Events of a pack, and their texts.

use core::fmt;

use heapless::Vec;

use super::consumption::Gap;
use super::{
    Amount, BatteryState, ChargeState, CurrentRange, FailsafeLevel, Faults, LessonObstacle, ReadError,
};
use crate::announce::{ANNOUNCEMENT_BYTES, Announce, Limit, Severity};
use crate::numbers::{Hundredths, round_to_i32};
use crate::pack::{Pack, write_packs};
use crate::parameter::BatteryParameter;

/// An event of a pack. Its text follows "Battery 1 ".
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PackEvent {
    /// The number of cells was detected from the resting voltage.
    CellsDetected {
        /// Cells in series.
        count: u8,
    },
    /// The resting voltage fits no number of cells, or several.
    CellsAmbiguous {
        /// The resting voltage, in volts.
        voltage_v: f32,
    },
    /// The pack was swapped: estimates and consumption restart.
    Swapped,
    /// Its charge is estimated from the voltage once more: another pack was put in, or this one was charged meanwhile.
    EstimateRestarted,
    /// The pack was disconnected while armed.
    ContactLost,
    /// It has been connected again for a while.
    ContactRestored,
    /// There was a gap in the current readings.
    Gap(Gap),
    /// The current is over its sensor's range for the first time since the start.
    CurrentOverRange(CurrentRange),
    /// Its current was measured before, and is not any more, as nothing else that counts the charge; no threshold needs it.
    CurrentLost,
    /// The component with this id measures it from now on, in place of another.
    MeasuredBy(u8),
    /// Its sensor takes a load for charging, since the start: the charge is estimated from the voltage alone.
    CurrentReversed,
    /// The voltage is above `MOT_DRV_VOLT` for the first time since the start; whether the pack supplies the motors is not known.
    AboveDrivers,
    /// The motors are limited since it would supply more than `BATT_WATT_MAX`, in watts; `None`: no longer.
    PowerLimited(Option<u16>),
    /// The rover was armed with `BATT_WATT_MAX`, and the current is not known that this needs.
    PowerUnknown,
    /// No part was found on the bus while disarmed, at its address if that is set, but others answer: the first of them.
    NotFound {
        /// Its address; `None` is all that such parts have.
        address: Option<u8>,
        /// Addresses that answer and measure no pack here.
        answering: [Option<u8>; MAX_ANSWERING],
    },
    /// A smart battery was met for the first time since the start.
    Found {
        /// Its address.
        address: u8,
        /// Its cells, if known.
        cells: Option<u8>,
    },
    /// A part that measures over a shunt was set up for the first time since the start.
    Range {
        /// Its name.
        part: &'static str,
        /// The largest current that it measures with the shunt that is set, in amperes.
        current_a: f32,
    },
    /// Its sensor has failed repeatedly, with the latest error.
    SensorFailed(ReadError),
    /// Its sensor has recovered.
    SensorRecovered,
    /// Its power button is held.
    PoweringOff,
    /// These packs have left the sum, one bit per instance from bit 0: they are not connected.
    MembersLeft(u16),
    /// A worse charge state was entered than before: LOW, CRITICAL or EMERGENCY.
    Charge {
        /// The charge state.
        state: ChargeState,
        /// Remaining charge, in percent, if known.
        remaining_pct: Option<f32>,
        /// Usable charge, in percent, if known.
        usable_pct: Option<f32>,
        /// Terminal voltage, in volts, if known.
        voltage_v: Option<f32>,
    },
    /// It is being charged.
    Charging,
    /// Its capacity and resistance were learnt for the first time.
    Learnt {
        /// Capacity, in milliampere-hours.
        capacity_mah: f32,
        /// Resistance of the whole pack when warm, in ohms.
        resistance_ohm: f32,
    },
    /// It has learnt a capacity more than a tenth and two standard deviations above the one that is set, with the parameter that scales
    /// its current, if there is one.
    CapacityAboveLabel(Option<BatteryParameter>),
    /// A drive has taught nothing. For the log alone.
    NotLearnt(LessonObstacle),
    /// These faults have begun.
    Faults(Faults),
    /// The pack reports these faults since now.
    ReportedFaults(Faults),
    /// Its percentages can't act, since its charge is too uncertain, and no threshold in volts is in effect: the parameter
    /// to set.
    PercentagesInert(BatteryParameter),
    /// The pack reports since now that it is FAILED or UNHEALTHY, or by its report alone it is LOW or worse.
    ReportedState {
        /// Its charge state.
        state: ChargeState,
        /// The faults that it reports with it.
        cause: Faults,
    },
    /// A failsafe level was reached.
    Failsafe {
        /// The level.
        level: FailsafeLevel,
        /// The latest known terminal voltage, in volts.
        voltage_v: Option<f32>,
        /// Charge or fuel drawn, if known.
        consumed: Option<Amount>,
    },
    /// An action was chosen for a failsafe level that was reached before.
    ActionTooLate(FailsafeLevel),
}

/// Most addresses that answer in place of a part that was not found.
pub const MAX_ANSWERING: usize = 5;

/// The most events of one tick: cells detected, pack swapped or estimate
/// restarted, gap, current over range or reversed, sensor failed or recovered, contact lost
/// or restored, powering off or members left, two failsafe levels, charge state, charging, faults, reported faults or state, learnt
/// or not, capacity above the label, percentages that can't act.
const MAX_EVENTS: usize = 16;

/// Charge that remains and is not usable is mentioned from here on, in percent.
const WORTH_SAYING_PCT: f32 = 3.0;

/// The events of one tick.
pub type PackEvents = Vec<PackEvent, MAX_EVENTS>;

/// Room for the names of faults in a text, each with a separator behind it but the last one.
const FAULTS_BYTES: usize = ANNOUNCEMENT_BYTES - "Battery 9 reports: ".len() + SEPARATOR.len();

const SEPARATOR: &str = ", ";

/// Never full: there is room for one event of every kind.
pub fn push(events: &mut PackEvents, event: PackEvent) {
    let _ = events.push(event);
}

impl PackEvent {
    /// A failsafe level of a pack in this state, with its latest known voltage, in volts.
    pub fn failsafe(level: FailsafeLevel, voltage_v: Option<f32>, state: &BatteryState) -> Self {
        Self::Failsafe {
            level,
            voltage_v,
            consumed: state.consumed,
        }
    }

    /// The part of it that one text has room for, and the rest, if there is any.
    pub fn split(self) -> (Self, Option<Self>) {
        let (faults, names, event): (_, &[_], fn(Faults) -> Self) = match self {
            Self::Faults(faults) => (faults, &FAULT_NAMES[..], Self::Faults),
            Self::ReportedFaults(faults) => (faults, &REPORTED_NAMES[..], Self::ReportedFaults),
            _ => return (self, None),
        };
        let mut room = FAULTS_BYTES;
        let mut rest = Faults::empty();
        for (fault, name) in names.iter().filter(|(fault, _)| faults.contains(*fault)) {
            match room.checked_sub(name.len() + SEPARATOR.len()) {
                Some(left) if rest.is_empty() => room = left,
                _ => rest |= *fault,
            }
        }
        (event(faults - rest), (!rest.is_empty()).then(|| event(rest)))
    }
}

/// An event of a pack, as it is announced.
#[derive(Clone, Copy, Debug)]
pub struct PackNotice<'a>(pub Pack, pub &'a PackEvent);

impl Announce for PackNotice<'_> {
    /// A low battery is a warning, as in ArduPilot; a critical one is critical, where ArduPilot has a warning.
    fn severity(&self) -> Severity {
        match self.1 {
            PackEvent::Failsafe {
                level: FailsafeLevel::Critical,
                ..
            }
            | PackEvent::Charge {
                state: ChargeState::Critical | ChargeState::Emergency,
                ..
            }
            | PackEvent::ReportedState {
                state: ChargeState::Critical | ChargeState::Emergency,
                ..
            } => Severity::Critical,
            PackEvent::CellsDetected { .. }
            | PackEvent::SensorRecovered
            | PackEvent::ContactRestored
            | PackEvent::Found { .. }
            | PackEvent::Range { .. }
            | PackEvent::Charging
            | PackEvent::PowerLimited(None)
            | PackEvent::Learnt { .. }
            | PackEvent::NotLearnt(_) => Severity::Notice,
            _ => Severity::Warning,
        }
    }

    fn limit(&self) -> Limit {
        Limit::of(self.1).of_pack(Some(self.0))
    }
}

impl fmt::Display for PackNotice<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(pack, event) = self;
        write!(f, "Battery {} {event}", pack.number())?;
        let name = |parameter: BatteryParameter| parameter.of(*pack).name();
        let cells = name(BatteryParameter::Cells);
        match event {
            PackEvent::CellsDetected { .. } => write!(f, " (set {cells} to be sure)"),
            PackEvent::CellsAmbiguous { .. } => write!(f, ": set {cells}"),
            PackEvent::PercentagesInert(parameter) => write!(f, ": set {}", name(*parameter)),
            PackEvent::CapacityAboveLabel(scale) => {
                if let Some(scale) = scale {
                    write!(f, " {} or", name(*scale))?;
                }
                write!(f, " {}", name(BatteryParameter::Capacity))
            }
            _ => Ok(()),
        }
    }
}

impl fmt::Display for PackEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::CellsDetected { count } => write!(f, "has {count} cells"),
            Self::CellsAmbiguous { voltage_v } => {
                write!(f, "cells unclear at {}V", Hundredths(*voltage_v))
            }
            Self::Swapped => f.write_str("swapped: estimates restarted"),
            Self::EstimateRestarted => f.write_str("estimate restarted"),
            Self::ContactLost => f.write_str("not connected"),
            Self::ContactRestored => f.write_str("connected again"),
            Self::Gap(Gap {
                duration_s,
                counted_mah: Some(counted_mah),
            }) => write!(
                f,
                "not measured for {}s: {}mAh assumed",
                round_to_i32(*duration_s),
                round_to_i32(*counted_mah)
            ),
            Self::Gap(Gap { duration_s, .. }) => {
                write!(
                    f,
                    "not measured for {}s: consumption too low",
                    round_to_i32(*duration_s)
                )
            }
            Self::CurrentOverRange(range) => {
                f.write_str("current over range")?;
                match range {
                    CurrentRange::Over => f.write_str(": consumption too low"),
                    _ => Ok(()),
                }
            }
            Self::CurrentLost => f.write_str("current lost: charge by voltage alone"),
            Self::MeasuredBy(component_id) => write!(f, "measured by component {component_id}"),
            Self::CurrentReversed => f.write_str("current sensor reversed?"),
            Self::AboveDrivers => f.write_str("voltage above MOT_DRV_VOLT"),
            Self::PowerLimited(Some(max_w)) => write!(f, "limits the motors: over {max_w}W"),
            Self::PowerLimited(None) => f.write_str("no longer limits the motors"),
            Self::PowerUnknown => f.write_str("can't limit the motors: current unknown"),
            Self::NotFound { address, answering } => {
                f.write_str("not found")?;
                if let Some(address) = address {
                    write!(f, " at {address:#04x}")?;
                }
                let mut separator = ": the bus answers at ";
                for address in answering.iter().flatten() {
                    write!(f, "{separator}{address:#04x}")?;
                    separator = ", ";
                }
                match answering {
                    [None, ..] => f.write_str(": nothing answers"),
                    _ => Ok(()),
                }
            }
            Self::Found { address, cells: None } => write!(f, "found at {address:#04x}"),
            Self::Found {
                address,
                cells: Some(cells),
            } => write!(f, "found at {address:#04x}, {cells} cells"),
            Self::Range { part, current_a } => {
                let tenths = round_to_i32(current_a * 10.0);
                write!(f, "{part} up to {}.{} A", tenths / 10, tenths % 10)
            }
            Self::SensorFailed(error) => write!(f, "unhealthy: {error}"),
            Self::SensorRecovered => f.write_str("healthy again"),
            Self::PercentagesInert(_) => f.write_str("percentages can't act"),
            Self::PoweringOff => f.write_str("is powering off"),
            Self::MembersLeft(left) => {
                f.write_str("sums without battery ")?;
                write_packs(f, *left)
            }
            Self::Charge {
                state,
                remaining_pct,
                usable_pct,
                voltage_v,
            } => {
                write!(f, "{}:", charge_state_name(*state))?;
                if let Some(voltage_v) = voltage_v {
                    write!(f, " {}V", Hundredths(*voltage_v))?;
                }
                match (remaining_pct, usable_pct) {
                    (Some(remaining_pct), Some(usable_pct))
                        if remaining_pct - usable_pct >= WORTH_SAYING_PCT =>
                    {
                        write!(f, " {}% usable", round_to_i32(*usable_pct))
                    }
                    (Some(remaining_pct), _) => write!(f, " {}% left", round_to_i32(*remaining_pct)),
                    (None, _) => Ok(()),
                }
            }
            Self::ActionTooLate(level) => {
                write!(f, "is {} already: acts next time, choose Hold", name(*level))
            }
            Self::Charging => f.write_str("charging"),
            Self::Learnt {
                capacity_mah,
                resistance_ohm,
            } => write!(
                f,
                "learnt: {} mAh, {} mOhm",
                round_to_i32(*capacity_mah),
                round_to_i32(resistance_ohm * 1e3)
            ),
            Self::CapacityAboveLabel(_) => f.write_str("check"),
            Self::NotLearnt(obstacle) => write!(f, "not learnt: {obstacle}"),
            Self::Faults(faults) => write_faults(f, "fault: ", *faults, &FAULT_NAMES),
            Self::ReportedFaults(faults) => write_faults(f, "reports: ", *faults, &REPORTED_NAMES),
            Self::ReportedState { state, cause } => {
                let name = match state {
                    ChargeState::Emergency => "empty",
                    state => charge_state_name(*state),
                };
                write!(f, "reports: {name}")?;
                write_faults(f, ", ", *cause, &REPORTED_NAMES)
            }
            Self::Failsafe {
                level,
                voltage_v,
                consumed,
            } => {
                write!(f, "is {}", name(*level))?;
                let mah = match consumed {
                    Some(Amount::Ml(ml)) => return write!(f, ", used {} ml", round_to_i32(*ml)),
                    None if voltage_v.is_none() => return Ok(()),
                    Some(Amount::Mah(mah)) => *mah,
                    None => 0.0,
                };
                if *level == FailsafeLevel::Unhealthy {
                    f.write_str(", last:")?;
                }
                // As ArduPilot does, with 0 for an unknown one of the two.
                let volts = Hundredths(voltage_v.unwrap_or(0.0));
                write!(f, " {volts}V used {} mAh", round_to_i32(mah))
            }
        }
    }
}

const FAULT_NAMES: [(Faults, &str); 11] = [
    (Faults::CELL_FAIL, "cell failed"),
    (Faults::CELL_DIFFERS, "cells differ at rest"),
    (Faults::DEEP_DISCHARGE, "deep discharge"),
    (Faults::OVER_TEMPERATURE, "over temperature"),
    (Faults::UNDER_TEMPERATURE, "under temperature"),
    (Faults::OVER_CURRENT, "over current"),
    (Faults::CELLS_CONFIGURATION, "voltage does not fit cells"),
    (Faults::CONTRADICTED_CHARGE, "charge contradicts voltage"),
    (Faults::UNDERSTATED_CHARGE, "charge below that of its cells"),
    (Faults::INCOMPATIBLE_VOLTAGE, "its packs differ in voltage"),
    (Faults::SPIKES, "voltage spikes"),
];

/// Names that packs have for their faults.
const REPORTED_NAMES: [(Faults, &str); 14] = [
    (Faults::BAD_BATTERY, "bad battery"),
    (Faults::NEEDS_SERVICE, "needs service"),
    (Faults::SWITCHED_OFF, "switched off by its protection"),
    (Faults::SHORT_CIRCUIT, "short circuit"),
    (Faults::CELL_FAIL, "cell failed"),
    (Faults::CELL_DIFFERS, "cells differ"),
    (Faults::DEEP_DISCHARGE, "deep discharge"),
    (Faults::OVER_TEMPERATURE, "over temperature"),
    (Faults::UNDER_TEMPERATURE, "under temperature"),
    (Faults::OVER_CURRENT, "over current"),
    (Faults::INCOMPATIBLE_VOLTAGE, "incompatible voltage"),
    (Faults::SPIKES, "voltage spikes"),
    (Faults::CELLS_CONFIGURATION, "incompatible cells"),
    (Faults::INCOMPATIBLE_FIRMWARE, "incompatible firmware"),
];

fn write_faults(
    f: &mut fmt::Formatter<'_>,
    start: &str,
    faults: Faults,
    names: &[(Faults, &str)],
) -> fmt::Result {
    let mut separator = start;
    for (_, name) in names.iter().filter(|(fault, _)| faults.contains(*fault)) {
        write!(f, "{separator}{name}")?;
        separator = SEPARATOR;
    }
    Ok(())
}

fn charge_state_name(state: ChargeState) -> &'static str {
    match state {
        ChargeState::Emergency => "emergency",
        ChargeState::Critical => "critical",
        ChargeState::Low => "low",
        ChargeState::Failed => "failed",
        ChargeState::Unhealthy => "unhealthy",
        _ => "fine",
    }
}

fn name(level: FailsafeLevel) -> &'static str {
    match level {
        FailsafeLevel::None => "fine",
        FailsafeLevel::Unhealthy => "missing",
        FailsafeLevel::Low => "low",
        FailsafeLevel::Critical => "critical",
    }
}
