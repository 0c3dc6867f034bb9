//! The boot ROM's USB boot loader: how a program restarts into it, and how it restarts into the firmware. USB itself is
//! not modelled.
//!
//! Both ways lead through the watchdog: it resets the chip, and the boot ROM then starts what is noted in scratch
//! registers 4 to 7 (datasheet 2.8.1.1), or else the firmware in flash.

use rp2040_emu::CortexM0Plus;
use rp2040_emu::core::CoreBus;

use super::board::Board;
use super::boot_rom::{USB_BOOT, WAIT_FOR_RESET};
use super::bus::SystemBus;

const PSM_WDSEL: u32 = 0x4001_0008;
const EVERYTHING_BUT_OSCILLATORS: u32 = 0x1_fffc;
const WATCHDOG_CTRL_SET: u32 = 0x4005_a000;
const WATCHDOG_CTRL_CLEAR: u32 = 0x4005_b000;
const WATCHDOG_LOAD: u32 = 0x4005_8004;
const WATCHDOG_SCRATCH0: u32 = 0x4005_800c;
const WATCHDOG_TICK: u32 = 0x4005_802c;
const TICK_1_US: u32 = 1 << 9 | 12;
const ENABLE: u32 = 1 << 30;
const PAUSE: u32 = 0b111 << 24;

/// Stands in scratch register 4 before what is to be started.
const BOOT_MAGIC: u32 = 0xb007_c0d3;
/// The end of RAM.
const STACK_POINTER: u32 = 0x2004_2000;

/// The counts after which it resets the chip. The ROM means milliseconds × 1000, of which RP2040-E1 makes half.
const ENTERED_AFTER: u32 = 10 * 1000;
const LEFT_AFTER: u32 = 1000 * 1000;

/// What the USB boot loader was started with: the arguments of reset_to_usb_boot (2.8.3.1.5).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BootLoader {
    /// The pin that shows activity, as a bit.
    pub gpio_activity_pin_mask: u32,
    /// Bit 0: no mass storage; bit 1: no PICOBOOT.
    pub disable_interface_mask: u32,
}

/// What the boot ROM starts instead of the firmware.
pub struct WatchdogBoot {
    pub stack_pointer: u32,
    pub entry: u32,
}

/// reset_to_usb_boot: it never returns, and lets interrupts come until the watchdog resets the chip.
pub fn reset_to_usb_boot(core: &mut CortexM0Plus, bus: &mut SystemBus) {
    write_scratch(bus, 0, core.reg(0));
    write_scratch(bus, 1, core.reg(1));
    let entry = USB_BOOT | 1;
    write_scratch(bus, 4, BOOT_MAGIC);
    write_scratch(bus, 5, entry ^ BOOT_MAGIC.wrapping_neg());
    write_scratch(bus, 6, STACK_POINTER);
    write_scratch(bus, 7, entry);
    reset_after(bus, ENTERED_AFTER);
    core.set_reg(15, WAIT_FOR_RESET);
}

/// What was noted to be started, once.
pub fn take_watchdog_boot(bus: &mut SystemBus) -> Option<WatchdogBoot> {
    let [magic, check, stack_pointer, entry] = [4, 5, 6, 7].map(|number| read_scratch(bus, number));
    if magic != BOOT_MAGIC || check != entry ^ BOOT_MAGIC.wrapping_neg() {
        return None;
    }
    write_scratch(bus, 4, 0);
    Some(WatchdogBoot { stack_pointer, entry })
}

/// Whatever the watchdog was doing before.
fn reset_after(bus: &mut SystemBus, counts: u32) {
    bus.write32(PSM_WDSEL, EVERYTHING_BUT_OSCILLATORS);
    bus.write32(WATCHDOG_CTRL_CLEAR, ENABLE | PAUSE);
    bus.write32(WATCHDOG_LOAD, counts);
    bus.write32(WATCHDOG_TICK, TICK_1_US);
    bus.write32(WATCHDOG_CTRL_SET, ENABLE);
}

fn scratch(number: u32) -> u32 {
    WATCHDOG_SCRATCH0 + 4 * number
}

fn read_scratch(bus: &mut SystemBus, number: u32) -> u32 {
    bus.read32(scratch(number))
}

fn write_scratch(bus: &mut SystemBus, number: u32, value: u32) {
    bus.write32(scratch(number), value);
}

impl Board {
    /// The boot loader, while the chip is in it.
    pub fn boot_loader(&mut self) -> Option<BootLoader> {
        (USB_BOOT..USB_BOOT + 4).contains(&self.pc()).then(|| BootLoader {
            gpio_activity_pin_mask: read_scratch(&mut self.bus, 0),
            disable_interface_mask: read_scratch(&mut self.bus, 1),
        })
    }

    /// A host has written a UF2 file, the same firmware again: the boot loader restarts into it.
    pub fn finish_boot_loader(&mut self) {
        assert!(self.boot_loader().is_some(), "the chip is not in its boot loader");
        write_scratch(&mut self.bus, 4, 0);
        reset_after(&mut self.bus, LEFT_AFTER);
        self.bus.attention = true;
    }
}
