//! BATX: what is estimated of a pack, for which ArduPilot has no field.

use super::format::Kind;
use super::packet::{Packet, RecordBytes, finite};
use crate::battery::{BatteryState, PackStatus};
use crate::pack::Pack;

/// Standard deviations between the estimate and each of its bounds: the truth is within them 19 times of 20.
const DEVIATIONS: f32 = 2.0;

/// `SoC` with its bounds and `Use`, the usable share, in percent; `Cap`, the learnt capacity, in milliampere-hours; `State`
/// and `Flt` by MAVLink's numbers and bits; `FS` by ArduPilot's; `Stat`, see [`status_number`].
pub(super) fn encode(time_us: u64, pack: Pack, state: &BatteryState) -> RecordBytes {
    let remaining_pct = finite(state.remaining_pct);
    let deviation_pct = finite(state.remaining_sigma_pct).map(|sigma_pct| DEVIATIONS * sigma_pct);
    let bounds = remaining_pct.zip(deviation_pct);
    Packet::at(Kind::Estimate, time_us)
        .u8(pack.instance())
        .number(remaining_pct)
        .number(bounds.map(|(pct, deviation_pct)| (pct - deviation_pct).max(0.0)))
        .number(bounds.map(|(pct, deviation_pct)| (pct + deviation_pct).min(100.0)))
        .number(state.usable_pct)
        .number(state.learnt_capacity_mah)
        .u8(state.charge_state as u8)
        .u16(state.faults_to_show().bits())
        .u8(state.failsafe as u8)
        .u8(status_number(state.status))
        .finish()
}

/// Numbers of the field `Stat`. They stay as they are: files are kept.
fn status_number(status: PackStatus) -> u8 {
    match status {
        PackStatus::Disabled => 0,
        PackStatus::Unknown => 1,
        PackStatus::NotConnected => 2,
        PackStatus::Healthy => 3,
        PackStatus::Unhealthy => 4,
    }
}
