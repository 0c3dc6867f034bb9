//! The checks before arming: one list for an attempt to arm, RUN_PREARM_CHECKS and SYS_STATUS.

use core::fmt::Write;

use heapless::{String, Vec};

use super::{ArmingReadiness, LogHealth, SystemState};
use crate::battery::{ArmingFailure, BusError, ReadError, arming_failures};
use crate::numbers::text;
use crate::pack::Pack;
use crate::parameter::{
    BatteryParameter, MonitorKind, ParameterTrouble, Parameters, StickParameter, TemperatureSensor,
    ThermometerParameter, VehicleParameter,
};
use crate::sensor::{AnalogWiring, PinUse, thermometer_on_shared_pin};
use crate::vehicle::{ArmState, Stick, Vehicle};

/// `ARMING_CHECK`: all checks, or the one of the sticks, of the batteries or of the log.
const STICKS_CHECKED: i32 = 1 | 1 << 6;
const BATTERY_CHECKED: i32 = 1 | 1 << 8;
const LOG_CHECKED: i32 = 1 | 1 << 10;

/// A reason why the vehicle can't be armed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum ArmingObstacle {
    /// A failsafe has terminated the drive. Forced arming does not help.
    Terminated,
    /// The board is about to restart. Forced arming does not help.
    Restarting,
    /// The parameters may not be the owner's, whatever is checked.
    Parameters(ParameterTrouble),
    /// A check of this pack fails.
    Pack(Pack, ArmingFailure),
    /// This pack's latest reading failed, or that of its current or level does: with the address of its part on the I2C bus,
    /// if that is known.
    Sensor(Pack, ReadError, Option<u8>),
    /// This stick is deflected, by the channel with this number.
    Stick(Stick, u8),
    /// These parameters of the sticks do not fit each other.
    SticksMisfit(StickParameter, StickParameter),
    /// Something else is read at this thermometer's pin.
    PinTaken(TemperatureSensor),
    /// The log can't be written.
    Logging,
}

impl ArmingObstacle {
    /// Why the rover can't be armed, in ArduPilot's words, behind its word for what checks it: "PreArm" on request, "Arm" on an
    /// attempt. Two STATUSTEXT at most.
    pub fn text(self, checked_by: &str) -> String<96> {
        // The longest fits.
        match self {
            Self::Terminated => text(format_args!(
                "{checked_by}: Terminated: reset the battery or restart"
            )),
            Self::Restarting => text(format_args!("{checked_by}: restarting")),
            Self::Parameters(trouble) => text(format_args!("{checked_by}: {trouble}")),
            Self::Pack(pack, failure @ ArmingFailure::UnclearCells) => text(format_args!(
                "{checked_by}: Battery {} {failure}: set {}",
                pack.number(),
                BatteryParameter::Cells.of(pack).name()
            )),
            Self::Pack(pack, failure) => {
                text(format_args!("{checked_by}: Battery {} {failure}", pack.number()))
            }
            Self::Sensor(pack, error, address) => {
                let mut text: String<96> = text(format_args!(
                    "{checked_by}: Battery {} {}: {error}",
                    pack.number(),
                    ArmingFailure::Unhealthy
                ));
                if let Some(address) = address.filter(|_| error == BusError::NoAnswer.into()) {
                    let _ = write!(text, " at {address:#04x}");
                }
                text
            }
            Self::Stick(stick, channel) => text(format_args!(
                "{checked_by}: {} (RC{channel}) is not neutral",
                stick.name()
            )),
            Self::SticksMisfit(one, other) => text(format_args!(
                "{checked_by}: {} does not fit {}",
                one.row().name,
                other.row().name
            )),
            Self::PinTaken(sensor) => {
                let pin = ThermometerParameter::Pin.of(sensor).name();
                text(format_args!("{checked_by}: {pin} already in use"))
            }
            Self::Logging => text(format_args!("{checked_by}: Logging failed")),
        }
    }
}

/// The obstacles at a moment: more than a link has room for. Those that do not fit are left out.
pub type ArmingObstacles = Vec<ArmingObstacle, 64>;

/// Place of a pack's voltage measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeasuredAt {
    /// At the board's battery connector, which supplies the motor drivers.
    BatteryConnector,
    /// Anywhere else: what the pack supplies is not known.
    Elsewhere,
}

/// The place of measurement of `pack`, if its present voltage is above what the motor drivers stand (`MOT_DRV_VOLT`). At full scale it is
/// at least that of the scale.
// Not inlined: it is asked in several places.
#[inline(never)]
pub fn above_drivers(state: &SystemState<'_>, parameters: &Parameters, pack: Pack) -> Option<MeasuredAt> {
    let limit_v = parameters.get(VehicleParameter::MotDrvVolt);
    if limit_v == 0.0 {
        return None;
    }
    let battery = state.battery(pack);
    let wiring = AnalogWiring::from_parameters(parameters.pack(pack));
    let range_v = wiring
        .board_divider_range_v()
        .filter(|_| state.kind(pack).is_some_and(MonitorKind::reads_voltage_pin));
    let voltage_v = match (battery.read_error, range_v) {
        (Some(ReadError::OverRange), Some(range_v)) => range_v,
        _ => battery.readings.voltage_v?,
    };
    (voltage_v > limit_v).then_some(match range_v {
        Some(_) => MeasuredAt::BatteryConnector,
        None => MeasuredAt::Elsewhere,
    })
}

/// Everything that keeps the vehicle from being armed now, as far as it is checked (`ARMING_CHECK`), the most important first.
pub fn arming_obstacles(
    state: &SystemState<'_>,
    parameters: &Parameters,
    vehicle: &Vehicle,
) -> ArmingObstacles {
    let checks = parameters.get_whole(VehicleParameter::ArmingCheck);
    let mut found = ArmingObstacles::new();
    add_unconditional(&mut found, parameters, vehicle);
    if checks & BATTERY_CHECKED != 0 {
        add_of_packs(&mut found, state, parameters);
        add_of_pins(&mut found, state, parameters);
    }
    if checks & STICKS_CHECKED != 0 {
        add_of_sticks(&mut found, parameters, vehicle);
    }
    if checks & LOG_CHECKED != 0 && state.log == LogHealth::Failed {
        let _ = found.push(ArmingObstacle::Logging);
    }
    found
}

/// Obstacles that no setting of `ARMING_CHECK` leaves out.
fn add_unconditional(found: &mut ArmingObstacles, parameters: &Parameters, vehicle: &Vehicle) {
    if vehicle.is_terminated() {
        let _ = found.push(ArmingObstacle::Terminated);
    }
    if vehicle.pending_restart().is_some() {
        let _ = found.push(ArmingObstacle::Restarting);
    }
    if let Some(trouble) = parameters.trouble() {
        let _ = found.push(ArmingObstacle::Parameters(trouble));
    }
}

fn add_of_packs(found: &mut ArmingObstacles, state: &SystemState<'_>, parameters: &Parameters) {
    for (pack, battery) in Pack::ALL.into_iter().zip(state.batteries) {
        let settings = parameters.pack(pack).settings();
        let thresholds = parameters.pack(pack).arming_thresholds();
        let wiring = wiring_failure(state, parameters, pack);
        for failure in arming_failures(battery, &settings, &thresholds, wiring) {
            let _ = found.push(match (failure, battery.read_error) {
                (ArmingFailure::Unhealthy, Some(error)) => {
                    let address = state.part_addresses.get(pack as usize).copied().flatten();
                    ArmingObstacle::Sensor(pack, error, address)
                }
                _ => ArmingObstacle::Pack(pack, failure),
            });
        }
    }
}

/// A failure of a pack by the motors that it supplies, or by the packs that it is the sum of.
fn wiring_failure(state: &SystemState<'_>, parameters: &Parameters, pack: Pack) -> Option<ArmingFailure> {
    if above_drivers(state, parameters, pack) == Some(MeasuredAt::BatteryConnector) {
        Some(ArmingFailure::AboveDrivers)
    } else if sums_a_sum(state, parameters, pack) {
        Some(ArmingFailure::SumsASum)
    } else {
        None
    }
}

fn add_of_pins(found: &mut ArmingObstacles, state: &SystemState<'_>, parameters: &Parameters) {
    let pins = PinUse::of_packs(state.kinds, parameters);
    for (pack, kind) in state.kinds {
        // Of a pack that can't be read without this pin, the latest reading says so before long.
        let is_listed = state.battery(*pack).read_error == Some(ReadError::PinTaken);
        if !is_listed && pins.is_taken(*kind, parameters, *pack) {
            let _ = found.push(ArmingObstacle::Sensor(*pack, ReadError::PinTaken, None));
        }
    }
    if let Some(sensor) = thermometer_on_shared_pin(parameters, &pins) {
        let _ = found.push(ArmingObstacle::PinTaken(sensor));
    }
}

fn add_of_sticks(found: &mut ArmingObstacles, parameters: &Parameters, vehicle: &Vehicle) {
    for (one, other) in parameters.stick_misfits() {
        let _ = found.push(ArmingObstacle::SticksMisfit(one, other));
    }
    if let Some(stick) = vehicle.deflected_stick() {
        let _ = found.push(ArmingObstacle::Stick(stick, vehicle.channel_number(stick)));
    }
}

/// Whether this pack is a sum whose mask names another sum.
fn sums_a_sum(state: &SystemState<'_>, parameters: &Parameters, pack: Pack) -> bool {
    let is_sum = |pack: Pack| state.kind(pack) == Some(MonitorKind::Sum);
    let mut named = parameters.pack(pack).named_members().iter();
    is_sum(pack) && named.any(|other| other != pack && is_sum(other))
}

/// Whether the vehicle would be armed on request now.
pub fn arming_readiness(
    state: &SystemState<'_>,
    parameters: &Parameters,
    vehicle: &Vehicle,
) -> ArmingReadiness {
    let is_armed = vehicle.arm_state() == ArmState::Armed;
    if is_armed || arming_obstacles(state, parameters, vehicle).is_empty() {
        ArmingReadiness::Ready
    } else {
        ArmingReadiness::NotReady
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    // Requirement: AP-22
    fn a_failed_check_has_ardupilots_words() {
        for (checked_by, pack, failure, expected) in [
            (
                "PreArm",
                Pack::Ninth,
                ArmingFailure::CapacityOrder,
                "PreArm: Battery 9 capacity failsafe critical >= low",
            ),
            (
                "Arm",
                Pack::First,
                ArmingFailure::BelowArmingVoltage,
                "Arm: Battery 1 below minimum arming voltage",
            ),
            (
                "PreArm",
                Pack::Ninth,
                ArmingFailure::UnclearCells,
                "PreArm: Battery 9 cells unclear: set BATT9_CELLS",
            ),
        ] {
            assert_eq!(ArmingObstacle::Pack(pack, failure).text(checked_by), expected);
        }
    }
}
