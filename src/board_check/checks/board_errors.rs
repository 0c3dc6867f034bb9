//! Does the board receive and send without errors?

use super::check::{Check, Outcome, not_measured, outcome};
use crate::board_check::evidence::Evidence;

pub(super) const CHECK: Check = Check {
    name: "board's errors",
    measures: "`errors_comm` (damaged or overrun on its way in) and `errors_count3` (dropped for lack of room) of SYS_STATUS",
    expected: "no more of them while the board was left alone",
    advice: "With one more a second and nothing wired to GP1, it is noise; else check wires and baud rate.",
    judge,
};

fn judge(evidence: &Evidence) -> Outcome {
    let mut statuses = evidence.sys_statuses();
    let Some(first) = statuses.next() else {
        return not_measured("no SYS_STATUS");
    };
    let last = statuses.last().unwrap_or(first);
    let received = last.errors_comm.saturating_sub(first.errors_comm);
    let dropped = last.errors_count3.saturating_sub(first.errors_count3);
    let measured = format!(
        "{} at first, {received} more; {dropped} messages dropped; loss {:.2} %",
        first.errors_comm,
        f32::from(last.drop_rate_comm) / 100.0
    );
    let against = if received > 0 {
        Some(format!("The board lost {received} of what it received."))
    } else {
        (dropped > 0)
            .then(|| format!("The board dropped {dropped} messages: the link is too slow for its rates."))
    };
    outcome(measured, against)
}
