//! A network full of strangers: nothing that counts waits for it, and nothing is lost.

use super::ground::{BOARD, Ground};
use crate::stack;
use emulator::LogLevel;
use emulator::air::hostile::{Hostile, Target};
use support::frames::{BATTERY_STATUS, assert_no_sequence_gap, of_message};
use workbench::bench::{MILLISECOND, SECOND};

/// Between two samplings, whatever the network does. A reading ends when it was due as long as its tick is less than 20 ms late.
pub const JITTER_US: u64 = 10 * MILLISECOND;

/// For half a minute, and for a moment.
const FRAMES_PER_SECOND: u64 = 200;
const MANY_FRAMES_PER_SECOND: u64 = 1_000;

#[test]
// Requirement: R-7
fn half_a_minute_of_hostile_frames_disturbs_nothing() {
    let mut ground = Ground::up();
    let mut station = ground.connected_station();
    ground.bench.forget_stack_use();
    ground.bench.take_ticks();
    ground.bench.forget_sent();
    let began_us = ground.bench.time_us();
    let target = Target::new(ground.bench.wifi().mac(), BOARD);
    let hostile = || Hostile::new(7, target);
    ground.air.flood(hostile(), FRAMES_PER_SECOND, began_us);
    let mut heard = ground.hear_for(&mut station, 25 * SECOND);
    let now_us = ground.bench.time_us();
    ground.air.flood(hostile(), MANY_FRAMES_PER_SECOND, now_us);
    heard.extend(ground.hear_for(&mut station, 5 * SECOND));
    let packs = of_message(&heard, BATTERY_STATUS).len();
    assert!(packs >= 58, "{packs}");

    ground.assert_not_reset();
    let frames = ground.bench.frames();
    assert_no_sequence_gap(&frames);
    assert!(of_message(&frames, BATTERY_STATUS).len() >= 59);
    println!("{} frames did not reach the chip's queue", ground.air.overrun());

    let worst_us = worst_sampling_us(&mut ground, 299);
    println!("sampling: off by {worst_us} us at most");
    assert!(worst_us <= JITTER_US, "{worst_us}");

    stack::assert_free(&mut ground.bench, "hostile frames, and a station by TCP");

    ground.air.calm();
    let heard = ground.hear_for(&mut station, 2 * SECOND);
    assert!(ground.is_connected(&station), "{:?}", ground.bench.log_lines());
    assert_eq!(of_message(&heard, BATTERY_STATUS).len(), 4);
    assert!(ground.bench.logged(LogLevel::Error, "").is_empty());
}

/// By how much an interval between two of at least so many samplings was off at most.
pub fn worst_sampling_us(ground: &mut Ground, samplings: u64) -> u64 {
    let ticks = ground.bench.take_ticks();
    assert!(ticks.len() as u64 >= samplings, "{} of {samplings}", ticks.len());
    let intervals = ticks.windows(2).map(|pair| pair[1] - pair[0]);
    let off = intervals.map(|interval| interval.abs_diff(100 * MILLISECOND));
    off.max().expect("it samples")
}
