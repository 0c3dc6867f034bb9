//! Crashes that follow each other quickly: the parameters may be their reason.

use emulator::LogLevel;
use support::frames::{ARMED, CRITICAL, Frame, HEARTBEAT, STATUSTEXT, of_message};
use support::requests::arm;
use workbench::bench::{Bench, MILLISECOND, SECOND, TestedVehicle};

const PACK_CODE: u16 = 2482;

const NOTICE: &str = "5 quick resets: started with default parameters";

const CHANGED: &str = "BATT_LOW_VOLT";
const VALUE: f32 = 6.5;
const DEFAULT: f32 = 0.0;

/// A program that crashes after it has run for `uptime_us`, and the frames of the first half second after that.
fn crash_after(bench: &mut Bench, uptime_us: u64) -> Vec<Frame> {
    bench.run_for(uptime_us);
    bench.reset_by(SECOND, |bench| bench.run_undefined_instruction());
    let from_us = bench.time_us();
    bench.run_for(500 * MILLISECOND);
    bench.frames_since(from_us)
}

fn reports_cause(frames: &[Frame]) -> bool {
    let texts = of_message(frames, STATUSTEXT);
    texts
        .iter()
        .any(|frame| frame.text(1, 50) == NOTICE && frame.u8(0) == CRITICAL)
}

#[test]
// Requirement: OWN-6
fn five_quick_resets_start_with_defaults_and_leave_flash_alone() {
    let mut bench = Bench::configured(PACK_CODE, &[(CHANGED, VALUE)]);
    bench.ask(&arm());
    let starts = [(); 5].map(|()| crash_after(&mut bench, 2 * SECOND));
    let frames = &starts[4];
    assert!(reports_cause(frames), "{frames:?}");
    assert_eq!(bench.logged(LogLevel::Warn, NOTICE).len(), 1);
    assert_eq!(bench.read_parameter(CHANGED), Some(DEFAULT));
    let heartbeats = of_message(frames, HEARTBEAT);
    assert!(!heartbeats.is_empty() && heartbeats.iter().all(|frame| frame.u8(6) & ARMED == 0));

    let frames = crash_after(&mut bench, 31 * SECOND);
    assert!(!reports_cause(&frames), "one after half a minute ends the row");
    assert_eq!(bench.read_parameter(CHANGED), Some(VALUE), "flash still has it");
}
