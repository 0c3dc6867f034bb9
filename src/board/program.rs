//! The program in flash.
#![expect(
    unsafe_code,
    reason = "the program reads itself at the addresses the linker gave it"
)]

use core::{ptr, slice};

use super::memory_map::program_image;

/// The parts of the program that runs, as they are in flash.
pub fn program() -> [&'static [u32]; 3] {
    program_image().map(|part| {
        let words = part.len() / size_of::<u32>();
        // SAFETY: all of it is in flash, which can be read whenever code runs, and nothing writes to this part of it. The
        // linker aligns each part to words.
        unsafe { slice::from_raw_parts(ptr::with_exposed_provenance(part.start as usize), words) }
    })
}
