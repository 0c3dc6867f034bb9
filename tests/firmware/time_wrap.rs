//! The microsecond counter passes 2^32 µs (71.6 minutes after the start) and 2^32 ms (49.7 days): nothing happens.

use crate::bench::{Bench, MILLISECOND, SECOND};
use crate::emulator::{AdcInput, LogLevel};
use crate::motor_poles::motors;
use crate::rover::{
    CUSTOM_MODE_ENABLED, FLAT_3S, GOOD_3S, MANUAL, VEHICLE_ID, drive_for, is_braking, is_coasting,
};
use crate::support::frames::{TIMESYNC, assert_no_sequence_gap, of_message};
use crate::support::requests::{arm, set_mode, timesync};
use crate::telemetry::{assert_exact_rates, assert_sampled_at_every_tick};

/// Counts of the timer at which a number of 32 bits begins anew.
const WRAPS_US: [u64; 2] = [1 << 32, (1 << 32) * MILLISECOND];

/// A task that has not been seen yet counts as seen at 0, which was long ago on a board whose counter did not start there. The
/// last one is seen after a second; until then the watchdog is fed from outside.
const ALL_SEEN_US: u64 = 1_200 * MILLISECOND;
const FEED_INTERVAL_US: u64 = 100 * MILLISECOND;
const WATCHDOG_LOAD: u32 = 0x4005_8004;
/// Its second, counted down twice a microsecond (RP2040-E1).
const FULL_LOAD: u32 = 2_000_000;

/// Of the watchdog's second, this much has to be left whenever it is fed.
const SLACK_US: u64 = 850 * MILLISECOND;

/// A board that is close to a wrap.
struct Old {
    bench: Bench,
    /// When it comes, by the emulator's clock.
    wrap_us: u64,
    /// The board's clock is ahead of the emulator's by this.
    ahead_us: u64,
}

impl Old {
    /// A board whose counter started `before_us` before `wrap_us`.
    fn power_up(code: u16, wrap_us: u64, before_us: u64) -> Self {
        let mut bench = Bench::power_up(code);
        let started = bench.run_until(SECOND, |board| !board.log_lines().is_empty());
        assert!(started, "no banner");
        // Nobody has asked it yet.
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
        let told_us = self.ask_time_us();
        assert!(
            (asked_us..asked_us + 100 * MILLISECOND).contains(&told_us),
            "{told_us} us, asked at {asked_us} us"
        );
    }

    /// Panics if anything happened that a sound firmware does not see.
    fn assert_untroubled(&self) {
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

    /// An armed rover with a pack of three cells, ready to be driven.
    fn armed(wrap_us: u64, before_us: u64) -> Self {
        let mut old = Self::power_up(GOOD_3S, wrap_us, before_us);
        for (name, value) in [
            ("BATT_CELLS", 3.0),
            ("BATT_LOW_VOLT", 10.2),
            ("BATT_LOW_TIMER", 10.0),
            ("BATT_FS_LOW_ACT", 2.0),
        ] {
            old.bench.set(name, value);
        }
        old.bench.ask(&arm());
        old.bench.ask(&set_mode(VEHICLE_ID, CUSTOM_MODE_ENABLED, MANUAL));
        old
    }

    fn turns(&self) -> bool {
        motors().all(|motor| {
            let (positive, negative) = motor.duties(&self.bench);
            positive > 0.4 && negative == 0.0
        })
    }

    fn brakes(&self) -> bool {
        is_braking(&self.bench)
    }

    /// Drives at half power until `time_us`.
    fn drive_until(&mut self, time_us: u64) {
        let rest_us = time_us - self.bench.time_us();
        drive_for(&mut self.bench, rest_us, 500);
        self.bench.run_until_time(time_us);
    }
}

#[test]
fn ten_minutes_across_a_wrap_keep_every_rate_and_miss_no_tick() {
    for wrap_us in WRAPS_US {
        println!("2^32 {}", if wrap_us == 1 << 32 { "us" } else { "ms" });
        let mut old = Old::power_up(2482, wrap_us, 300 * SECOND);
        // Between two ticks.
        old.bench.run_until_time(1_350 * MILLISECOND);
        old.bench.take_adc_record();
        let from_us = old.bench.time_us();
        let mut conversions = Vec::new();
        for second in 0..600 {
            if second % 60 == 0 {
                old.assert_time();
            }
            old.bench.run_until_time(from_us + (second + 1) * SECOND);
            conversions.extend(old.bench.take_adc_record());
        }
        assert!(old.bench.time_us() > old.wrap_us + 290 * SECOND);
        old.assert_untroubled();
        let frames = old.bench.frames_since(from_us);
        assert_no_sequence_gap(&frames);
        assert_exact_rates(&frames, 600);
        assert_sampled_at_every_tick(&conversions, 6000);
        assert!(old.bench.flash_operations().is_empty(), "nobody has set anything");
    }
}

#[test]
fn a_driver_is_obeyed_across_a_wrap_and_missed_behind_it() {
    for wrap_us in WRAPS_US {
        let mut old = Old::armed(wrap_us, 15 * SECOND);
        let wrap_us = old.wrap_us;
        old.drive_until(wrap_us - SECOND);
        assert!(old.turns(), "before");
        old.drive_until(wrap_us + 5 * SECOND);
        assert!(old.turns(), "behind");
        old.bench.run_for(1_300 * MILLISECOND);
        assert!(old.turns(), "the time of FS_TIMEOUT is not over");
        old.bench.run_for(400 * MILLISECOND);
        assert!(old.brakes());
        old.assert_untroubled();
    }
}

#[test]
fn a_driver_who_falls_silent_just_before_a_wrap_is_missed_in_time() {
    for wrap_us in WRAPS_US {
        let mut old = Old::armed(wrap_us, 15 * SECOND);
        let wrap_us = old.wrap_us;
        old.drive_until(wrap_us - 700 * MILLISECOND);
        old.bench.run_until_time(wrap_us + 600 * MILLISECOND);
        assert!(old.turns(), "the time of FS_TIMEOUT is not over");
        old.bench.run_until_time(wrap_us + 900 * MILLISECOND);
        assert!(old.brakes());
    }
}

#[test]
fn a_low_voltage_that_spans_a_wrap_counts_after_its_time() {
    for wrap_us in WRAPS_US {
        let mut old = Old::armed(wrap_us, 15 * SECOND);
        let wrap_us = old.wrap_us;
        old.drive_until(wrap_us - 5 * SECOND);
        let fallen_us = old.bench.time_us();
        old.bench.adc_input(crate::bench::PACK, AdcInput::Code(FLAT_3S));
        old.drive_until(wrap_us + 6 * SECOND);
        let low_us = old.bench.logged(LogLevel::Info, "is low")[0].0;
        println!("low after {} ms", (low_us - fallen_us) / MILLISECOND);
        // Up to a tick until it is measured, and the tick that finds that the time is over.
        assert!((10_000..=10_200).contains(&((low_us - fallen_us) / MILLISECOND)));
        assert!(old.brakes(), "it holds");
        assert!(!is_coasting(&old.bench));
        old.assert_untroubled();
    }
}
