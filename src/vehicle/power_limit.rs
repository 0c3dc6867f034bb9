//! Limit of the power that a pack supplies, by the duties of the motors.

use core::mem;

use crate::pack::{MAX_PACKS, Pack};
use crate::parameter::{BatteryParameter, Parameters, VehicleParameter};
use crate::time::Instant;

/// Least share of the duties, ArduPilot's: the rover still moves.
const LEAST_SHARE: f32 = 0.05;

/// Longest interval between two readings that counts, in seconds: after a gap one reading does not decide alone.
const MAX_INTERVAL_S: f32 = 1.0;

/// Power limit of a pack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerLimit {
    /// Maximum power (`BATT_WATT_MAX`), in watts.
    pub max_w: f32,
    /// Time constant of its control (`MOT_BAT_WATT_TC`), in seconds.
    pub time_constant_s: f32,
}

impl PowerLimit {
    /// From the live parameters; `None` is unlimited.
    pub fn from_parameters(parameters: &Parameters, pack: Pack) -> Option<Self> {
        let max_w = parameters.get(BatteryParameter::WattMax.of(pack));
        (max_w > 0.0).then(|| Self {
            max_w,
            time_constant_s: parameters.get(VehicleParameter::MotBatWattTc),
        })
    }

    /// Share of the duties after `dt_s` at this power, as in ArduPilot.
    fn next_share(&self, share: f32, dt_s: f32, power_w: f32) -> f32 {
        let step = dt_s / (dt_s + self.time_constant_s) * (1.0 - power_w / self.max_w);
        (share + step).clamp(LEAST_SHARE, 1.0)
    }
}

/// Shares of the motors' duties by the power limits of all packs. The least counts.
#[derive(Clone, Copy, Debug)]
pub struct PowerLimiter {
    /// Of each pack, from [`LEAST_SHARE`] to 1.
    shares: [f32; MAX_PACKS],
    updated_at: [Instant; MAX_PACKS],
    least: f32,
    /// Packs that have limited the motors since these were armed, a bit each.
    has_limited: u16,
}

impl Default for PowerLimiter {
    fn default() -> Self {
        Self {
            shares: [1.0; MAX_PACKS],
            updated_at: [Instant::EPOCH; MAX_PACKS],
            least: 1.0,
            has_limited: 0,
        }
    }
}

impl PowerLimiter {
    /// Share of the duties that all limits allow, from 0.05 to 1.
    pub fn share(&self) -> f32 {
        self.least
    }

    /// Follows the power of a pack, in watts; while that is unknown the share is held. Returns whether the pack limits the
    /// motors for the first time since they were armed.
    pub fn follow(
        &mut self,
        pack: Pack,
        now: Instant,
        limit: Option<PowerLimit>,
        power_w: Option<f32>,
    ) -> bool {
        let before = self.shares[pack as usize];
        let share = match (limit, power_w) {
            (None, _) => 1.0,
            (Some(_), None) => return false,
            (Some(limit), Some(power_w)) => {
                let since = mem::replace(&mut self.updated_at[pack as usize], now);
                let dt_s = (now.us_since(since) as f32 * 1e-6).min(MAX_INTERVAL_S);
                limit.next_share(before, dt_s, power_w)
            }
        };
        if share == before {
            return false;
        }
        self.shares[pack as usize] = share;
        self.least = self.shares.iter().copied().fold(1.0, f32::min);
        let is_first = self.has_limited & pack.bit() == 0;
        self.has_limited |= pack.bit();
        is_first
    }

    /// Whether the motors can't be limited any further for a pack.
    pub fn is_exhausted(&self, pack: Pack) -> bool {
        self.shares[pack as usize] <= LEAST_SHARE
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;

    const LIMIT: Option<PowerLimit> = Some(PowerLimit {
        max_w: 20.0,
        time_constant_s: 2.0,
    });

    /// A limiter, and the moment of its next reading in milliseconds.
    #[derive(Default)]
    struct Rig(PowerLimiter, u64);

    impl Rig {
        fn new() -> Self {
            let mut rig = Self::default();
            rig.read(Pack::First, Some(0.0));
            rig
        }

        /// A reading every 100 ms. Returns whether the pack begins to limit.
        fn read(&mut self, pack: Pack, power_w: Option<f32>) -> bool {
            self.1 += 100;
            self.0.follow(pack, at_us(1000 * self.1), LIMIT, power_w)
        }

        fn read_for(&mut self, readings: u32, power_w: Option<f32>) -> f32 {
            for _ in 0..readings {
                self.read(Pack::First, power_w);
            }
            self.0.share()
        }
    }

    #[test]
    fn the_share_moves_as_in_ardupilot_between_its_ends() {
        let mut rig = Rig::new();
        // 0.1 / (0.1 + 2) of 1 - 30 / 20.
        let after_one = rig.read_for(1, Some(30.0));
        assert!((after_one - (1.0 - 0.5 / 21.0)).abs() < 1e-5, "{after_one}");
        assert!(!rig.0.is_exhausted(Pack::First));
        assert_eq!(rig.read_for(100, Some(30.0)), LEAST_SHARE);
        assert!(rig.0.is_exhausted(Pack::First));
        assert!(!rig.0.is_exhausted(Pack::Second));
        let released = rig.read_for(1, Some(10.0));
        assert!((released - (LEAST_SHARE + 0.5 / 21.0)).abs() < 1e-5, "{released}");
        assert_eq!(rig.read_for(100, Some(-10.0)), 1.0);
    }

    #[test]
    // Requirement: AP-28
    fn a_load_by_the_square_of_the_duty_settles_at_the_limit() {
        for full_w in [21.0, 52.0, 200.0] {
            let mut rig = Rig::new();
            let mut share = 1.0_f32;
            for _ in 0..50 {
                share = rig.read_for(1, Some(full_w * share * share));
            }
            let power_w = full_w * share * share;
            assert!((power_w / 20.0 - 1.0).abs() < 0.05, "{power_w} of {full_w}");
        }
    }

    #[test]
    fn an_unknown_power_holds_the_share_and_counts_for_a_second_at_most() {
        let mut rig = Rig::new();
        let limited = rig.read_for(10, Some(40.0));
        assert_eq!(rig.read_for(1000, None), limited);
        let step = rig.read_for(1, Some(0.0)) - limited;
        assert!((step - 1.0 / 3.0).abs() < 0.01, "{step}");
    }

    #[test]
    fn the_strictest_pack_counts_and_each_begins_once() {
        let mut rig = Rig::new();
        rig.read(Pack::Ninth, Some(0.0));
        assert!(!rig.read(Pack::Ninth, Some(20.0)), "at the limit");
        assert!(rig.read(Pack::First, Some(30.0)));
        let first = rig.0.share();
        assert!(rig.read(Pack::Ninth, Some(100.0)));
        let ninth = rig.0.share();
        assert!(ninth < first);
        assert!(!rig.read(Pack::First, Some(0.0)));
        assert_eq!(rig.0.share(), ninth);
        // Without a limit it is as if it never had one.
        assert!(!rig.0.follow(Pack::Ninth, at_us(0), None, Some(100.0)));
        assert!(rig.0.share() > ninth);
    }
}
