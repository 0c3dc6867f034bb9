//! Addresses of the linker script.
#![expect(
    unsafe_code,
    reason = "symbols of the linker are declared, and the program reads itself at these addresses"
)]

use core::ops::Range;
use core::{ptr, slice};

use embassy_rp::flash::FLASH_BASE;

unsafe extern "C" {
    static _stack_end: u32;
    static _stack_start: u32;
    static __stext: u32;
    static __etext: u32;
    static __srodata: u32;
    static __erodata: u32;
    static __sidata: u32;
    static __sdata: u32;
    static __edata: u32;
    static __sconstants: u32;
    static __econstants: u32;
}

/// Address range of the main stack.
pub(super) fn stack() -> Range<u32> {
    address(&raw const _stack_end)..address(&raw const _stack_start)
}

/// Address range of the program's code in flash.
pub fn program_code() -> Range<u32> {
    address(&raw const __stext)..address(&raw const __etext)
}

/// Address ranges of the whole program in flash: boot loader, vectors and code; constants; initial values of variables; files
/// that are served. What is between these parts is up to the one who flashes it, or kept over an update.
pub(super) fn program_image() -> [Range<u32>; 4] {
    let values = address(&raw const __sidata);
    let value_bytes = address(&raw const __edata) - address(&raw const __sdata);
    [
        address(FLASH_BASE)..address(&raw const __etext),
        address(&raw const __srodata)..address(&raw const __erodata),
        values..values + value_bytes,
        address(&raw const __sconstants)..address(&raw const __econstants),
    ]
}

fn address(symbol: *const u32) -> u32 {
    symbol.expose_provenance() as u32
}

/// The parts of the program that runs, as they are in flash.
pub fn program() -> [&'static [u32]; 4] {
    program_image().map(|part| {
        let words = part.len() / size_of::<u32>();
        // SAFETY: all of it is in flash, which can be read whenever code runs, and nothing writes to this part of it. The
        // linker aligns each part to words.
        unsafe { slice::from_raw_parts(ptr::with_exposed_provenance(part.start as usize), words) }
    })
}
