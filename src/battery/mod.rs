//! Battery monitoring: [`Measurement`]s in, a [`BatteryState`] per pack out.

mod arming;
mod bank;
mod conditions;
mod notice;
mod retained;
mod settings;
mod sources;

pub use arming::arming_failures;
pub use bank::{BatteryBank, SumVoltage};
pub use battery_gauge::{
    Amount, BatteryMonitor, BatteryState, BusError, CellVoltages, ChargeLimits, ChargeSource, ChargeState,
    Chemistry, Consumed, Contents, Counted, CurrentRange, CurrentScale, Date, END_OF_LIFE_LOSS, Extremes,
    FAILED_READS_UNTIL_UNHEALTHY, FailsafeLevel, FailsafeSettings, FailsafeTimer, FailsafeTimers, Faults,
    Gap, Gauge, GaugeReading, GaugeReport, LEARNT_CURVE, LEARNT_WORDS, LearntPack, LearntTextError,
    LessonObstacle, LoadState, MAX_CELLS, MIN_CONNECTED_VOLTAGE_V, Measurement, Measuring, MeasuringScale,
    MissingSetting, Modes, Name, OLDER_LEARNT_WORDS, PACK_WORDS, PackDetails, PackEvent, PackEvents,
    PackMemory, PackSettings, PackSource, PackStatus, PackUpdate, ReachedLevels, ReadError, Readings,
    Reported, ReportedVoltage, SuggestedThresholds, Supply, Thermometer, Thresholds, Tick, Visibility,
    VoltageSource, is_below,
};
pub use conditions::{ArmingFailure, Consequences, consequences};
pub use notice::{MAX_ANSWERING, PackNotice, SupplyEvent};
pub use retained::{RetainedMemory, RetainedRecord, lose_power, recall, retain};
