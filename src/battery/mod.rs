//! Battery monitoring: [`Measurement`]s in, a [`BatteryState`] per pack out.

mod arming;
mod bank;
mod charge;
mod charge_state;
mod chemistry;
mod conditions;
mod consumption;
mod details;
mod diagnosis;
mod estimator;
mod event;
mod failsafe;
mod learnt;
mod learnt_text;
mod low_pass;
mod measurement;
mod monitor;
mod reported;
mod reporters;
mod resistance;
mod rest;
mod retained;
mod scale;
mod settings;
mod state;
mod swap;

pub use arming::{ArmingFailure, arming_failures};
pub use bank::{BatteryBank, SumVoltage};
pub use chemistry::Chemistry;
pub use conditions::Consequences;
pub use consumption::Gap;
pub use details::{Date, Name, PackDetails};
pub use event::{MAX_ANSWERING, PackEvent, PackEvents, PackNotice};
pub use failsafe::ReachedLevels;
pub use learnt::{
    END_OF_LIFE_LOSS, LEARNT_CURVE, LEARNT_WORDS, LearntPack, LessonObstacle, OLDER_LEARNT_WORDS,
};
pub use learnt_text::LearntTextError;
pub use measurement::{
    Amount, BusError, CellVoltages, Consumed, Contents, Counted, CurrentRange, Extremes, Gauge, GaugeReading,
    MAX_CELLS, Measurement, ReadError, Supply, Thermometer, Tick,
};
pub use monitor::{BatteryMonitor, FAILED_READS_UNTIL_UNHEALTHY, MIN_CONNECTED_VOLTAGE_V, PackUpdate};
pub use reported::{ChargeState, Faults, GaugeReport, Modes, Reported};
pub use retained::{PackMemory, PackSource, RetainedMemory, RetainedRecord, lose_power, recall, retain};
pub use scale::{Measuring, MeasuringScale, current_source, current_source_at_boot};
pub use settings::{
    ChargeLimits, FailsafeSettings, PackSettings, SuggestedThresholds, Thresholds, VoltageSource,
};
pub use state::{
    BatteryState, ChargeSource, FailsafeTimer, FailsafeTimers, PackStatus, Readings, ReportedVoltage,
    Visibility,
};

use crate::vehicle::ArmState;
pub use crate::vehicle::FailsafeLevel;
