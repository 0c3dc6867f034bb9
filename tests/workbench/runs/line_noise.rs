//! A line full of garbage, with requests in it.

use super::progress::Progress;
use super::soak::hostile::hostile;
use crate::bench::{Bench, DIVIDER_CODE, SECOND};
use emulator::Random;
use support::frames::{PARAM_VALUE, ParamValue, SYS_STATUS, SysStatus, of_message};
use support::requests::param_set;

const LINE_BYTES_PER_SECOND: usize = 11_520;
/// The garbage holds at least this many; the reported count saturates at 65535.
const ERRORS_PER_SECOND: u16 = 500;
/// A response that has not come after this long is asked for again.
const TRIES: usize = 2;

/// A second of line time with `request` somewhere in it.
fn second_of_noise(random: &mut Random, request: &[u8]) -> Vec<u8> {
    let mut noise = Vec::new();
    let request_at = random.below(LINE_BYTES_PER_SECOND / 2);
    let mut requested = false;
    while noise.len() < LINE_BYTES_PER_SECOND - 400 {
        if !requested && noise.len() >= request_at {
            noise.extend(request);
            requested = true;
        }
        noise.extend(hostile(random));
    }
    noise.resize(LINE_BYTES_PER_SECOND, 0);
    noise
}

/// Loses no tick and no request in garbage at line rate.
pub fn run(length_us: u64) {
    let requests = length_us / SECOND;
    let mut bench = Bench::power_up(DIVIDER_CODE);
    let mut random = Random::new(0x5eed);
    bench.run_for(SECOND);
    let (mut ticks, mut repeated) = (0, 0);
    bench.take_ticks();
    let mut progress = Progress::new("garbage at line rate", bench.time_us());
    for number in 0..requests {
        // Values of their own, so that each is written to flash and each answer is known.
        let value = number as f32 * 0.001;
        let request = param_set("BATT_VLT_OFFSET", value);
        let answered = (0..TRIES).any(|attempt| {
            repeated += usize::from(attempt > 0);
            let from_us = bench.time_us();
            let noise = second_of_noise(&mut random, &request);
            bench.uart_send(0, from_us, &noise);
            bench.run_for(SECOND);
            ticks += bench.take_ticks().len();
            let mut frames = bench.frames();
            frames.retain(|frame| frame.at_us > from_us);
            let mut values = of_message(&frames, PARAM_VALUE).into_iter().map(ParamValue);
            values.any(|answer| answer.value() == value)
        });
        assert!(answered, "request {number} was not answered");
        progress.at(bench.time_us());
    }
    assert!(bench.resets().is_empty(), "{:?}", bench.resets());
    let seconds = requests as usize + repeated;
    assert_eq!(ticks, seconds * 10, "sampling ticks were missed");

    let frames = bench.frames();
    let status = SysStatus(of_message(&frames, SYS_STATUS).pop().expect("telemetry flows"));
    let (errors, load) = (status.errors_comm(), status.load_permille());
    let overruns = bench.uart(0).overruns();
    println!(
        "{seconds} s of garbage: {repeated} requests repeated, {errors} errors reported, {overruns} bytes overrun, \
         {} flash operations, load {load} permille",
        bench.flash_operations().len()
    );
    let counted = ERRORS_PER_SECOND.saturating_mul(requests as u16);
    assert!(errors >= counted, "errors are counted");
}
