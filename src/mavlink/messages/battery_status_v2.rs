//! BATTERY_STATUS_V2 (369).

use super::units::{amp_hours, finite, number, temperature_cdegc};
use crate::battery::{
    Amount, BatteryState, ChargeSource, ChargeState, Consequences, Faults, PackStatus, consequences,
};
use crate::mavlink::dialect::{BATTERY_STATUS_V2_DATA, MavBatteryStatusFlags as Flags};
use crate::mavlink::requests::{FLAGS_OF_FAULTS, FLAGS_OF_MODES};
use crate::pack::Pack;
use crate::system::SystemState;

/// Faults of the pack itself: it has to be looked at before it is used again. The others pass, or are the rover's.
const FAULTS_TO_SERVICE: Faults = Faults::CELL_FAIL.union(Faults::DEEP_DISCHARGE);

/// State of `pack`.
///
/// Any content of `state` gives a conforming message: unknown or impossible values become MAVLink's sentinels. Unlike in
/// BATTERY_STATUS net charging can be reported: `capacity_consumed` is negative then.
pub fn build_battery_status_v2(state: &SystemState<'_>, pack: Pack) -> BATTERY_STATUS_V2_DATA {
    let battery = state.battery(pack);
    BATTERY_STATUS_V2_DATA {
        voltage: number(
            battery
                .voltage_to_report_v()
                .filter(|voltage_v| *voltage_v >= 0.0),
        ),
        current: number(battery.rate()),
        capacity_consumed: number(amp_hours(battery.consumed.map(Amount::number))),
        capacity_remaining: number(amp_hours(remaining(battery))),
        state_of_charge: number(state_of_charge_pct(battery)),
        status_flags: status_flags(battery),
        temperature: temperature_cdegc(battery.temperature_c),
        id: pack.instance(),
    }
}

fn state_of_charge_pct(battery: &BatteryState) -> Option<f32> {
    finite(battery.readings.remaining_pct).map(|percent| percent.clamp(0.0, 100.0))
}

/// The charge that is left, in milliampere-hours; of fuel, in millilitres.
fn remaining(battery: &BatteryState) -> Option<f32> {
    let capacity = battery.full_capacity().filter(|capacity| *capacity >= 0.0)?;
    Some(capacity * state_of_charge_pct(battery)? / 100.0)
}

fn status_flags(battery: &BatteryState) -> Flags {
    fault_flags(battery.faults_to_show())
        | flags_of(&FLAGS_OF_MODES, battery.readings.reported.modes)
        | readiness_flags(battery)
        | charge_flags(battery)
}

/// The flags that go with those of a table's bits that are in `present`.
fn flags_of<B: bitflags::Flags + Copy>(table: &[(B, Flags)], present: B) -> Flags {
    let set = table.iter().filter(|(bit, _)| present.contains(*bit));
    set.fold(Flags::empty(), |flags, (_, flag)| flags | *flag)
}

fn fault_flags(faults: Faults) -> Flags {
    let mut flags = flags_of(&FLAGS_OF_FAULTS, faults);
    if faults.intersects(FAULTS_TO_SERVICE) {
        flags |= Flags::MAV_BATTERY_STATUS_FLAGS_REQUIRES_SERVICE;
    }
    flags
}

/// QGroundControl shows a pack that is not ready as an emergency; so nothing is set while no pack is there.
fn readiness_flags(battery: &BatteryState) -> Flags {
    let is_there = matches!(battery.status, PackStatus::Healthy | PackStatus::Unhealthy);
    if is_there && consequences(battery).contains(Consequences::NOT_READY) {
        Flags::MAV_BATTERY_STATUS_FLAGS_NOT_READY_TO_USE
    } else {
        Flags::empty()
    }
}

fn charge_flags(battery: &BatteryState) -> Flags {
    let mut flags = Flags::empty();
    flags.set(
        Flags::MAV_BATTERY_STATUS_FLAGS_CHARGING,
        battery.charge_state == ChargeState::Charging
            || battery.readings.reported.charge_state == Some(ChargeState::Charging),
    );
    // A gauge counts from the full pack; what is estimated here is counted from boot.
    flags.set(
        Flags::MAV_BATTERY_STATUS_FLAGS_CAPACITY_RELATIVE_TO_FULL,
        battery.charge_source == ChargeSource::Gauge,
    );
    flags
}
