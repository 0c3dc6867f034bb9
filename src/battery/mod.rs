//! Battery monitoring: [`Measurement`]s in, a [`BatteryState`] per pack out.

mod amount;
mod arm_state;
mod arming;
mod bank;
mod cell_count;
mod cells;
mod charge;
mod charge_state;
mod charge_tracker;
mod chemistry;
mod consumption;
mod curve;
mod details;
mod diagnosis;
mod estimator;
mod event;
mod failsafe;
mod failsafe_level;
mod faults;
mod health;
mod load;
mod low_pass;
mod measurement;
mod monitor;
mod read_error;
mod resistance;
mod rest;
mod retained;
mod settings;
mod state;
mod sum;
mod swap;
mod tick;

pub use amount::Amount;
pub use arm_state::ArmState;
pub use arming::{ArmingFailure, arming_failures};
pub use bank::BatteryBank;
pub use cells::{CellVoltages, MAX_CELLS};
pub use chemistry::Chemistry;
pub use consumption::Gap;
pub use details::{Date, Name, PackDetails};
pub use event::PackEvent;
pub use failsafe_level::FailsafeLevel;
pub use faults::Faults;
pub use measurement::{Consumed, Contents, Counted, Gauge, Measurement, Supply};
pub use monitor::{
    BatteryMonitor, FAILED_READS_UNTIL_UNHEALTHY, MAX_EVENTS, MIN_CONNECTED_VOLTAGE_V, PackEvents, PackUpdate,
};
pub use read_error::{BusError, ReadError};
pub use retained::{PackMemory, RetainedMemory, RetainedRecord, recall, retain};
pub use settings::{FailsafeSettings, PackSettings, Thresholds, VoltageSource};
pub use state::{BatteryState, ChargeSource, ChargeState, PackStatus, ReportedVoltage, Visibility};
pub use sum::{SumVoltage, sum};
pub use tick::Tick;
