//! Packs that are measured by what is connected to the second serial port (`SERIAL1_PROTOCOL`).
//!
//! A protocol is one file in `protocols/` and one line in `registry.rs`; `docs/adding-a-sensor.md` shows how.

mod conditions;
mod device;
mod frame;
mod protocol;
mod protocols;
mod registry;
mod setup;

pub use conditions::{
    FuelCellError, FuelCellState, RichenPowerErrors, SerialNotice, TorqeedoCondition, Urgency,
};
pub use device::SerialDevice;
pub use protocol::{REQUEST_BYTES, Request, SerialReading, Wires};
pub use registry::SerialProtocol;
pub use setup::{DriverEnable, SerialSetup};
