//! Why the chip started, and how to restart it.

use embassy_rp::{pac, rom_data};

use crate::vehicle::Restart;

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
    /// The fault handler asked for a reset: a fault or a panic.
    Fault,
    /// The firmware asked for a reset.
    Software,
    /// A reset of the processor alone, by a debugger.
    Processor,
}

/// Mark of the fault handler in scratch register 3.
const FAULT: u32 = u32::from_le_bytes(*b"FALT");

/// The program that ran before this start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Predecessor {
    /// This firmware, or another version of it.
    Firmware,
    /// Another program. The boot ROM is one: when it has flashed a UF2 file, it restarts by the watchdog's time-out.
    Other,
}

/// Why the chip started, from WATCHDOG.REASON (RP2040 datasheet, section 4.7.6) and
/// VREG_AND_CHIP_RESET.CHIP_RESET (2.12.8). The latter keeps telling of the last chip-level reset while the watchdog
/// restarts the processor, so the watchdog is asked first. A reset of the processor alone changes neither.
///
/// It has to be asked once, before any peripheral is used.
pub(super) fn take_reset_reason(predecessor: Predecessor) -> ResetReason {
    let watchdog = pac::WATCHDOG.reason().read();
    let chip = pac::VREG_AND_CHIP_RESET.chip_reset().read();
    // Every other reset puts the peripherals into reset, too, and the boot ROM leaves the PWM there.
    let is_of_the_processor = !pac::RESETS.reset().read().pwm();
    let fault = pac::WATCHDOG.scratch3().read() == FAULT;
    pac::WATCHDOG.scratch3().write_value(0);
    if is_of_the_processor {
        ResetReason::Processor
    } else if watchdog.force() && fault {
        ResetReason::Fault
    } else if watchdog.force() {
        ResetReason::Software
    } else if watchdog.timer() && predecessor == Predecessor::Firmware {
        ResetReason::WatchdogTimeout
    } else if chip.had_psm_restart() {
        ResetReason::Debugger
    } else if chip.had_run() {
        ResetReason::RunPin
    } else {
        ResetReason::PowerOn
    }
}

/// Restarts the chip at once.
pub fn restart(into: Restart) -> ! {
    match into {
        Restart::Firmware => reset(),
        // An undefined instruction: the fault handler writes the crash record and resets.
        Restart::Fault => cortex_m::asm::udf(),
        Restart::BootLoader => restart_into_boot_loader(),
    }
}

/// The boot ROM notes in the watchdog's scratch registers what to start, and resets the chip by its time-out 5 ms later:
/// the firmware's own countdown ends with that (RP2040 datasheet 2.8.3.1.5, 4.7). The pins are in their reset state from
/// then on: not driven, with a pull-down.
fn restart_into_boot_loader() -> ! {
    // No pin that shows activity, for each may lead to a motor, and both interfaces. The ROM leaves these zeros in scratch
    // registers 0 and 1, where the firmware that is flashed then finds no predecessor.
    rom_data::reset_to_usb_boot(0, 0);
    wait_for_reset()
}

/// Resets the chip at once.
fn reset() -> ! {
    // Everything but the oscillators, as embassy does when it starts the watchdog; a fault may come before that.
    pac::PSM.wdsel().write(|restarted| {
        restarted.0 = !0;
        restarted.set_rosc(false);
        restarted.set_xosc(false);
    });
    pac::WATCHDOG.ctrl().modify(|control| control.set_trigger(true));
    wait_for_reset()
}

fn wait_for_reset() -> ! {
    loop {
        cortex_m::asm::nop();
    }
}

/// Restarts the chip at once, and has the next start know that a fault is why.
pub(super) fn restart_after_fault() -> ! {
    pac::WATCHDOG.scratch3().write_value(FAULT);
    reset()
}
