//! The radio of a Pico W is restarted again and again, at random phases of the transfers on its bus, and comes up each time.

use std::net::Ipv4Addr;

use super::progress::Progress;
use crate::bench::{Bench, DIVIDER_CODE, SECOND, TestedVehicle};
use emulator::air::hostile::{Hostile, Hostility, Target};
use emulator::air::space::Air;
use emulator::{RadioFault, Random};
use support::requests::param_set;

const BOARD: Ipv4Addr = Ipv4Addr::new(192, 168, 4, 1);

/// Keeps the bus busy.
const FRAMES_PER_SECOND: u64 = 1_000;

/// From power-up until the network is there, at most.
const UP_WITHIN_US: u64 = 2 * SECOND;

/// A changed channel takes effect after a second, and the start as long as the first one.
const CHANGED_WITHIN_US: u64 = 4 * SECOND;

/// A start that fails takes 3 s, and the radio is off for 10 s then.
const RETRIED_WITHIN_US: u64 = 16 * SECOND;

/// The setting is sent up to this long after the network is up.
const LONGEST_DELAY_US: usize = 20_000;

/// Of this many restarts one is of a start that has failed; of fewer in all, the last.
const FAILED_STARTS: u32 = 12;

/// Sets the channel this many times while frames come without a pause; some starts fail on the way. Panics if the radio does not
/// come up on each channel in time, or the board restarts.
pub fn run(restarts: u32, seed: u64) {
    let mut bench = Bench::power_up(DIVIDER_CODE);
    bench.attach_wifi();
    let mut air = Air::new(seed);
    let mut random = Random::new(seed);
    wait_for_channel(&mut bench, &mut air, 6, UP_WITHIN_US);
    let target = Target::new(bench.wifi().mac(), BOARD);
    let strangers = Hostile::of_kinds(seed, target, &[Hostility::Datagram, Hostility::Broadcast]);
    air.flood(strangers, FRAMES_PER_SECOND, bench.time_us());
    let mut progress = Progress::new("radio restarts", bench.time_us());
    let failed_starts = FAILED_STARTS.min(restarts);
    for number in 0..restarts {
        let channel = if number % 2 == 0 { 1 } else { 11 };
        air.run_for(&mut bench, random.below(LONGEST_DELAY_US) as u64);
        bench.send(&param_set("WIFI_CHANNEL", f32::from(channel)));
        let within_us = if number % failed_starts == failed_starts - 1 {
            fail_a_start(&mut bench, &mut air);
            RETRIED_WITHIN_US
        } else {
            CHANGED_WITHIN_US
        };
        wait_for_channel(&mut bench, &mut air, channel, within_us);
        assert!(
            bench.resets().is_empty(),
            "restart {number}: {:?}",
            bench.resets()
        );
        bench.forget_sent();
        progress.at(bench.time_us());
    }
}

fn wait_for_channel(bench: &mut Bench, air: &mut Air, channel: u8, within_us: u64) {
    let is_up = air.run_until(bench, within_us, |_, board| {
        let access_point = board.wifi().access_point();
        access_point.is_some_and(|access_point| access_point.channel == channel)
    });
    assert!(is_up, "channel {channel}: {:?}", bench.log_lines());
}

/// The next start waits for a program with flipped bits, and is dropped while it asks for it.
fn fail_a_start(bench: &mut Bench, air: &mut Air) {
    bench
        .wifi()
        .set_fault(Some(RadioFault::FlippedBits { one_in: 100 }));
    let is_refused = air.run_until(bench, CHANGED_WITHIN_US, |_, board| {
        board.wifi().refused_download()
    });
    assert!(is_refused, "{:?}", bench.log_lines());
    bench.wifi().set_fault(None);
}
