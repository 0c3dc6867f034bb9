//! HEARTBEAT, SYS_STATUS, BATTERY_STATUS and the sampling of the pack, each at its rate.

use super::progress::Progress;
use crate::bench::{Bench, DIVIDER_CODE, MILLISECOND, SECOND};
use support::frames::{
    BATTERY_STATUS, BatteryStatus, Frame, HEARTBEAT, SYS_STATUS, assert_no_sequence_gap, of_message,
};

/// One count of the converter, in mV of the pack.
const COUNT_MV: f32 = 3.3 / 4095.0 * 3.95 * 1000.0;

/// Three messages fall due together and leave one after the other: 117 bytes take 10.2 ms.
const JITTER_US: u64 = 11 * MILLISECOND;

/// Panics unless something happened at the interval, each time within `jitter_us` of its due time, over the whole run.
fn assert_regular(times_us: &[u64], interval_us: u64, jitter_us: u64) {
    let off_us = |(n, at_us): (u64, &u64)| at_us.abs_diff(times_us[0] + n * interval_us);
    let worst_us = (0..).zip(times_us).map(off_us).max().expect("something happened");
    println!(
        "{} times every {} ms, at most {worst_us} us off",
        times_us.len(),
        interval_us / MILLISECOND
    );
    assert!(worst_us <= jitter_us, "{worst_us} us off: {times_us:?}");
}

/// Panics unless there were so many ticks, 100 ms apart and without drift.
pub fn assert_sampled_at_every_tick(ticks_us: &[u64], ticks: usize) {
    assert_eq!(ticks_us.len(), ticks);
    // The first one waits for a start whose code is read from flash for the first time, others for tasks' turns.
    assert_regular(ticks_us, 100 * MILLISECOND, 5 * MILLISECOND);
}

/// Panics unless `frames` hold what is sent in this many seconds, each message at its rate and without drift.
pub fn assert_exact_rates(frames: &[Frame], seconds: usize) {
    for (message, per_second) in [(HEARTBEAT, 1), (SYS_STATUS, 2), (BATTERY_STATUS, 2)] {
        let received = of_message(frames, message);
        assert_eq!(received.len(), seconds * per_second, "message {message}");
        let times_us: Vec<_> = received.iter().map(|frame| frame.at_us).collect();
        assert_regular(&times_us, SECOND / per_second as u64, JITTER_US);
    }
}

/// Samples and reports without drift for this time.
pub fn run(length_us: u64) {
    let seconds = (length_us / SECOND) as usize;
    let mut bench = Bench::power_up(DIVIDER_CODE);
    let mut progress = Progress::new("exact rates", 0);
    let mut ticks = Vec::new();
    for _ in 0..seconds {
        bench.run_for(SECOND);
        ticks.extend(bench.take_ticks());
        progress.at(bench.time_us());
    }
    bench.assert_untroubled();

    let frames = bench.frames();
    assert_no_sequence_gap(&frames);
    let battery = of_message(&frames, BATTERY_STATUS);
    assert_exact_rates(&frames, seconds);
    for frame in &battery[1..] {
        let voltage_mv = f32::from(BatteryStatus(frame).voltage_mv(0));
        assert!((voltage_mv - 7900.0).abs() <= COUNT_MV, "{voltage_mv} mV");
        assert_eq!(BatteryStatus(frame).charge_state(), 1);
        assert_eq!(frame.payload_len(), 41);
    }

    assert_sampled_at_every_tick(&ticks, 10 * seconds);
}
