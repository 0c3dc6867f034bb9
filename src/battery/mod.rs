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
mod memory;
mod monitor;
mod notice;
mod pack_settings;
mod reported;
mod reporters;
mod resistance;
mod rest;
mod retained;
mod scale;
mod settings;
mod sources;
mod state;
mod swap;

pub use arming::{ArmingFailure, arming_failures};
pub use bank::{BatteryBank, SumVoltage};
pub use chemistry::Chemistry;
pub use conditions::{Consequences, consequences};
pub use consumption::Gap;
pub use details::{Date, Name, PackDetails};
pub use event::{PackEvent, PackEvents};
pub use failsafe::{ReachedLevels, is_below};
pub use learnt::{
    END_OF_LIFE_LOSS, LEARNT_CURVE, LEARNT_WORDS, LearntPack, LessonObstacle, OLDER_LEARNT_WORDS,
};
pub use learnt_text::LearntTextError;
pub use measurement::{
    Amount, BusError, CellVoltages, Consumed, Contents, Counted, CurrentRange, Extremes, Gauge, GaugeReading,
    MAX_CELLS, Measurement, ReadError, Supply, Thermometer, Tick,
};
pub use memory::{PACK_WORDS, PackMemory, PackSource};
pub use monitor::{BatteryMonitor, FAILED_READS_UNTIL_UNHEALTHY, MIN_CONNECTED_VOLTAGE_V, PackUpdate};
pub use notice::{MAX_ANSWERING, PackNotice, SupplyEvent};
pub use pack_settings::{
    ChargeLimits, CurrentScale, FailsafeSettings, MissingSetting, PackSettings, SuggestedThresholds,
    Thresholds, VoltageSource,
};
pub use reported::{ChargeState, Faults, GaugeReport, Modes, Reported};
pub use retained::{RetainedMemory, RetainedRecord, lose_power, recall, retain};
pub use scale::{Measuring, MeasuringScale};
pub use state::{
    BatteryState, ChargeSource, FailsafeTimer, FailsafeTimers, PackStatus, Readings, ReportedVoltage,
    Visibility,
};

use crate::vehicle::ArmState;
pub use crate::vehicle::FailsafeLevel;
