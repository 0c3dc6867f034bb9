//! What is announced of a pack: the events of its monitor, and those of its sensor and its motors.

use core::fmt;

use super::{Amount, ChargeState, CurrentRange, FailsafeLevel, Faults, Gap, PackEvent};
use crate::announce::{ANNOUNCEMENT_BYTES, Announce, Limit, Severity};
use crate::numbers::{Hundredths, round_to_i32};
use crate::pack::{Pack, PackSet};
use crate::parameter::BatteryParameter;

/// An event of a pack that its monitor does not see: of its sensor, and of the motors that it supplies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SupplyEvent {
    /// The component with this id measures it from now on, in place of another.
    MeasuredBy(u8),
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
    /// An action was chosen for a failsafe level that was reached before.
    ActionTooLate(FailsafeLevel),
}

/// Most addresses that answer in place of a part that was not found.
pub const MAX_ANSWERING: usize = 5;

/// Charge that remains and is not usable is mentioned from here on, in percent.
const WORTH_SAYING_PCT: f32 = 3.0;

/// Room for the names of faults in a text, each with a separator behind it but the last one.
const FAULTS_BYTES: usize = ANNOUNCEMENT_BYTES - "Battery 9 reports: ".len() + SEPARATOR.len();

const SEPARATOR: &str = ", ";

/// An event of a pack, as it is announced: one of its monitor, or another one.
#[derive(Clone, Copy, Debug)]
pub struct PackNotice<'a, E = PackEvent>(pub Pack, pub &'a E);

impl PackNotice<'_> {
    /// The part of its event that one text has room for, and the rest, if there is any.
    pub fn split(&self) -> (PackEvent, Option<PackEvent>) {
        let event = *self.1;
        let (faults, names, of): (_, &[_], fn(Faults) -> PackEvent) = match event {
            PackEvent::Faults(faults) => (faults, &FAULT_NAMES[..], PackEvent::Faults),
            PackEvent::ReportedFaults(faults) => (faults, &REPORTED_NAMES[..], PackEvent::ReportedFaults),
            _ => return (event, None),
        };
        let mut room = FAULTS_BYTES;
        let mut rest = Faults::empty();
        for (fault, name) in names.iter().filter(|(fault, _)| faults.contains(*fault)) {
            match room.checked_sub(name.len() + SEPARATOR.len()) {
                Some(left) if rest.is_empty() => room = left,
                _ => rest |= *fault,
            }
        }
        (of(faults - rest), (!rest.is_empty()).then(|| of(rest)))
    }
}

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
            | PackEvent::Charging
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
        write!(f, "Battery {} ", pack.number())?;
        let name = |parameter: BatteryParameter| parameter.of(*pack).name();
        let cells = name(BatteryParameter::Cells);
        match event {
            PackEvent::CellsDetected { count } => write!(f, "has {count} cells (set {cells} to be sure)"),
            PackEvent::CellsAmbiguous { voltage_v } => {
                write!(f, "cells unclear at {}V: set {cells}", Hundredths(*voltage_v))
            }
            PackEvent::Swapped => f.write_str("swapped: estimates restarted"),
            PackEvent::EstimateRestarted => f.write_str("estimate restarted"),
            PackEvent::ContactLost => f.write_str("not connected"),
            PackEvent::ContactRestored => f.write_str("connected again"),
            PackEvent::Gap(Gap {
                duration_s,
                counted_mah: Some(counted_mah),
            }) => write!(
                f,
                "not measured for {}s: {}mAh assumed",
                round_to_i32(*duration_s),
                round_to_i32(*counted_mah)
            ),
            PackEvent::Gap(Gap { duration_s, .. }) => {
                write!(
                    f,
                    "not measured for {}s: consumption too low",
                    round_to_i32(*duration_s)
                )
            }
            PackEvent::CurrentOverRange(range) => {
                f.write_str("current over range")?;
                match range {
                    CurrentRange::Over => f.write_str(": consumption too low"),
                    _ => Ok(()),
                }
            }
            PackEvent::CurrentLost => f.write_str("current lost: charge by voltage alone"),
            PackEvent::CurrentReversed => f.write_str("current sensor reversed?"),
            PackEvent::SensorFailed(error) => write!(f, "unhealthy: {error}"),
            PackEvent::SensorRecovered => f.write_str("healthy again"),
            PackEvent::PercentagesInert(missing) => {
                write!(f, "percentages can't act: set {}", name((*missing).into()))
            }
            PackEvent::PoweringOff => f.write_str("is powering off"),
            PackEvent::MembersLeft(left) => {
                f.write_str("sums without battery ")?;
                write!(f, "{}", PackSet::from_bits(*left))
            }
            PackEvent::Charge {
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
            PackEvent::Charging => f.write_str("charging"),
            PackEvent::Learnt {
                capacity_mah,
                resistance_ohm,
            } => write!(
                f,
                "learnt: {} mAh, {} mOhm",
                round_to_i32(*capacity_mah),
                round_to_i32(resistance_ohm * 1e3)
            ),
            PackEvent::CapacityAboveLabel(scale) => {
                f.write_str("check ")?;
                if let Some(scale) = scale {
                    write!(f, "{} or ", name((*scale).into()))?;
                }
                write!(f, "{}", name(BatteryParameter::Capacity))
            }
            PackEvent::NotLearnt(obstacle) => write!(f, "not learnt: {obstacle}"),
            PackEvent::Faults(faults) => write_faults(f, "fault: ", *faults, &FAULT_NAMES),
            PackEvent::ReportedFaults(faults) => write_faults(f, "reports: ", *faults, &REPORTED_NAMES),
            PackEvent::ReportedState { state, cause } => {
                let name = match state {
                    ChargeState::Emergency => "empty",
                    state => charge_state_name(*state),
                };
                write!(f, "reports: {name}")?;
                write_faults(f, ", ", *cause, &REPORTED_NAMES)
            }
            PackEvent::Failsafe {
                level,
                voltage_v,
                consumed,
            } => {
                write!(f, "is {}", level_name(*level))?;
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

impl Announce for PackNotice<'_, SupplyEvent> {
    fn severity(&self) -> Severity {
        match self.1 {
            SupplyEvent::Found { .. } | SupplyEvent::Range { .. } | SupplyEvent::PowerLimited(None) => {
                Severity::Notice
            }
            _ => Severity::Warning,
        }
    }

    fn limit(&self) -> Limit {
        Limit::of(self.1).of_pack(Some(self.0))
    }
}

impl fmt::Display for PackNotice<'_, SupplyEvent> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(pack, event) = self;
        write!(f, "Battery {} ", pack.number())?;
        match event {
            SupplyEvent::MeasuredBy(component_id) => write!(f, "measured by component {component_id}"),
            SupplyEvent::AboveDrivers => f.write_str("voltage above MOT_DRV_VOLT"),
            SupplyEvent::PowerLimited(Some(max_w)) => write!(f, "limits the motors: over {max_w}W"),
            SupplyEvent::PowerLimited(None) => f.write_str("no longer limits the motors"),
            SupplyEvent::PowerUnknown => f.write_str("can't limit the motors: current unknown"),
            SupplyEvent::NotFound { address, answering } => {
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
            SupplyEvent::Found { address, cells: None } => write!(f, "found at {address:#04x}"),
            SupplyEvent::Found {
                address,
                cells: Some(cells),
            } => write!(f, "found at {address:#04x}, {cells} cells"),
            SupplyEvent::Range { part, current_a } => {
                let tenths = round_to_i32(current_a * 10.0);
                write!(f, "{part} up to {}.{} A", tenths / 10, tenths % 10)
            }
            SupplyEvent::ActionTooLate(level) => {
                let name = match level {
                    // By its own report, perhaps.
                    FailsafeLevel::Unhealthy => "unhealthy",
                    level => level_name(*level),
                };
                write!(f, "is {name} already: acts next time, choose Hold")
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

fn level_name(level: FailsafeLevel) -> &'static str {
    match level {
        FailsafeLevel::None => "fine",
        FailsafeLevel::Unhealthy => "missing",
        FailsafeLevel::Low => "low",
        FailsafeLevel::Critical => "critical",
    }
}
