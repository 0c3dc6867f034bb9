//! The checks, a row each. They judge evidence, and do nothing else.

mod board;
mod check;
mod faults;
mod sensing;
mod telemetry;
mod trials;

pub use check::{Check, Outcome};

use super::evidence::Evidence;

/// Every check, in the order of the report; the connection is the first.
pub const CHECKS: [Check; 29] = [
    board::CONNECTION,
    board::ONE_BOARD,
    board::IDENTITY,
    board::VERSION,
    board::HASH_CHECK,
    board::SERIAL_NUMBER,
    telemetry::RATES,
    telemetry::JITTER,
    telemetry::LOST_FRAMES,
    telemetry::DAMAGED_FRAMES,
    telemetry::ROUND_TRIPS,
    trials::PARAMETER_LIST,
    trials::PARAMETER_KEPT,
    faults::RESTARTS,
    faults::ANNOUNCEMENTS,
    faults::BOARD_ERRORS,
    faults::LOAD,
    sensing::SENSORS,
    sensing::VOLTAGE,
    sensing::MOTOR_DRIVERS,
    sensing::VOLTAGE_NOISE,
    sensing::CALIBRATION,
    trials::CRASH_RECORD,
    trials::LEFT_AHEAD,
    trials::RIGHT_AHEAD,
    trials::LEFT_BACK,
    trials::RIGHT_BACK,
    trials::VOLTAGE_UNDER_LOAD,
    trials::CURRENT_UNDER_LOAD,
];

/// The outcome of each check. Without a board nothing but the connection is measured.
pub(super) fn judge_all(evidence: &Evidence) -> Vec<(&'static Check, Outcome)> {
    let judged = CHECKS
        .iter()
        .zip(0..)
        .map(|(check, place)| match (evidence.board, place) {
            (Some(_), _) | (None, 0) => (check, (check.judge)(evidence)),
            (None, _) => (check, check::not_reached()),
        });
    judged.collect()
}
