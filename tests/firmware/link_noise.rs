//! A line full of garbage, with requests in it.

use crate::bench::MINUTE;
use crate::runs::line_noise;

#[test]
fn two_minutes_of_garbage_at_line_rate_lose_no_tick_and_no_request() {
    line_noise::run(2 * MINUTE);
}
