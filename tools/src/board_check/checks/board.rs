//! Which board it is, and whether it stays connected.

use rover_battmon::mavlink::dialect::{HEARTBEAT_DATA, MavAutopilot, MavMessage, MavType};
use rover_battmon::mavlink::{COMPONENT_ID, build_autopilot_version};
use rover_battmon::memory::identity::{FirmwareHash, Identity};

use super::check::{Check, Outcome, failed, not_measured, not_reached, outcome, passed};
use crate::board_check::evidence::{Evidence, Interruption};

/// Is there a board, and does it stay?
pub(super) const CONNECTION: Check = Check {
    name: "connection",
    measures: "whether a heartbeat comes, and the port stays",
    expected: "a heartbeat within 5 s (HEARTBEAT comes every second), no loss of the port",
    advice: "Check the cable, the port's name and permission, and `--baud` against `SERIAL0_BAUD`; close other programs \
             that use the port.",
    judge: judge_connection,
};

fn judge_connection(evidence: &Evidence) -> Outcome {
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

/// Is it alone on the link?
pub(super) const ONE_BOARD: Check = Check {
    name: "one board",
    measures: "autopilots on the link, by their heartbeats",
    expected: "one: the answers of two mix",
    advice: "Take the other one off the link, or give it another network.",
    judge: judge_one_board,
};

fn judge_one_board(evidence: &Evidence) -> Outcome {
    let others: Vec<_> = evidence.record.others.iter().map(|ids| name_of(*ids)).collect();
    let board = name_of(evidence.board.unwrap_or_default());
    if others.is_empty() {
        return passed(board);
    }
    let others = others.join(", ");
    outcome(
        format!("{board}, {others}"),
        Some(format!("There is another autopilot: {others}.")),
    )
}

fn name_of((system_id, component_id): (u8, u8)) -> String {
    format!("system {system_id} component {component_id}")
}

/// Is it this firmware's kind of vehicle?
pub(super) const IDENTITY: Check = Check {
    name: "identity",
    measures: "vehicle type, autopilot and component id in HEARTBEAT",
    expected: "ground rover, ArduPilot, component 1 (ground stations choose names and parameter formats by them)",
    advice: "Is this board running rover-battmon? Flash the release file again.",
    judge: judge_identity,
};

fn judge_identity(evidence: &Evidence) -> Outcome {
    let mut heartbeats = evidence
        .record
        .received
        .iter()
        .filter_map(|received| match &received.message {
            MavMessage::HEARTBEAT(heartbeat) => Some(heartbeat),
            _ => None,
        });
    let (Some(heartbeat), Some((_, component_id))) = (heartbeats.next(), evidence.board) else {
        return not_reached();
    };
    let measured = kind_of(heartbeat, component_id);
    let is_expected = |heartbeat: &HEARTBEAT_DATA| {
        heartbeat.mavtype == MavType::MAV_TYPE_GROUND_ROVER
            && heartbeat.autopilot == MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA
    };
    if component_id != COMPONENT_ID {
        return failed(measured, format!("It sends as component {component_id}."));
    }
    let is_rover = is_expected(heartbeat) && heartbeats.all(is_expected);
    outcome(measured, (!is_rover).then_some("It is another kind of vehicle."))
}

fn kind_of(heartbeat: &HEARTBEAT_DATA, component_id: u8) -> String {
    let (kind, autopilot) = (heartbeat.mavtype, heartbeat.autopilot);
    format!("{kind:?}, {autopilot:?}, component {component_id}")
}

/// Which firmware is it?
pub(super) const VERSION: Check = Check {
    name: "version",
    measures: "`middleware_sw_version` in AUTOPILOT_VERSION",
    expected: concat!(env!("CARGO_PKG_VERSION"), ", as this program's"),
    advice: "Flash the release that this program belongs to.",
    judge: judge_version,
};

/// Mark of a simulator.
const NO_HASH: [u8; FirmwareHash::DIGITS] = [0; _];

pub(super) const HASH_CHECK: Check = Check {
    name: "firmware hash",
    measures: "`flight_custom_version` in AUTOPILOT_VERSION",
    expected: "the hash of the file given by `--firmware`",
    advice: "Flash the UF2 file that belongs to this ELF file.",
    judge: judge_hash,
};

fn judge_version(evidence: &Evidence) -> Outcome {
    let Some(version) = &evidence.version else {
        return failed("no answer", "The board does not answer which version it runs.");
    };
    let [major, minor, patch, _] = version.middleware_sw_version.to_be_bytes();
    let differs =
        version.middleware_sw_version != build_autopilot_version(Identity::default()).middleware_sw_version;
    outcome(
        format!("{major}.{minor}.{patch}"),
        differs.then_some("Board and program are of different versions."),
    )
}

fn judge_hash(evidence: &Evidence) -> Outcome {
    let Some(version) = &evidence.version else {
        return not_measured("no answer");
    };
    let hash = version.flight_custom_version;
    let shown = match hash {
        NO_HASH => "none".into(),
        _ => String::from_utf8_lossy(&hash).into_owned(),
    };
    match evidence.expected_hash {
        Some(expected) => outcome(
            shown,
            (hash != expected.digits()).then_some("The board runs another build."),
        ),
        None => not_measured(format!("{shown}; not asked for: `--firmware`")),
    }
}

/// Which board is it?
pub(super) const SERIAL_NUMBER: Check = Check {
    name: "serial number",
    measures: "`uid`, vendor and product in AUTOPILOT_VERSION",
    expected: "a number, if the firmware sends one",
    advice: "Nothing: it only names the board.",
    judge: judge_serial_number,
};

fn judge_serial_number(evidence: &Evidence) -> Outcome {
    match &evidence.version {
        None => not_measured("no answer"),
        Some(version) if version.uid == 0 => not_measured("the firmware sends none"),
        Some(version) => passed(format!(
            "{:016x}, {:04x}:{:04x}",
            version.uid, version.vendor_id, version.product_id
        )),
    }
}
