//! The microsecond counter passes 2^32 µs (71.6 minutes after the start) and 2^32 ms (49.7 days): nothing happens.

use crate::rover::{GOOD_3S, drive_for, is_braking};
use crate::wheels::duties;
use support::motor_poles::motors;
use support::requests::{arm, manual_mode};
use workbench::bench::{MILLISECOND, MINUTE, SECOND, TestedVehicle};
use workbench::runs::time_wrap::{self, Old, WRAPS_US};

fn turns(old: &Old) -> bool {
    motors().all(|motor| {
        let (positive, negative) = duties(motor, &old.bench);
        positive > 0.4 && negative == 0.0
    })
}

#[test]
fn a_minute_across_a_wrap_keeps_every_rate_and_misses_no_tick() {
    time_wrap::run(MINUTE);
}

#[test]
fn a_driver_who_falls_silent_just_before_a_wrap_is_missed_in_time() {
    for wrap_us in WRAPS_US {
        let mut old = Old::power_up(GOOD_3S, wrap_us, 15 * SECOND);
        old.bench.set("BATT_CELLS", 3.0);
        old.bench.ask(&arm());
        old.bench.ask(&manual_mode());
        drive_for(&mut old.bench, SECOND / 10, 0);
        let wrap_us = old.wrap_us;
        let silent_us = wrap_us - 700 * MILLISECOND;
        let driven_us = silent_us - old.bench.time_us();
        drive_for(&mut old.bench, driven_us, 500);
        old.bench.run_until_time(silent_us);
        old.bench.run_until_time(wrap_us + 600 * MILLISECOND);
        assert!(turns(&old), "the time of FS_TIMEOUT is not over");
        old.bench.run_until_time(wrap_us + 900 * MILLISECOND);
        assert!(is_braking(&old.bench));
    }
}
