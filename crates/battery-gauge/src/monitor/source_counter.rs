//! A counter that the source of a measurement keeps: in steps, late, and from another start after it has lost power.

use crate::estimator::Reading;
use crate::measurement::COULOMBS_PER_MAH;
use crate::{Consumed, Measurement};

/// Largest step of a counter that a lag is allowed for, in milliampere-hours, and its step before it has shown one:
/// companions round to ten or a hundred.
const MAX_STEP_MAH: f32 = 100.0;

/// A counter may be late by the charge of this time, in seconds: two of the slowest periods.
const LAG_S: f32 = 10.0;

/// Largest load that a total may show between two readings, in capacities per hour, and the capacity of a pack that has
/// none set, in milliampere-hours.
const MAX_RATE_PER_H: f32 = 20.0;
const USUAL_CAPACITY_MAH: f32 = 5000.0;

/// A counter that falls below this share of what it was has restarted. One that falls less follows a braking motor, or a
/// frame that was overtaken: it counts again above its maximum.
const RESTARTED_BELOW: f32 = 0.5;

const MAH_PER_COULOMB: f32 = 1.0 / COULOMBS_PER_MAH;
const SECONDS_PER_HOUR: f32 = 3600.0;

/// A total at the source.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Total {
    /// Not read yet.
    #[default]
    Unread,
    /// The next one is where counting goes on: what it has counted so far is known, or was drawn from the pack before.
    Rebased,
    At {
        /// The highest since the source has restarted.
        counted: f32,
        /// The highest of all.
        highest: f32,
    },
}

/// Change of a total.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Change {
    /// By what may have been drawn, or not at all.
    Steady,
    /// By more than may have been drawn: it is back where it was before it fell.
    Jumped,
}

impl Total {
    /// Takes a total that a restart of the source lowers by more than `least_fall`, and a load raises by `most_rise` at
    /// most. Returns by how much it shows more drawn than before.
    fn increase(&mut self, total: f32, least_fall: f32, most_rise: f32) -> (f32, Change) {
        let Self::At { counted, highest } = self else {
            *self = Self::At {
                counted: total,
                highest: total,
            };
            return (0.0, Change::Steady);
        };
        let rise = total - *counted;
        if rise <= 0.0 {
            if total < RESTARTED_BELOW * *counted && -rise > least_fall {
                *counted = total;
            }
            return (0.0, Change::Steady);
        }
        *counted = total;
        let beyond_highest = (total - *highest).max(0.0);
        *highest = highest.max(total);
        if rise > most_rise {
            (beyond_highest, Change::Jumped)
        } else {
            (rise, Change::Steady)
        }
    }
}

/// The counter of one pack's source.
#[derive(Clone, Copy, Debug, Default)]
pub struct SourceCounter {
    charge: Total,
    energy: Total,
    /// Energy that was integrated here since the source reported its total, in watt-hours.
    integrated_wh: f32,
    /// A sum's members, and the latest of what was drawn from them, which may fall.
    drawn_mah: Option<(u16, f32)>,
    /// Charge counted beyond the measured current, in milliampere-hours; negative by up to its lag.
    ahead_mah: f32,
    /// The largest step so far, in milliampere-hours.
    step_mah: Option<f32>,
    progress: Progress,
}

/// Whether the source counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Progress {
    /// Nothing was read of a counter.
    #[default]
    None,
    /// It has always stood still, which says nothing about an unknown current.
    StandsStill,
    Counts,
}

impl SourceCounter {
    /// Goes on from the next total: the pack was swapped, or its charge was set.
    pub fn rebase(&mut self) {
        *self = Self {
            step_mah: self.step_mah,
            progress: self.progress,
            ..Self::of_another_source()
        };
    }

    /// The next total is one of which nothing is known.
    pub fn of_another_source() -> Self {
        Self {
            charge: Total::Rebased,
            energy: Total::Rebased,
            ..Self::default()
        }
    }

    /// Whether there is one.
    pub fn exists(&self) -> bool {
        self.progress != Progress::None
    }

    /// Whether it has counted anything.
    pub fn counts(&self) -> bool {
        self.progress == Progress::Counts
    }

    /// Takes the total of a reading `dt_s` seconds after the one before, of a pack with this capacity; the energy unless it
    /// is unknown. Returns what was drawn meanwhile; `None` at the first one.
    pub fn total(
        &mut self,
        charge_mah: f32,
        energy_wh: Option<f32>,
        dt_s: f32,
        capacity_mah: Option<f32>,
    ) -> Option<Consumed> {
        let is_first = self.charge == Total::Unread;
        let step_mah = self.lag_mah(0.0);
        let rate_mah_per_h = MAX_RATE_PER_H * capacity_mah.unwrap_or(USUAL_CAPACITY_MAH);
        let most_mah = step_mah + rate_mah_per_h * dt_s / SECONDS_PER_HOUR;
        let (charge_mah, change) = self.charge.increase(charge_mah, step_mah, most_mah);
        let energy_wh = energy_wh.map_or(0.0, |energy_wh| {
            let most_wh = match change {
                Change::Steady => f32::INFINITY,
                Change::Jumped => 0.0,
            };
            let (increase_wh, _) = self.energy.increase(energy_wh, 0.0, most_wh);
            (increase_wh - core::mem::take(&mut self.integrated_wh)).max(0.0)
        });
        (!is_first).then_some(Consumed {
            charge_mah,
            energy_wh,
        })
    }

    /// Energy was integrated here, in watt-hours, while the source did not report its own.
    pub fn add_integrated_wh(&mut self, energy_wh: f32) {
        self.integrated_wh += energy_wh;
    }

    /// Takes what was drawn from a sum's members since the start. Returns what was drawn since the reading before, which
    /// includes the time in which the current was unknown. Where the current counted instead, or the members are others,
    /// counting restarts from 0.
    pub fn members(&mut self, measurement: &Measurement, drawn_mah: Option<f32>) -> Option<f32> {
        let Some(drawn_mah) = drawn_mah else {
            if measurement.current_a.is_some() {
                self.drawn_mah = None;
            }
            return None;
        };
        let members = measurement.members;
        match self.drawn_mah.replace((members, drawn_mah)) {
            Some((before, before_mah)) if before == members => Some(drawn_mah - before_mah),
            _ => {
                self.ahead_mah = 0.0;
                Some(0.0)
            }
        }
    }

    /// Corrects a reading by the charge that was counted since the one before, in milliampere-hours. `is_measured`: its
    /// mean current is that of a sensor, without a gap. The larger of the two counts.
    pub fn correct(&mut self, reading: &mut Reading, counted_mah: f32, is_measured: bool) {
        if counted_mah != 0.0 {
            self.progress = Progress::Counts;
        } else if self.progress == Progress::None {
            self.progress = Progress::StandsStill;
        }
        match reading.mean_current_a {
            Some(mean_a) if is_measured => {
                // A counter that does not count down stands still while a charger does its work.
                if mean_a >= 0.0 {
                    self.compare(reading, mean_a, counted_mah);
                }
            }
            _ if !self.counts() => {}
            _ if reading.dt_s > 0.0 => {
                reading.missed_s = 0.0;
                reading.mean_current_a = Some(counted_mah / (reading.dt_s * MAH_PER_COULOMB));
            }
            _ => reading.unmeasured_mah = counted_mah,
        }
    }

    /// Compares what was counted with the current of the same time, in amperes.
    fn compare(&mut self, reading: &mut Reading, mean_a: f32, counted_mah: f32) {
        let mut ahead_mah = self.ahead_mah + counted_mah - mean_a * reading.dt_s * MAH_PER_COULOMB;
        if counted_mah > 0.0 {
            let step_mah = counted_mah.min(MAX_STEP_MAH);
            match self.step_mah {
                Some(before_mah) => self.step_mah = Some(step_mah.max(before_mah)),
                // Most of the first step may have been drawn before its counter was read.
                None => {
                    self.step_mah = Some(step_mah);
                    ahead_mah = ahead_mah.min((ahead_mah - step_mah).max(0.0));
                }
            }
        }
        // A sum's members are counted less often than it is.
        let lag_mah = match self.drawn_mah {
            Some(_) => f32::INFINITY,
            None => self.lag_mah(mean_a),
        };
        reading.unmeasured_mah = ahead_mah.max(0.0);
        self.ahead_mah = ahead_mah.min(0.0).max(-lag_mah);
    }

    /// By how much the counter may be late at this current, in milliampere-hours.
    fn lag_mah(&self, current_a: f32) -> f32 {
        self.step_mah
            .unwrap_or(MAX_STEP_MAH)
            .max(current_a * LAG_S * MAH_PER_COULOMB)
    }
}
