//! A line full of garbage, with requests in it.

use workbench::bench::MINUTE;
use workbench::runs::line_noise;

#[test]
fn half_a_minute_of_garbage_at_line_rate_loses_no_tick_and_no_request() {
    line_noise::run(MINUTE / 2);
}
