//! Packs that are measured by what is connected to the second serial port (`SERIAL1_PROTOCOL`).
//!
//! A protocol is one file in `protocols/` and one line in `registry.rs`; `docs/adding-a-sensor.md` shows how.

mod conditions;
mod device;
mod gap;
mod line;
mod notice;
mod protocol;
mod protocols;
mod registry;
mod setup;
mod window;

pub use conditions::{FuelCellError, FuelCellState, RichenPowerErrors, TorqeedoCondition, Urgency};
pub use device::SerialDevice;
pub use line::Wires;
pub use notice::SerialNotice;
pub use protocol::{REQUEST_BYTES, Request, SerialReading};
pub use registry::SerialProtocol;
pub use setup::{DriverEnable, SerialSetup};
