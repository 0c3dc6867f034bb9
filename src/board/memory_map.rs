//! Where the linker has put what.
#![expect(unsafe_code, reason = "symbols of the linker are declared, and never read")]

use core::ops::Range;

unsafe extern "C" {
    static _stack_end: u32;
    static _stack_start: u32;
    static __stext: u32;
    static __etext: u32;
}

/// Where the main stack lies.
pub(super) fn stack() -> Range<u32> {
    address(&raw const _stack_end)..address(&raw const _stack_start)
}

/// Where the program lies in flash.
pub fn program_code() -> Range<u32> {
    address(&raw const __stext)..address(&raw const __etext)
}

fn address(symbol: *const u32) -> u32 {
    symbol.expose_provenance() as u32
}
