//! What of the board's peripherals needs no hardware to be tested.

mod ring_reader;
mod usb_watch;

pub use ring_reader::{COUNT_PERIOD, Overtaken, RingReader};
pub use usb_watch::{ControlPipe, OBSERVATION_INTERVAL_MS, UsbFault, UsbObservation, UsbWatch};
