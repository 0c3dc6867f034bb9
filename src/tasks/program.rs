//! Which program runs.

use super::Shared;
use crate::log::info;
use crate::memory::identity::FirmwareHash;

/// Hashes the program, given in parts, once and beside everything else: in one go it would delay the start. `note` retains the
/// hash for the record of a crash.
pub async fn hash_program(
    program: impl IntoIterator<Item = &'static [u32]>,
    note: impl FnOnce(FirmwareHash),
    shared: &Shared,
) {
    let hash = FirmwareHash::of_slowly(program).await;
    info!("program {:08x}", hash.number());
    note(hash);
    shared.with(|autopilot| autopilot.set_firmware_hash(hash));
}
