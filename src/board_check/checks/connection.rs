//! Is there a board, and does it stay?

use super::check::{Check, Outcome, failed, outcome};
use crate::board_check::evidence::Evidence;
use crate::board_check::session::Interruption;

pub(super) const CHECK: Check = Check {
    name: "connection",
    measures: "whether a heartbeat comes, and the port stays",
    expected: "a heartbeat within 5 s (HEARTBEAT comes every second), no loss of the port",
    advice: "Check the cable, the port's name and permission, and `--baud` against `SERIAL0_BAUD`; close other programs \
             that use the port.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
    if evidence.board.is_none() {
        return failed("no heartbeat", "No autopilot's heartbeat was received.");
    }
    let measured = format!("{:.1} s", evidence.connected_after_us as f32 / 1e6);
    let losses = evidence.record.port_losses.len();
    if evidence.ended == Some(Interruption::Lost) {
        return failed(measured, "The port was lost and did not come back.");
    }
    let against = (losses > 0).then(|| format!("The port was lost {losses} times without a restart."));
    outcome(measured, against)
}
