//! What is known of a pack: measurements in, a [`BatteryState`] out.

mod measurement;
mod monitor;
mod state;

pub use measurement::{Measurement, ReadError};
pub use monitor::{BatteryMonitor, FAILED_READS_UNTIL_UNHEALTHY, MIN_CONNECTED_VOLTAGE_V};
pub use state::{BatteryState, PackStatus};
