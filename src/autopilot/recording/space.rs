//! How the drives share the ring.
//!
//! Half of it is kept erased for the next drive, and the oldest files go for that. A drive that was longer stays while a
//! fifth is free; so a file takes at most four fifths, which is an hour, and the log goes on at the next arming.

use crate::recorder::{LogFile, PAYLOAD_BYTES, Ring, SECTOR_BYTES};

/// How many sectors have to be erased while disarmed.
pub(super) fn erase_target(ring: &Ring) -> u32 {
    let free = ring.free_sectors();
    let half = ring.sectors() / 2;
    let is_long_drive = ring.files().first().is_some_and(|oldest| sectors(oldest) > half);
    if is_long_drive && free >= least_free(ring) {
        free
    } else {
        free.max(half)
    }
}

/// Whether the open file ends here while armed. What it is to end with still has room.
pub(super) fn is_full(ring: &Ring) -> bool {
    let most = ring.sectors().saturating_sub(least_free(ring) + 1);
    ring.room() < SECTOR_BYTES || ring.open_file().is_some_and(|file| sectors(&file) >= most)
}

/// Whether the open file is long enough for the next drive to have more room in a new one.
pub(super) fn is_long(ring: &Ring) -> bool {
    ring.open_file()
        .is_some_and(|file| sectors(&file) > least_free(ring))
}

fn least_free(ring: &Ring) -> u32 {
    ring.sectors() / 5
}

fn sectors(file: &LogFile) -> u32 {
    file.bytes.div_ceil(PAYLOAD_BYTES)
}
