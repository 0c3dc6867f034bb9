//! Emulated boards with the release firmware, as the test programs use them, and runs of any length.

pub mod bench;
pub mod can;
pub mod downloads;
pub mod driven_rover;
pub mod elf;
pub mod i2c_bus;
pub mod log_flash;
pub mod log_records;
pub mod program;
pub mod rover_circuit;
pub mod runs;
pub mod signing_key;
pub mod starts;
