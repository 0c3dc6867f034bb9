//! What this node is: the answer to `uavcan.protocol.GetNodeInfo`.

use heapless::Vec;

use super::messages::{NodeStatus, UNIQUE_ID_BYTES};
use crate::identity::FirmwareHash;

/// As the names of other nodes, a reversed domain.
const NAME: &[u8] = b"org.rover-battmon";

/// Status, version of the program, version of the board with its unique id and without a certificate, name.
const BYTES: usize = NodeStatus::BYTES + 15 + 2 + UNIQUE_ID_BYTES + 1 + NAME.len();

/// The version's `optional_field_flags`: the program's hash is known.
const HAS_IMAGE_CRC: u8 = 2;

const MAJOR: u8 = number(env!("CARGO_PKG_VERSION_MAJOR"));
const MINOR: u8 = number(env!("CARGO_PKG_VERSION_MINOR"));

const fn number(digits: &str) -> u8 {
    match u8::from_str_radix(digits, 10) {
        Ok(number) => number,
        Err(_) => panic!("a version is a number below 256"),
    }
}

/// What this node is.
#[derive(Debug)]
pub(super) struct NodeInfo {
    pub uptime_s: u32,
    pub unique_id: [u8; UNIQUE_ID_BYTES],
    pub firmware_hash: Option<FirmwareHash>,
}

impl NodeInfo {
    /// The payload.
    pub fn to_bytes(&self) -> Vec<u8, BYTES> {
        let flags = self.firmware_hash.map_or(0, |_| HAS_IMAGE_CRC);
        let hash = self.firmware_hash.map_or(0, FirmwareHash::number);
        let mut bytes = Vec::new();
        for part in [
            &NodeStatus::of_working_node(self.uptime_s)[..],
            &[MAJOR, MINOR, flags],
            // No commit.
            &[0; 4],
            &u64::from(hash).to_le_bytes(),
            // The board has no version.
            &[0; 2],
            &self.unique_id,
            // No certificate.
            &[0],
            NAME,
        ] {
            // They all fit.
            let _ = bytes.extend_from_slice(part);
        }
        bytes
    }
}
