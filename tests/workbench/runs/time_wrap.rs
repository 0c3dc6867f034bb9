//! The microsecond counter passes 2^32 µs (71.6 minutes after the start) and 2^32 ms (49.7 days): nothing happens.

use super::exact_rates::{assert_exact_rates, assert_sampled_at_every_tick};
use super::progress::Progress;
use crate::bench::{Bench, DIVIDER_CODE, MILLISECOND, SECOND, TestedVehicle, is_learnt};
use emulator::LogLevel;
use support::frames::{TIMESYNC, assert_no_sequence_gap, of_message};
use support::requests::timesync;

/// Counts of the timer at which a number of 32 bits wraps.
pub const WRAPS_US: [u64; 2] = [1 << 32, (1 << 32) * MILLISECOND];

/// A task that has not been seen yet counts as seen at 0, which was long ago on a board whose counter did not start there. The
/// last one is seen after a second; until then the watchdog is fed from outside.
const ALL_SEEN_US: u64 = 1_200 * MILLISECOND;
const FEED_INTERVAL_US: u64 = 100 * MILLISECOND;
const WATCHDOG_LOAD: u32 = 0x4005_8004;
/// Its second, counted down twice a microsecond (RP2040-E1).
const FULL_LOAD: u32 = 2_000_000;

/// Of the watchdog's quarter of a second while armed, this much has to be left whenever it is fed, every 100 ms.
const SLACK_US: u64 = 140 * MILLISECOND;

/// A board that is close to a wrap.
pub struct Old {
    pub bench: Bench,
    /// When it comes, by the emulator's clock.
    pub wrap_us: u64,
    /// The board's clock is ahead of the emulator's by this.
    ahead_us: u64,
}

impl Old {
    /// A board whose counter started `before_us` before `wrap_us`.
    pub fn power_up(code: u16, wrap_us: u64, before_us: u64) -> Self {
        let mut bench = Bench::power_up(code);
        let started = bench.run_until(SECOND, |board| !board.log_lines().is_empty());
        assert!(started, "no banner");
        // No request has been sent yet.
        bench.preset_timer(wrap_us - before_us);
        let now_us = bench.time_us();
        while bench.time_us() < ALL_SEEN_US {
            bench.write_register(WATCHDOG_LOAD, FULL_LOAD);
            bench.run_for(FEED_INTERVAL_US);
        }
        Self {
            wrap_us: now_us + before_us,
            ahead_us: wrap_us - before_us - now_us,
            bench,
        }
    }

    /// What its clock says, in microseconds.
    fn ask_time_us(&mut self) -> u64 {
        let answers = self.bench.ask(&timesync(1));
        let answer = of_message(&answers, TIMESYNC)[0];
        (u64::from(answer.u32(0)) | u64::from(answer.u32(4)) << 32) / 1000
    }

    /// Panics unless its clock is right.
    fn assert_time(&mut self) {
        let asked_us = self.bench.time_us() + self.ahead_us;
        let reported_us = self.ask_time_us();
        assert!(
            (asked_us..asked_us + 100 * MILLISECOND).contains(&reported_us),
            "{reported_us} us, asked at {asked_us} us"
        );
    }

    /// Panics if anything happened that a sound firmware does not see.
    pub fn assert_untroubled(&self) {
        let warnings = self.bench.logged(LogLevel::Warn, "");
        let later: Vec<_> = warnings
            .iter()
            .filter(|(at_us, _)| *at_us > ALL_SEEN_US)
            .collect();
        assert!(later.is_empty(), "{later:?}");
        assert!(self.bench.resets().is_empty(), "{:?}", self.bench.resets());
        let slack_us = self.bench.smallest_watchdog_slack_us().expect("it was fed");
        println!("the watchdog had {} ms left at least", slack_us / MILLISECOND);
        assert!(slack_us >= SLACK_US, "{slack_us} us");
    }
}

/// Samples and reports without drift for this time, with either wrap in the middle.
pub fn run(length_us: u64) {
    WRAPS_US
        .iter()
        .for_each(|wrap_us| run_across(*wrap_us, length_us));
}

fn run_across(wrap_us: u64, length_us: u64) {
    let name = if wrap_us == WRAPS_US[0] { "us" } else { "ms" };
    let seconds = length_us / SECOND;
    let mut old = Old::power_up(DIVIDER_CODE, wrap_us, length_us / 2);
    // Between two ticks.
    old.bench.run_until_time(1_350 * MILLISECOND);
    old.bench.take_ticks();
    let from_us = old.bench.time_us();
    let mut progress = Progress::new(format!("wrap of 2^32 {name}"), from_us);
    let mut ticks = Vec::new();
    for second in 0..seconds {
        if second % 60 == 0 {
            old.assert_time();
        }
        old.bench.run_until_time(from_us + (second + 1) * SECOND);
        ticks.extend(old.bench.take_ticks());
        progress.at(old.bench.time_us());
    }
    assert!(old.bench.time_us() > old.wrap_us + length_us / 2 - 10 * SECOND);
    old.assert_untroubled();
    let frames = old.bench.frames_since(from_us);
    assert_no_sequence_gap(&frames);
    assert_exact_rates(&frames, seconds as usize);
    assert_sampled_at_every_tick(&ticks, 10 * seconds as usize);
    assert!(
        old.bench.flash_operations().iter().all(is_learnt),
        "no parameter was set"
    );
}
