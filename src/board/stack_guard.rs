//! Makes certain that a stack which leaves RAM downwards faults.
#![expect(unsafe_code, reason = "the MPU decides which memory can be accessed")]

use cortex_m::asm;
use cortex_m::peripheral::MPU;

use super::memory_map::stack;

/// Larger than any function's part of the stack, so that none reaches over it.
const GUARD_BYTES: u32 = 64 * 1024;

/// Bits of MPU_RBAR, MPU_RASR and MPU_CTRL (ARMv6-M B3.5).
const REGION_IS_GIVEN: u32 = 1 << 4;
const REGION_ENABLE: u32 = 1;
const REGION_SIZE: u32 = (GUARD_BYTES.ilog2() - 1) << 1;
const NO_EXECUTION: u32 = 1 << 28;
const ENABLE: u32 = 1;
const DEFAULT_MAP: u32 = 1 << 2;

/// Has every access to the 64 KiB below the stack fault. They are between the registers of the flash interface and RAM,
/// and the datasheet does not say whether an access there ends in a bus error (RP2040 2.2, 2.6.3).
pub fn guard_stack() {
    // SAFETY: the register block is the MPU's, and nothing else uses it.
    let mpu = unsafe { &*MPU::PTR };
    // SAFETY: nothing is at these addresses, so no sound access is refused; all others are as without the MPU.
    unsafe {
        mpu.rbar
            .write(stack().start.wrapping_sub(GUARD_BYTES) | REGION_IS_GIVEN);
        // No permissions.
        mpu.rasr.write(REGION_ENABLE | REGION_SIZE | NO_EXECUTION);
        mpu.ctrl.write(ENABLE | DEFAULT_MAP);
    }
    asm::dsb();
    asm::isb();
}
