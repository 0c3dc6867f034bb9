//! Packs that are measured by what is connected to the second serial port (`SERIAL1_PROTOCOL`).
//!
//! A protocol is one file in `protocols/` and one line in `registry.rs`; `docs/extending.md` shows how.

mod conditions;
mod protocol;
mod protocols;
mod registry;

pub use conditions::{FuelCellError, FuelCellState, RichenPowerErrors, SerialNotice, TorqeedoCondition};
pub use protocol::{REQUEST_BYTES, Request, SerialReading, Wires};
pub use registry::{DriverEnable, SerialDevice, SerialProtocol, SerialSetup};
