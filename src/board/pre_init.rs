//! Comes before anything else, also before RAM is initialised.
#![expect(unsafe_code, reason = "Rust's statics are not valid yet")]

use core::arch::naked_asm;

/// Stops what writes into RAM by itself. After a reset of the processor alone, by a debugger, DMA goes on where the program
/// before had its rings; the start of the peripherals ends this.
///
/// The linker puts it in front of embassy-rp's `__pre_init` (build.rs).
// SAFETY: cortex-m-rt calls it once, and lets it change R0 to R3.
#[unsafe(no_mangle)]
#[unsafe(naked)]
extern "C" fn __wrap___pre_init() {
    // RESETS.RESET by the alias at which ones that are written set bits (RP2040 datasheet 2.1.2): bit 0 is the converter, bit 2
    // is DMA.
    naked_asm!(
        "ldr r0, ={set_resets}",
        "movs r1, #{converter_and_dma}",
        "str r1, [r0]",
        "ldr r0, =__real___pre_init",
        "bx r0",
        ".pool",
        set_resets = const 0x4000_e000u32,
        converter_and_dma = const 0b101,
    );
}
