//! Packs and vehicle as a whole: everything that is reported of them at one moment, and what keeps the vehicle from being
//! armed.

mod arming;
mod state;

pub use arming::{ArmingObstacle, MeasuredAt, above_drivers, arming_obstacles, arming_readiness};
pub use state::{
    ArmingReadiness, LOG_READER_SILENCE_US, LinkStatistics, LogHealth, LogProtocol, LogReader, LogReaders,
    ReceiveStatistics, SystemState,
};
