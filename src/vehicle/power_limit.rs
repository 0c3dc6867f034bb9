//! Limit of the power that a pack supplies, by the duties of the motors.

use core::mem;

use crate::pack::{MAX_PACKS, Pack};
use crate::parameter::{BatteryParameter, PackParameters, VehicleParameter};
use battery_gauge::Lasting;

/// Least share of the duties, ArduPilot's: the rover still moves.
const LEAST_SHARE: f32 = 0.05;

/// Longest interval between two readings that counts, in seconds: after a gap one reading does not decide alone.
const MAX_INTERVAL_S: f32 = 1.0;

/// A limit is announced once the share has been below this for so long, in seconds: a short peak is not worth a text.
const ANNOUNCED_SHARE: f32 = 0.9;
const ANNOUNCED_AFTER_S: f32 = 2.0;

/// Its end is announced once the full share has lasted for so long, in seconds.
const ENDED_AFTER_S: f32 = 10.0;

/// Power limit of a pack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerLimit {
    /// Maximum power (`BATT_WATT_MAX`), in watts, at least 1.
    pub max_w: u16,
    /// Time constant of its control (`MOT_BAT_WATT_TC`), in seconds.
    pub time_constant_s: f32,
}

impl PowerLimit {
    /// From the live parameters; `None` is unlimited.
    pub fn from_parameters(pack: PackParameters<'_>) -> Option<Self> {
        // The table's range is 0 to 32767.
        let max_w = pack.get_whole(BatteryParameter::WattMax) as u16;
        (max_w > 0).then(|| Self {
            max_w,
            time_constant_s: pack.all.get(VehicleParameter::MotBatWattTc),
        })
    }

    /// Share of the duties after `dt_s` at this power, as in ArduPilot.
    fn next_share(&self, share: f32, dt_s: f32, power_w: f32) -> f32 {
        let step = dt_s / (dt_s + self.time_constant_s) * (1.0 - power_w / f32::from(self.max_w));
        (share + step).clamp(LEAST_SHARE, 1.0)
    }
}

/// Share of the motors' duties by the power limit of one pack, since they were armed.
#[derive(Clone, Copy, Debug)]
struct PackShare {
    /// From [`LEAST_SHARE`] to 1.
    share: f32,
    /// Time since the latest known power, in seconds.
    unmeasured_s: f32,
    /// For how long the share has contradicted [`is_announced`](Self::is_announced).
    contradicts: Lasting,
    /// The maximum power that the share is by, in watts; 0 is unlimited.
    max_w: u16,
    /// Whether the pack is announced to limit the motors.
    is_announced: bool,
}

impl PackShare {
    const FULL: Self = Self {
        share: 1.0,
        unmeasured_s: 0.0,
        contradicts: Lasting::NONE,
        max_w: 0,
        is_announced: false,
    };

    /// The share after `dt_s` seconds.
    fn follow(&mut self, dt_s: f32, limit: Option<PowerLimit>, power_w: Option<f32>) {
        self.unmeasured_s += dt_s;
        let max_w = limit.map_or(0, |limit| limit.max_w);
        if mem::replace(&mut self.max_w, max_w) != max_w {
            self.share = 1.0;
            self.unmeasured_s = 0.0;
        } else if let (Some(limit), Some(power_w)) = (limit, power_w) {
            let dt_s = mem::take(&mut self.unmeasured_s).min(MAX_INTERVAL_S);
            self.share = limit.next_share(self.share, dt_s, power_w);
        }
    }

    /// Whether the limit, or its end, is to be announced, `dt_s` seconds after the last call.
    fn begins_or_ends(&mut self, dt_s: f32) -> bool {
        let (contradicts, required_s) = if self.is_announced {
            (self.share == 1.0, ENDED_AFTER_S)
        } else {
            (self.share < ANNOUNCED_SHARE, ANNOUNCED_AFTER_S)
        };
        let has_lasted = self.contradicts.reaches(required_s, dt_s, contradicts);
        self.is_announced ^= has_lasted;
        has_lasted
    }
}

/// Shares of the motors' duties by the power limits of all packs. The least counts.
#[derive(Clone, Copy, Debug)]
pub struct PowerLimiter {
    packs: [PackShare; MAX_PACKS],
    least: f32,
}

impl Default for PowerLimiter {
    fn default() -> Self {
        Self {
            packs: [PackShare::FULL; MAX_PACKS],
            least: 1.0,
        }
    }
}

impl PowerLimiter {
    /// Share of the duties that all limits allow, from 0.05 to 1.
    pub fn share(&self) -> f32 {
        self.least
    }

    /// Follows the power of a pack, in watts, `dt_s` seconds after the last call. While the power is unknown the share is
    /// held; another maximum begins with the full share, whatever the power. Returns whether [`limits_to_w`](Self::limits_to_w)
    /// is to be announced.
    pub fn follow(&mut self, pack: Pack, dt_s: f32, limit: Option<PowerLimit>, power_w: Option<f32>) -> bool {
        let own = &mut self.packs[pack as usize];
        let before = own.share;
        own.follow(dt_s, limit, power_w);
        let is_news = own.begins_or_ends(dt_s);
        if own.share != before {
            let shares = self.packs.iter().map(|pack| pack.share);
            self.least = shares.fold(1.0, f32::min);
        }
        is_news
    }

    /// The power that a pack is announced to limit the motors to, in watts; `None` if it does not, or its limit was removed.
    pub fn limits_to_w(&self, pack: Pack) -> Option<u16> {
        let own = &self.packs[pack as usize];
        Some(own.max_w).filter(|max_w| own.is_announced && *max_w > 0)
    }

    /// Whether the motors can't be limited any further for a pack.
    pub fn is_exhausted(&self, pack: Pack) -> bool {
        self.packs[pack as usize].share <= LEAST_SHARE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: Option<PowerLimit> = Some(PowerLimit {
        max_w: 20,
        time_constant_s: 2.0,
    });

    const TICK_S: f32 = 0.1;

    /// A limiter in its first tick.
    fn limiter() -> PowerLimiter {
        let mut limiter = PowerLimiter::default();
        follow(&mut limiter, 1, LIMIT, Some(0.0));
        limiter
    }

    /// Ticks of the first pack. Returns those in which something is announced, from 1.
    fn follow(
        limiter: &mut PowerLimiter,
        ticks: u32,
        limit: Option<PowerLimit>,
        power_w: Option<f32>,
    ) -> Vec<u32> {
        let is_news = |_: &u32| limiter.follow(Pack::First, TICK_S, limit, power_w);
        (1..=ticks).filter(is_news).collect()
    }

    fn share_after(limiter: &mut PowerLimiter, ticks: u32, power_w: Option<f32>) -> f32 {
        follow(limiter, ticks, LIMIT, power_w);
        limiter.share()
    }

    #[test]
    fn the_share_moves_as_in_ardupilot_between_its_ends() {
        let mut limiter = limiter();
        // 0.1 / (0.1 + 2) of 1 - 30 / 20.
        let after_one = share_after(&mut limiter, 1, Some(30.0));
        assert!((after_one - (1.0 - 0.5 / 21.0)).abs() < 1e-5, "{after_one}");
        assert!(!limiter.is_exhausted(Pack::First));
        assert_eq!(share_after(&mut limiter, 100, Some(30.0)), LEAST_SHARE);
        assert!(limiter.is_exhausted(Pack::First));
        assert!(!limiter.is_exhausted(Pack::Second));
        let released = share_after(&mut limiter, 1, Some(10.0));
        assert!((released - (LEAST_SHARE + 0.5 / 21.0)).abs() < 1e-5, "{released}");
        assert_eq!(share_after(&mut limiter, 100, Some(-10.0)), 1.0);
    }

    #[test]
    // Requirement: AP-28
    fn a_load_by_the_square_of_the_duty_settles_at_the_limit() {
        for full_w in [21.0, 52.0, 200.0] {
            let mut limiter = limiter();
            let mut share = 1.0_f32;
            for _ in 0..50 {
                share = share_after(&mut limiter, 1, Some(full_w * share * share));
            }
            let power_w = full_w * share * share;
            assert!((power_w / 20.0 - 1.0).abs() < 0.05, "{power_w} of {full_w}");
        }
    }

    #[test]
    fn an_unknown_power_holds_the_share_and_counts_for_a_second_at_most() {
        let mut limiter = limiter();
        let limited = share_after(&mut limiter, 10, Some(40.0));
        assert_eq!(share_after(&mut limiter, 1000, None), limited);
        let step = share_after(&mut limiter, 1, Some(0.0)) - limited;
        assert!((step - 1.0 / 3.0).abs() < 0.01, "{step}");
    }

    #[test]
    // Requirement: AP-28
    fn another_maximum_begins_with_the_full_share_and_an_unchanged_one_does_not() {
        let limit_of = |max_w, time_constant_s| {
            Some(PowerLimit {
                max_w,
                time_constant_s,
            })
        };
        for power_w in [None, Some(40.0)] {
            let mut limited = limiter();
            follow(&mut limited, 100, LIMIT, Some(40.0));
            for (limit, restarts) in [
                (LIMIT, false),
                (limit_of(20, 5.0), false),
                (None, true),
                (limit_of(19, 2.0), true),
                (limit_of(1000, 2.0), true),
            ] {
                let mut limiter = limited;
                follow(&mut limiter, 1, limit, power_w);
                assert_eq!(limiter.share() == 1.0, restarts, "{limit:?} {power_w:?}");
                // A reading of the time before does not count.
                follow(&mut limiter, 1, limit, power_w);
                assert_eq!(limiter.share() > 0.8, restarts, "{limit:?} {power_w:?}");
            }
        }
    }

    #[test]
    fn the_first_tick_decides_nothing() {
        let mut limiter = PowerLimiter::default();
        assert_eq!(share_after(&mut limiter, 1, Some(2000.0)), 1.0);
        let limited = share_after(&mut limiter, 1, Some(40.0));
        assert!((limited - (1.0 - 1.0 / 21.0)).abs() < 1e-5, "{limited}");
    }

    #[test]
    fn the_strictest_pack_counts() {
        let mut limiter = limiter();
        let ninth = |limiter: &mut PowerLimiter, limit, power_w| {
            limiter.follow(Pack::Ninth, TICK_S, limit, Some(power_w));
            limiter.share()
        };
        ninth(&mut limiter, LIMIT, 0.0);
        let first = share_after(&mut limiter, 1, Some(30.0));
        let strictest = ninth(&mut limiter, LIMIT, 100.0);
        assert!(strictest < first);
        assert_eq!(share_after(&mut limiter, 1, Some(0.0)), strictest);
        // Without a limit it is as if it never had one.
        assert!(ninth(&mut limiter, None, 100.0) > strictest);
    }

    #[test]
    // Requirement: AP-28
    fn a_limit_is_announced_after_two_seconds_and_its_end_after_ten() {
        let mut limiter = limiter();
        // A peak: below 0.9 for less.
        assert_eq!(follow(&mut limiter, 10, LIMIT, Some(30.0)), []);
        assert!(limiter.share() < ANNOUNCED_SHARE);
        assert_eq!(follow(&mut limiter, 100, LIMIT, Some(0.0)), []);
        assert_eq!(limiter.limits_to_w(Pack::First), None);
        // 0.9 is passed in the fifth tick.
        assert_eq!(follow(&mut limiter, 100, LIMIT, Some(30.0)), [24]);
        assert_eq!(limiter.limits_to_w(Pack::First), Some(20));
        assert_eq!(limiter.limits_to_w(Pack::Second), None);
        // Full for less than ten seconds.
        assert_eq!(follow(&mut limiter, 100, LIMIT, Some(0.0)), []);
        assert_eq!(follow(&mut limiter, 1, LIMIT, Some(30.0)), []);
        assert_eq!(limiter.limits_to_w(Pack::First), Some(20));
        // Full in the first tick again.
        assert_eq!(follow(&mut limiter, 200, LIMIT, Some(0.0)), [100]);
        assert_eq!(limiter.limits_to_w(Pack::First), None);
        assert_eq!(
            follow(&mut limiter, 100, LIMIT, Some(30.0)),
            [24],
            "it begins again"
        );
    }

    #[test]
    fn a_limit_that_is_removed_ends_after_ten_seconds_and_an_unknown_power_ends_none() {
        let mut limiter = limiter();
        follow(&mut limiter, 100, LIMIT, Some(40.0));
        assert_eq!(follow(&mut limiter, 1000, LIMIT, None), []);
        assert_eq!(follow(&mut limiter, 50, None, None), []);
        assert_eq!(limiter.limits_to_w(Pack::First), None, "for who asks meanwhile");
        assert_eq!(follow(&mut limiter, 100, None, None), [50]);
    }
}
