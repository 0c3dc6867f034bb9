//! Devices to put on the bus. They measure at once what a test sets.

mod ina239;
pub mod mcp2515;

pub use ina239::Ina239;
pub use mcp2515::Mcp2515;
