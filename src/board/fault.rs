//! What is still done when the program has gone wrong.
#![expect(
    unsafe_code,
    reason = "the vector table finds the handler by its unmangled name, and whoever defines it answers for that"
)]

use cortex_m_rt::exception;

use super::motors;

/// Stops the motors' drive, and waits for the watchdog to restart the chip. Panics end here too.
///
/// A hang, and a fault within a fault (the stack ran over), don't come here: then it is the watchdog's reset that leaves
/// the motors to roll.
// SAFETY: defining this handler is unsafe because it may interrupt anything, critical sections too. It never returns, and
// touches nothing but registers.
#[exception(trampoline = false)]
unsafe fn HardFault() -> ! {
    motors::force_coast();
    loop {
        cortex_m::asm::nop();
    }
}
