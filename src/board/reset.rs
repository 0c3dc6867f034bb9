//! Why the chip started.

use embassy_rp::pac;

/// Why the chip started.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum ResetReason {
    /// Power came on, or the brown-out detector fired.
    PowerOn,
    /// The RUN pin was pulled low.
    RunPin,
    /// A debugger restarted it.
    Debugger,
    /// The watchdog was not fed in time: a task hung, or the processor locked up.
    WatchdogTimeout,
    /// The firmware asked for a reset.
    Software,
    /// None of the reset flags is set: a reset of the processor alone.
    Processor,
}

/// Why the chip started, from WATCHDOG.REASON (RP2040 datasheet, section 4.7.6) and
/// VREG_AND_CHIP_RESET.CHIP_RESET (2.12.8). The latter keeps telling of the last chip-level reset while the watchdog
/// restarts the processor, so the watchdog is asked first.
pub fn reset_reason() -> ResetReason {
    let watchdog = pac::WATCHDOG.reason().read();
    let chip = pac::VREG_AND_CHIP_RESET.chip_reset().read();
    if watchdog.force() {
        ResetReason::Software
    } else if watchdog.timer() {
        ResetReason::WatchdogTimeout
    } else if chip.had_psm_restart() {
        ResetReason::Debugger
    } else if chip.had_run() {
        ResetReason::RunPin
    } else if chip.had_por() {
        ResetReason::PowerOn
    } else {
        ResetReason::Processor
    }
}

/// Restarts the chip at once.
pub fn restart() -> ! {
    // The bit restarts everything that the watchdog may restart; which that is was set when the watchdog was started.
    pac::WATCHDOG.ctrl().modify(|control| control.set_trigger(true));
    loop {
        cortex_m::asm::nop();
    }
}
