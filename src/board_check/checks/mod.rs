//! The checks: a file and a row each. They judge evidence, and do nothing else.

mod announcements;
mod board_errors;
mod calibration;
mod check;
mod connection;
mod crash_record;
mod damaged_frames;
mod identity;
mod jitter;
mod load;
mod lost_frames;
mod motors;
mod one_board;
mod parameter_kept;
mod parameter_list;
mod rates;
mod restarts;
mod round_trips;
mod sensors;
mod serial_number;
mod streams;
mod version;
mod voltage;
mod voltage_noise;

pub use check::{Check, Outcome};

use super::evidence::Evidence;

/// Every check, in the order of the report; the connection is the first.
pub const CHECKS: [Check; 26] = [
    connection::CHECK,
    one_board::CHECK,
    identity::CHECK,
    version::CHECK,
    version::HASH_CHECK,
    serial_number::CHECK,
    rates::CHECK,
    jitter::CHECK,
    lost_frames::CHECK,
    damaged_frames::CHECK,
    round_trips::CHECK,
    parameter_list::CHECK,
    parameter_kept::CHECK,
    restarts::CHECK,
    announcements::CHECK,
    board_errors::CHECK,
    load::CHECK,
    sensors::CHECK,
    voltage::CHECK,
    voltage_noise::CHECK,
    calibration::CHECK,
    crash_record::CHECK,
    motors::LEFT_AHEAD,
    motors::RIGHT_AHEAD,
    motors::LEFT_BACK,
    motors::RIGHT_BACK,
];

/// What came of each check. Without a board nothing but the connection is measured.
pub(super) fn judge_all(evidence: &Evidence) -> Vec<(&'static Check, Outcome)> {
    let judged = CHECKS
        .iter()
        .zip(0..)
        .map(|(check, place)| match (evidence.board, place) {
            (Some(_), _) | (None, 0) => (check, check.judge(evidence)),
            (None, _) => (check, check::not_reached()),
        });
    judged.collect()
}
