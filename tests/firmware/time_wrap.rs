//! The microsecond counter passes 2^32 µs (71.6 minutes after the start) and 2^32 ms (49.7 days): nothing happens.

use crate::rover::{CUSTOM_MODE_ENABLED, GOOD_3S, MANUAL, VEHICLE_ID, drive_for, is_braking};
use crate::wheels::duties;
use support::motor_poles::motors;
use support::requests::{arm, set_mode};
use workbench::bench::{MILLISECOND, MINUTE, SECOND, TestedVehicle};
use workbench::runs::time_wrap::{self, Old, WRAPS_US};

/// An armed rover with a pack of three cells, ready to be driven.
fn armed(wrap_us: u64, before_us: u64) -> Old {
    let mut old = Old::power_up(GOOD_3S, wrap_us, before_us);
    old.bench.set("BATT_CELLS", 3.0);
    old.bench.ask(&arm());
    old.bench.ask(&set_mode(VEHICLE_ID, CUSTOM_MODE_ENABLED, MANUAL));
    drive_for(&mut old.bench, SECOND / 10, 0);
    old
}

fn turns(old: &Old) -> bool {
    motors().all(|motor| {
        let (positive, negative) = duties(motor, &old.bench);
        positive > 0.4 && negative == 0.0
    })
}

fn brakes(old: &Old) -> bool {
    is_braking(&old.bench)
}

/// Drives at half power until `time_us`.
fn drive_until(old: &mut Old, time_us: u64) {
    let rest_us = time_us - old.bench.time_us();
    drive_for(&mut old.bench, rest_us, 500);
    old.bench.run_until_time(time_us);
}

#[test]
fn a_minute_across_a_wrap_keeps_every_rate_and_misses_no_tick() {
    time_wrap::run(MINUTE);
}

#[test]
fn a_driver_who_falls_silent_just_before_a_wrap_is_missed_in_time() {
    for wrap_us in WRAPS_US {
        let mut old = armed(wrap_us, 15 * SECOND);
        let wrap_us = old.wrap_us;
        drive_until(&mut old, wrap_us - 700 * MILLISECOND);
        old.bench.run_until_time(wrap_us + 600 * MILLISECOND);
        assert!(turns(&old), "the time of FS_TIMEOUT is not over");
        old.bench.run_until_time(wrap_us + 900 * MILLISECOND);
        assert!(brakes(&old));
    }
}
