//! The program in flash.
#![expect(
    unsafe_code,
    reason = "the program reads itself at the addresses the linker gave it"
)]

use core::ptr;

use super::memory_map::program_image;

/// The program that runs, as it is in flash.
pub fn program() -> impl Iterator<Item = u32> {
    let parts = program_image().into_iter();
    let addresses = parts.flat_map(|part| part.step_by(size_of::<u32>()));
    addresses.map(|address| {
        // SAFETY: all of it is in flash, which can be read whenever code runs, and nothing writes to this part of it.
        unsafe { ptr::with_exposed_provenance::<u32>(address as usize).read_volatile() }
    })
}
