//! The fault handler. Panics end here too, after panic-probe has logged them.
//!
//! A hang doesn't come here, and neither does a fault that can't be stacked, because the stack ran over: then it is the
//! watchdog's reset that leaves the motors to roll. A debugger that catches vectors halts before the handler's first
//! instruction: then, too.
#![expect(
    unsafe_code,
    reason = "the vector table finds the handler by its unmangled name, and its definition has to be unique"
)]

use core::ptr;

use cortex_m_rt::{ExceptionFrame, exception};

use super::memory_map::stack;
use super::{motors, reset, retained, running};
use crate::crash::{CrashCause, CrashRecord, FaultSite};

/// xPSR: a word for alignment follows the frame (ARMv6-M B1.5.7).
const PADDED: u32 = 1 << 9;

/// Lets the motors roll, writes down what happened, and restarts the chip.
// SAFETY: defining this handler is unsafe because it may interrupt anything, critical sections too. It never returns, and
// what it shares with the program is registers and atomic words.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    motors::force_coast();
    retained::write_crash(&CrashRecord {
        task: running::running_task(),
        cause: CrashCause::Fault(site(frame)),
        firmware: running::firmware(),
    });
    reset::restart_after_fault()
}

/// Site of the fault. The processor has written the frame, so it is in RAM, wherever the stack pointer has got to.
fn site(frame: &ExceptionFrame) -> FaultSite {
    let frame_end = ptr::from_ref(frame).wrapping_add(1).expose_provenance() as u32;
    let before = frame_end + if frame.xpsr() & PADDED != 0 { 4 } else { 0 };
    let mut words = on_stack(before);
    FaultSite {
        pc: frame.pc(),
        lr: frame.lr(),
        xpsr: frame.xpsr(),
        stack: [(); _].map(|()| words.next().unwrap_or(0)),
    }
}

/// The words from `address` to the bottom of the stack; none if it is not on the stack.
fn on_stack(address: u32) -> impl Iterator<Item = u32> {
    let stack = stack();
    let start = if stack.contains(&address) {
        address
    } else {
        stack.end
    };
    (start..stack.end).step_by(4).map(|address| {
        // SAFETY: the address is on the stack and, as stack pointers are, aligned. The program that wrote there has been
        // stopped.
        unsafe { ptr::with_exposed_provenance::<u32>(address as usize).read_volatile() }
    })
}
