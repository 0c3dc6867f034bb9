//! Packs that are measured by what is connected to the second serial port (`SERIAL1_PROTOCOL`).
//!
//! A protocol is one file in `protocols/` and one line in `registry.rs`; `docs/adding-a-sensor.md` shows how.

mod device;
mod line;
mod notice;
mod protocol;
mod protocols;
mod registry;

pub use device::{SerialDevice, SerialEvent};
pub use line::{DriverEnable, SerialSetup, Wires};
pub use notice::{SerialNotice, Urgency};
pub use protocol::{REQUEST_BYTES, Request, SerialReading};
pub use registry::SerialProtocol;
