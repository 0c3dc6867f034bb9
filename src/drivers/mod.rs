//! Drivers, or what of them needs no hardware to be tested, for any board.

pub mod mcp2515;
mod ring_reader;
mod usb_watch;

pub use ring_reader::{COUNT_PERIOD, Overtaken, RingReader};
pub use usb_watch::{ControlPipe, OBSERVATION_INTERVAL_MS, UsbFault, UsbObservation, UsbWatch};
