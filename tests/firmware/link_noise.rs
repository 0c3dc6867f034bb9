//! A line full of garbage, with requests in it.

use crate::bench::{Bench, SECOND};
use crate::emulator::Random;
use crate::soak::hostile::hostile;
use crate::support::frames::{Frame, PARAM_VALUE, ParamValue, SYS_STATUS, SysStatus, of_message};
use crate::support::requests::param_set;

const MINUTES: u64 = 10;
const LINE_BYTES_PER_SECOND: usize = 11_520;
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

fn answers(bench: &mut Bench, since_us: u64) -> Vec<Frame> {
    bench
        .frames()
        .into_iter()
        .filter(|frame| frame.at_us > since_us)
        .collect()
}

#[test]
fn ten_minutes_of_garbage_at_line_rate_lose_no_tick_and_no_request() {
    let mut bench = Bench::power_up(2482);
    let mut random = Random::new(0x5eed);
    bench.run_for(SECOND);
    let (mut conversions, mut repeated) = (0, 0);
    bench.take_adc_record();
    for number in 0..MINUTES * 60 {
        // Values of their own, so that each is written to flash and each answer is known.
        let value = number as f32 * 0.001;
        let request = param_set("BATT_VLT_OFFSET", value);
        let answered = (0..TRIES).any(|attempt| {
            repeated += usize::from(attempt > 0);
            let from_us = bench.time_us();
            let noise = second_of_noise(&mut random, &request);
            bench.uart_send(0, from_us, &noise);
            bench.run_for(SECOND);
            conversions += bench.take_adc_record().len();
            let frames = answers(&mut bench, from_us);
            of_message(&frames, PARAM_VALUE)
                .iter()
                .any(|frame| ParamValue(frame).value() == value)
        });
        assert!(answered, "request {number} was not answered");
    }
    assert!(bench.resets().is_empty(), "{:?}", bench.resets());
    let seconds = MINUTES as usize * 60 + repeated;
    assert_eq!(conversions, seconds * 10 * 16, "sampling ticks were missed");

    let frames = bench.frames();
    let sys_status = of_message(&frames, SYS_STATUS);
    let errors = SysStatus(sys_status[sys_status.len() - 1]).0.u16(20);
    let (overruns, load) = (
        bench.uart(0).overruns(),
        SysStatus(sys_status[sys_status.len() - 1]).load_permille(),
    );
    println!(
        "{seconds} s of garbage: {repeated} requests repeated, {errors} errors reported, {overruns} bytes overrun, \
         {} flash operations, load {load} permille",
        bench.flash_operations().len()
    );
    assert_eq!(errors, u16::MAX, "errors are counted");
}
