//! Devices to put on the bus. They measure at once what a test sets.

mod ina239;

pub use ina239::Ina239;
