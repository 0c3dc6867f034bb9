//! AUTOPILOT_VERSION (148), PROTOCOL_VERSION (300) and AVAILABLE_MODES (435): who we are.

use crate::mavlink::dialect::{
    AUTOPILOT_VERSION_DATA, AVAILABLE_MODES_DATA, MavModeProperty, MavProtocolCapability, MavStandardMode,
    PROTOCOL_VERSION_DATA,
};
use crate::memory::identity::{BoardId, FirmwareHash, Identity};
use crate::vehicle::Mode;

/// The ArduPilot release whose parameter names and meanings are kept, by which ground stations choose descriptions: 4.6.0, of type 0,
/// a development version.
const ARDUPILOT_VERSION: u32 = 4 << 24 | 6 << 16;

/// MAVLink 2, as PROTOCOL_VERSION writes it.
const MAVLINK_2: u16 = 200;
const MAVLINK_1: u16 = 100;

/// Capabilities, versions, program and board; an unknown field is 0.
pub fn build_autopilot_version(identity: Identity) -> AUTOPILOT_VERSION_DATA {
    AUTOPILOT_VERSION_DATA {
        capabilities: capabilities(),
        uid: identity.board_id.map_or(0, BoardId::number),
        uid2: [0; 18],
        // Kinds of boards and makers are not distinguished yet.
        vendor_id: 0,
        product_id: 0,
        board_version: 0,
        flight_sw_version: ARDUPILOT_VERSION,
        middleware_sw_version: own_version(),
        os_sw_version: 0,
        flight_custom_version: identity.firmware_hash.map_or([0; 8], FirmwareHash::digits),
        middleware_custom_version: [0; 8],
        os_custom_version: [0; 8],
    }
}

/// Parameters are floats, whole numbers cast; the older flag for it is set for ground stations that know no other.
fn capabilities() -> MavProtocolCapability {
    MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
        | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
        | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_FTP
        | MavProtocolCapability::MAV_PROTOCOL_CAPABILITY_MAVLINK2
}

/// The package's version: major, minor, patch and release type, a byte each. Type 0 is a development version.
fn own_version() -> u32 {
    let number = |text: &str| {
        text.bytes()
            .fold(0, |n: u32, digit| n * 10 + u32::from(digit.saturating_sub(b'0')))
    };
    number(env!("CARGO_PKG_VERSION_MAJOR")) << 24
        | number(env!("CARGO_PKG_VERSION_MINOR")) << 16
        | number(env!("CARGO_PKG_VERSION_PATCH")) << 8
}

/// One of the modes that can be set; [`Mode::ALL`] are all of them.
pub fn build_available_mode(mode: Mode) -> AVAILABLE_MODES_DATA {
    AVAILABLE_MODES_DATA {
        custom_mode: mode.number(),
        properties: MavModeProperty::empty(),
        number_modes: Mode::ALL.len() as u8,
        mode_index: 1 + Mode::ALL.iter().take_while(|one| **one != mode).count() as u8,
        standard_mode: MavStandardMode::MAV_STANDARD_MODE_NON_STANDARD,
        mode_name: mode.name().into(),
    }
}

/// MAVLink 2 is sent; 1 is understood, too.
pub fn build_protocol_version() -> PROTOCOL_VERSION_DATA {
    PROTOCOL_VERSION_DATA {
        version: MAVLINK_2,
        min_version: MAVLINK_1,
        max_version: MAVLINK_2,
        spec_version_hash: [0; 8],
        library_version_hash: [0; 8],
    }
}
