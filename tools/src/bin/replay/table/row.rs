//! A row of the table: one pack in one drive.

use rover_battmon::battery::{Faults, LearntPack};

use crate::failsafes::Levels;
use crate::survey::ArmedBefore;
use crate::vehicle::Vehicle;

/// A pack in a drive. `None` is unknown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// The log.
    pub path: String,
    /// The board's serial number.
    pub board_id: Option<String>,
    /// Which vehicle recorded the log.
    pub vehicle: Vehicle,
    /// MAVLink's id of the rover.
    pub system_id: Option<i32>,
    /// The pack's number, 1 to 9.
    pub pack: u8,
    /// The pack's serial number.
    pub serial_number: Option<i32>,
    /// When the drive began, in seconds since 1970 (UTC).
    pub start_utc_s: Option<f64>,
    /// When the drive began, in seconds since the recorder started.
    pub start_s: f64,
    /// Duration, in seconds.
    pub duration_s: f64,
    /// Why the vehicle is taken for armed before the log, if it is.
    pub armed_before: Option<ArmedBefore>,
    /// The log has all of it, to the disarming, and no damage up to there.
    pub complete: bool,
    /// Charge drawn, in milliampere-hours.
    pub drawn_mah: Option<f64>,
    /// Energy drawn, in watt-hours.
    pub drawn_wh: Option<f64>,
    /// The lowest resting voltage, in volts.
    pub rest_min_v: Option<f64>,
    /// The most by which the voltage was below the resting voltage, in volts.
    pub sag_max_v: Option<f64>,
    /// The lowest temperature of the pack, in degrees Celsius.
    pub temperature_min_c: Option<f64>,
    /// The highest one.
    pub temperature_max_c: Option<f64>,
    /// Internal resistance of the whole pack.
    pub resistance_mohm: Estimate,
    /// Learnt capacity.
    pub capacity_mah: Estimate,
    /// State of health.
    pub health_pct: Estimate,
    /// Failsafes, with the seconds since the drive began.
    pub failsafes: Vec<String>,
    /// Why the rover was not armed, since the drive before.
    pub arming_refusals: Vec<String>,
    /// Faults of the pack.
    pub faults: Faults,
    /// When the pack was low and critical by the log's parameters.
    pub levels: Levels,
    /// Changes of the failsafe's timers, as the log of this firmware has them, else in the replay, with the seconds since the drive began.
    pub timers: Vec<String>,
    /// Changes of the failsafe's timers as any log has them.
    pub recorded_timers: Vec<String>,
    /// Remaining charge at the end.
    pub remaining: Remaining,
    /// Remaining charge when the replay was low.
    pub remaining_low: Remaining,
    /// Remaining charge when the replay was critical.
    pub remaining_critical: Remaining,
    /// Failsafes that the log has at other times than the replay.
    pub differences: Vec<String>,
    /// The drive by other parameters.
    pub what_if: Option<WhatIf>,
}

/// A value, and its standard deviation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: Option<f64>,
    /// Its standard deviation, in the same unit.
    pub sigma: Option<f64>,
}

/// Remaining charge at a moment, in percent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Remaining {
    /// By the replay.
    pub replayed_pct: Option<f64>,
    /// As the log has it.
    pub recorded_pct: Option<f64>,
}

/// Effect of other parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WhatIf {
    /// The parameters.
    pub parameters: String,
    /// By these.
    pub levels: Levels,
}

impl Row {
    /// Takes over what is learnt by now; `reported_health_pct` is what the log has.
    pub fn learn(&mut self, learnt: &LearntPack, rated_mah: Option<f32>, reported_health_pct: Option<f32>) {
        let capacity = learnt.capacity_mah().map(f64::from);
        let sigma_mah = learnt.capacity_sigma_mah().map(f64::from);
        self.capacity_mah = Estimate {
            value: capacity,
            sigma: sigma_mah,
        };
        let learnt_pct = learnt.health_pct(rated_mah).map(f64::from);
        let rated_mah = rated_mah.map(f64::from);
        self.health_pct = Estimate {
            value: learnt_pct.or(reported_health_pct.map(f64::from)),
            sigma: learnt_pct
                .and(sigma_mah.zip(rated_mah))
                .map(|(sigma_mah, rated_mah)| 100.0 * sigma_mah / rated_mah),
        };
    }
}
