//! Drivers, or what of them needs no hardware to be tested, for any board.

mod conversion_ring;
pub mod mcp2515;
mod ring_reader;
mod usb_watch;

pub use conversion_ring::{ADC_CLOCK_HZ, CHANNELS, CONVERSION_CYCLES, ConversionRing, RING_CONVERSIONS};
pub use ring_reader::{COUNT_PERIOD, Overtaken, RingReader};
pub use usb_watch::{ControlPipe, OBSERVATION_INTERVAL_MS, UsbFault, UsbObservation, UsbWatch};
