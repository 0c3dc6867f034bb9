//! USBCTRL: the USB device controller (datasheet 4.1), and the host at the other end of the cable.
//!
//! Modelled: SETUP, IN and OUT transactions with their handshakes and toggles, buffer controls, STALL, EP_ABORT,
//! bus reset, suspend and resume, start of frame, the interrupts of all these, and erratum RP2040-E15: after a bus error
//! during an IN transaction the controller does nothing more until RESETS has reset it, be the bus reset or not. That the
//! frame counter stands still in this state is an assumption: public reports say no more than that it answers nothing.
//! Not modelled, and a panic: host mode, double buffering, interrupts of NAK and STALL, remote wakeup. VBUS is not on a
//! pin, so a device that is unplugged sees an idle bus: suspend.

mod bus;
mod control;
mod controller;
mod host;
mod registers;
mod serial;
#[cfg(test)]
mod tests;

use super::clock::Cycle;
use super::peripheral::Peripheral;
use super::register::RegisterWrite;
pub use control::{AbortPoint, ControlRequest, Failure};
use controller::Controller;
pub use host::{Description as UsbDescription, Host as UsbHost, HostEvent};
pub use serial::Reading;

/// USBCTRL_IRQ (2.3.2).
const INTERRUPT_LINE: u32 = 5;

#[derive(Clone)]
pub struct Usb {
    controller: Controller,
    pub host: UsbHost,
}

impl Usb {
    pub fn new() -> Self {
        Self {
            controller: Controller::new(),
            host: UsbHost::default(),
        }
    }

    /// The word of the DPRAM at an offset.
    pub fn dpram_word(&self, offset: u32) -> u32 {
        self.controller.dpram_word(offset)
    }

    pub fn store_dpram(&mut self, offset: u32, value: u32, length: usize, now: Cycle) {
        self.controller.store_dpram(offset, value, length, now);
    }
}

impl Peripheral for Usb {
    fn read(&mut self, offset: u32, _now: Cycle) -> u32 {
        self.controller.read(offset)
    }

    fn write(&mut self, offset: u32, write: RegisterWrite, now: Cycle) {
        self.controller.write(offset, write, now);
    }

    fn reset(&mut self, _now: Cycle) {
        self.controller.reset();
    }

    fn advance(&mut self, now: Cycle) {
        while let at = self.next_event()
            && at <= now
        {
            self.controller.advance(at);
            if self.host.next_event() <= at {
                self.host.act(&mut self.controller, at);
            }
        }
        self.host.pass_time(now);
    }

    fn next_event(&self) -> Cycle {
        self.host.next_event().min(self.controller.next_event())
    }

    fn interrupt_lines(&self) -> u32 {
        u32::from(self.controller.interrupts() != 0) << INTERRUPT_LINE
    }
}
