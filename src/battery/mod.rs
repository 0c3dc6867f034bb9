//! Battery monitoring: [`Measurement`]s in, a [`BatteryState`] per pack out.

mod alert;
mod arming;
mod bank;
mod cell_count;
mod cells;
mod charge;
mod charge_reporter;
mod charge_state;
mod chemistry;
mod consumption;
mod counter;
mod details;
mod diagnosis;
mod estimator;
mod event;
mod failsafe;
mod gauge;
mod health;
mod learnt;
mod learnt_text;
mod low_pass;
mod measurement;
mod monitor;
mod reported;
mod resistance;
mod rest;
mod retained;
mod settings;
mod state;
mod suggestion;
mod sum;
mod swap;
mod tick;

pub use arming::{ArmingFailure, arming_failures};
pub use bank::BatteryBank;
pub use cells::{CellVoltages, MAX_CELLS};
pub use chemistry::Chemistry;
pub use consumption::Gap;
pub use details::{Date, Name, PackDetails};
pub use event::{PackEvent, PackEvents};
pub use learnt::{LEARNT_WORDS, LearntPack};
pub use learnt_text::LearntTextError;
pub use measurement::{
    Amount, BusError, Consumed, Contents, Counted, Gauge, GaugeReading, Measurement, ReadError, Supply,
};
pub use monitor::{BatteryMonitor, FAILED_READS_UNTIL_UNHEALTHY, MIN_CONNECTED_VOLTAGE_V, PackUpdate};
pub use reported::{ChargeState, Faults, Reported};
pub use retained::{PackMemory, PackSource, RetainedMemory, RetainedRecord, recall, retain};
pub use settings::{ChargeLimits, FailsafeSettings, PackSettings, Thresholds, VoltageSource};
pub use state::{BatteryState, ChargeSource, PackStatus, ReportedVoltage, Visibility};
pub use suggestion::SuggestedThresholds;
pub(crate) use sum::mean;
pub use sum::{SumVoltage, sum};
pub use tick::Tick;

use crate::vehicle::ArmState;
pub use crate::vehicle::FailsafeLevel;
