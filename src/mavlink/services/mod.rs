//! What a ground station can ask for, one file a service.

pub(super) mod commands;
pub(super) mod context;
pub(super) mod downloads;
pub(super) mod file_transfer;
pub(super) mod log_download;
pub(super) mod mission;
pub(super) mod parameters;
pub(super) mod signing;
pub(super) mod time;
pub(super) mod vehicle;
pub(super) mod wifi;

/// Why a restart, a reset of the parameters, a signing key or a download is refused.
pub(super) const DISARM_FIRST: &str = "Not while armed: disarm first";
