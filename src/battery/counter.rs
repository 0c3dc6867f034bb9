//! Counters of drawn charge at the source of a measurement.

use super::Consumed;
use super::estimator::Reading;

/// Steps of a counter, in milliampere-hours: BATTERY_STATUS and motor controllers count whole ones.
const STEP_MAH: f32 = 1.0;

/// A counter that falls below this share of what it was has restarted. One that falls less follows a braking motor, or a
/// frame that was overtaken: it counts again above its maximum.
const RESTARTED_BELOW: f32 = 0.5;

const MAH_PER_COULOMB: f32 = 1.0 / 3.6;

/// A total at the source.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Total {
    /// Not read yet: what it has counted so far was drawn from this pack.
    #[default]
    Unread,
    /// The next one is where counting goes on: what it has counted so far is known, or was drawn from the pack before.
    Rebased,
    /// The highest since it started.
    At(f32),
}

/// What a total says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Change {
    /// The first one: its value was drawn before.
    First,
    /// So much was drawn since the one before.
    Increase(Consumed),
}

impl Total {
    fn increase(&mut self, total: f32) -> f32 {
        match *self {
            Self::At(highest) if total <= highest && total >= RESTARTED_BELOW * highest => 0.0,
            Self::At(highest) => {
                *self = Self::At(total);
                (total - highest).max(0.0)
            }
            Self::Unread | Self::Rebased => {
                *self = Self::At(total);
                0.0
            }
        }
    }
}

/// The counter of one pack's source.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SourceCounter {
    charge: Total,
    energy: Total,
    /// The latest of a sum's members, which count down, too.
    drawn_mah: Option<f32>,
    /// What it has counted beyond the measured current, in milliampere-hours; negative by up to a step.
    ahead_mah: f32,
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
            charge: Total::Rebased,
            energy: Total::Rebased,
            ..Self::default()
        };
    }

    /// Whether there is one.
    pub fn has_counted(&self) -> bool {
        self.progress != Progress::None
    }

    /// Takes the totals of a reading. A total that falls is a restart of the source.
    pub fn total(&mut self, total: Consumed) -> Change {
        let is_first = self.charge == Total::Unread;
        let increase = Consumed {
            charge_mah: self.charge.increase(total.charge_mah),
            energy_wh: self.energy.increase(total.energy_wh),
        };
        if is_first {
            Change::First
        } else {
            Change::Increase(increase)
        }
    }

    /// Takes what was drawn from a sum's members since the start. Returns what was drawn since the reading before.
    pub fn members(&mut self, drawn_mah: f32) -> f32 {
        let before_mah = self.drawn_mah.replace(drawn_mah);
        before_mah.map_or(0.0, |before_mah| drawn_mah - before_mah)
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
                let measured_mah = mean_a * reading.dt_s * MAH_PER_COULOMB;
                // A counter that does not count down stands still while a charger does its work.
                if measured_mah >= 0.0 {
                    let ahead_mah = (self.ahead_mah + counted_mah - measured_mah).max(-STEP_MAH);
                    reading.unmeasured_mah = ahead_mah.max(0.0);
                    self.ahead_mah = ahead_mah.min(0.0);
                }
            }
            _ if self.progress != Progress::Counts => {}
            _ if reading.dt_s > 0.0 => {
                reading.mean_current_a = Some(counted_mah / (reading.dt_s * MAH_PER_COULOMB));
            }
            _ => reading.unmeasured_mah = counted_mah,
        }
    }
}
