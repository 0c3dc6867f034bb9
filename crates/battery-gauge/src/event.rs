//! Events of a pack.

use heapless::Vec;

use crate::consumption::Gap;
use crate::{
    Amount, BatteryState, ChargeState, CurrentRange, CurrentScale, FailsafeLevel, Faults, LessonObstacle,
    MissingSetting, ReadError,
};

/// An event of a pack that its monitor has noticed.
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
    /// The pack was disconnected under load.
    ContactLost,
    /// It has been connected again for a while.
    ContactRestored,
    /// There was a gap in the current readings.
    Gap(Gap),
    /// The current is over its sensor's range for the first time since the start.
    CurrentOverRange(CurrentRange),
    /// Its current was measured before, and is not any more, as nothing else that counts the charge; no threshold needs it.
    CurrentLost,
    /// Its sensor takes a load for charging, since the start: the charge is estimated from the voltage alone.
    CurrentReversed,
    /// Its sensor has failed repeatedly, with the latest error.
    SensorFailed(ReadError),
    /// Its sensor has recovered.
    SensorRecovered,
    /// Its power button is held.
    PoweringOff,
    /// These members have left the sum, a bit each as in its measurements: they are not connected.
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
    /// It has learnt a capacity more than a tenth and two standard deviations above the one that is set, with the setting that scales
    /// its current, if there is one.
    CapacityAboveLabel(Option<CurrentScale>),
    /// A drive has taught nothing. For the log alone.
    NotLearnt(LessonObstacle),
    /// These faults have begun.
    Faults(Faults),
    /// The pack reports these faults since now.
    ReportedFaults(Faults),
    /// Its percentages can't act, since its charge is too uncertain, and no threshold in volts is in effect: the setting
    /// that is missing.
    PercentagesInert(MissingSetting),
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
}

/// The most events of one tick: cells detected, pack swapped or estimate
/// restarted, gap, current over range or reversed, sensor failed or recovered, contact lost
/// or restored, powering off or members left, two failsafe levels, charge state, charging, faults, reported faults or state, learnt
/// or not, capacity above the label, percentages that can't act.
const MAX_EVENTS: usize = 16;

/// The events of one tick.
pub type PackEvents = Vec<PackEvent, MAX_EVENTS>;

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
}
