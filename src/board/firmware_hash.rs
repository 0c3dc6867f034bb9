//! Which program is in flash.
#![expect(
    unsafe_code,
    reason = "the program reads itself at the addresses the linker gave it"
)]

use core::ptr;

use super::memory_map::program_image;
use crate::identity::FirmwareHash;

/// The hash of the program that runs.
pub fn firmware_hash() -> FirmwareHash {
    let addresses = program_image()
        .into_iter()
        .flat_map(|part| part.step_by(size_of::<u32>()));
    let words = addresses.map(|address| {
        // SAFETY: all of it is in flash, which can be read at any time, and nothing writes to this part of it.
        unsafe { ptr::with_exposed_provenance::<u32>(address as usize).read_volatile() }
    });
    FirmwareHash::of(words)
}
