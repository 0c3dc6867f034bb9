//! What is known of the packs: measurements in, a [`BatteryState`] out.

mod cells;
mod chemistry;
mod faults;
mod measurement;
mod monitor;
mod state;

pub use cells::{CellVoltages, MAX_CELLS};
pub use chemistry::Chemistry;
pub use faults::Faults;
pub use measurement::{Consumed, Measurement, ReadError};
pub use monitor::{BatteryMonitor, FAILED_READS_UNTIL_UNHEALTHY, MIN_CONNECTED_VOLTAGE_V};
pub use state::{BatteryState, ChargeState, PackStatus, ReportedVoltage, Visibility};

/// The most packs that can be monitored, instances 0 to 8: `BATT_`, `BATT2_` to `BATT9_`.
pub const MAX_PACKS: usize = 9;
