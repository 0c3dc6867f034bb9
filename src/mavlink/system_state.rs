//! Everything telemetry reports, at one moment.

use super::ReceiveStatistics;
use crate::battery::BatteryState;

/// Everything the telemetry of one link reports.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SystemState {
    /// The primary pack, instance 0.
    pub battery: BatteryState,
    /// Busy share of the processor over the last second, in tenths of a percent (0 to 1000).
    pub load_permille: u16,
    /// What happened on the link this state is sent over.
    pub link: LinkStatistics,
}

impl SystemState {
    /// The pack of this instance; a pack that does not exist is one of which nothing is known.
    pub fn battery(&self, instance: u8) -> BatteryState {
        if instance == 0 {
            self.battery
        } else {
            BatteryState::default()
        }
    }
}

/// Counters of one link since boot. They wrap at 2^32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkStatistics {
    /// Messages handed to the wire.
    pub sent: u32,
    /// Messages dropped because the link had no room for them.
    pub dropped: u32,
    /// What came in.
    pub received: ReceiveStatistics,
}
