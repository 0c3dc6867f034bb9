//! Singles are added, subtracted, multiplied and divided by the boot ROM's routines (RP2040 datasheet 2.8.3.2): in half the
//! time of the compiler's, and without any of the flash cache.
//!
//! The compiler calls these operations by the names of the ARM EABI, which are defined here. The ROM's routines round to
//! nearest as IEEE 754 requires, but take NaN for infinity and anything divided by zero for infinity. So operands that are
//! not finite, and divisors that are zero or subnormal, go to the compiler's routines. What is left of a difference: subnormal
//! operands and results (below 1.2e-38) are zeros. Comparisons and conversions stay the compiler's: the ROM's comparison
//! takes NaN for a number, and its conversion to an integer rounds down.
#![expect(
    unsafe_code,
    reason = "the compiler finds the operations by their unmangled names, and the ROM's routines are jumped to"
)]

use core::arch::naked_asm;
use core::sync::atomic::{AtomicPtr, Ordering};

use embassy_rp::rom_data::float_funcs;

/// One of the two: the ROM's, or until it is known, the compiler's.
type Routine = AtomicPtr<()>;

static ADD: Routine = AtomicPtr::new(__addsf3 as *mut ());
static SUBTRACT: Routine = AtomicPtr::new(__subsf3 as *mut ());
static MULTIPLY: Routine = AtomicPtr::new(__mulsf3 as *mut ());
static DIVIDE: Routine = AtomicPtr::new(__divsf3 as *mut ());

// SAFETY: these are the compiler's own, which takes a single as the word in a register.
unsafe extern "C" {
    fn __addsf3(a: f32, b: f32) -> f32;
    fn __subsf3(a: f32, b: f32) -> f32;
    fn __mulsf3(a: f32, b: f32) -> f32;
    fn __divsf3(a: f32, b: f32) -> f32;
}

/// Has the boot ROM's routines used from now on; they are at other addresses in each version of the ROM. Without this
/// everything works, and takes longer.
pub fn use_rom_floats() {
    ADD.store(float_funcs::fadd::ptr() as *mut (), Ordering::Relaxed);
    SUBTRACT.store(float_funcs::fsub::ptr() as *mut (), Ordering::Relaxed);
    MULTIPLY.store(float_funcs::fmul::ptr() as *mut (), Ordering::Relaxed);
    DIVIDE.store(float_funcs::fdiv::ptr() as *mut (), Ordering::Relaxed);
}

/// An operation that goes to `$routine`, or to `$compilers` if the guard jumps to `1f`.
macro_rules! operation {
    ($name:ident, $routine:ident, $compilers:ident, $($guard:literal),+) => {
        // SAFETY: the EABI's name and signature. R2 and R3 are the callee's to change; both ways end with a jump to a
        // function of the same signature, which returns to the caller.
        #[unsafe(no_mangle)]
        #[unsafe(naked)]
        extern "C" fn $name(a: f32, b: f32) -> f32 {
            naked_asm!(
                $($guard,)+
                "ldr r3, 2f",
                "ldr r3, [r3]",
                "bx r3",
                "1:",
                "ldr r3, 3f",
                "bx r3",
                ".p2align 2",
                "2: .word {routine}",
                "3: .word {compilers}",
                routine = sym $routine,
                compilers = sym $compilers,
            )
        }
    };
}

/// An operation that goes to `$routine` with finite operands.
macro_rules! operation_of_finite {
    ($name:ident, $routine:ident, $compilers:ident) => {
        operation!(
            $name,
            $routine,
            $compilers,
            // Without its sign, what is not finite is not below this.
            "movs r2, #0xff",
            "lsls r2, r2, #24",
            "lsls r3, r0, #1",
            "cmp r3, r2",
            "bhs 1f",
            "lsls r3, r1, #1",
            "cmp r3, r2",
            "bhs 1f"
        );
    };
}

operation_of_finite!(__aeabi_fadd, ADD, __addsf3);
operation_of_finite!(__aeabi_fsub, SUBTRACT, __subsf3);
operation_of_finite!(__aeabi_fmul, MULTIPLY, __mulsf3);

// The ROM's division takes the hardware divider, which an interrupt's handler must not take from under it: so handlers, too,
// divide by the compiler's routine. Nothing else in the program uses the divider.
operation!(
    __aeabi_fdiv,
    DIVIDE,
    __divsf3,
    "mrs r3, ipsr",
    "cmp r3, #0",
    "bne 1f",
    "lsls r3, r0, #1",
    "lsrs r3, r3, #24",
    "cmp r3, #0xff",
    "beq 1f",
    // The divisor's exponent: neither 0 nor the highest.
    "lsls r3, r1, #1",
    "lsrs r3, r3, #24",
    "beq 1f",
    "cmp r3, #0xff",
    "beq 1f"
);
