//! Dates of logs.

use support::requests::{GCS, arm_by_force, disarm, heartbeat, system_time};
use workbench::bench::{Bench, DIVIDER_CODE, SECOND};
use workbench::downloads::{dates, download, list};
use workbench::log_records::{named, records_of_torn};

/// 2026-11-25 20:43:16.5.
const UNIX_US: u64 = 1_795_639_396_500_000;

#[test]
fn a_log_has_the_date_that_is_given_while_it_is_recorded_also_after_a_power_cycle() {
    let mut bench = Bench::running(DIVIDER_CODE);
    bench.ask(&arm_by_force());
    let armed_us = bench.time_us();
    bench.run_for(3 * SECOND);
    bench.request(&[heartbeat(GCS), system_time(UNIX_US)].concat());
    let heard_us = bench.time_us();
    bench.run_for(SECOND);
    bench.ask(&disarm());
    bench.run_for(SECOND);

    let file = list(&mut bench)[0];
    let began_s = (UNIX_US - (heard_us - armed_us)) / SECOND;
    let listed = dates(&mut bench);
    assert!(
        listed.len() == 1 && u64::from(listed[0]).abs_diff(began_s) <= 1,
        "{listed:?}"
    );

    let records = records_of_torn(&download(&mut bench, file));
    let times: Vec<_> = named(&records, "GPS").collect();
    assert_eq!(times.len(), 1);
    // By GPS time: since 1980, 18 s ahead.
    let number = |field| times[0].get_i64(field).expect(field) as u64;
    let utc_ms = number("GWk") * 604_800_000 + number("GMS") + 315_964_800_000 - 18_000;
    assert!(utc_ms.abs_diff(UNIX_US / 1000) < 200, "{utc_ms}");

    bench.power_cycle();
    bench.run_for(2 * SECOND);
    assert_eq!(dates(&mut bench), listed);
}
