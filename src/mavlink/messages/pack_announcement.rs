//! What happened to a pack, in words.

use core::fmt::Write;

use heapless::String;

use crate::battery::PackEvent;
use crate::mavlink::dialect::MavSeverity;
use crate::pack::Pack;

/// The longest text, in bytes: two STATUSTEXT.
const TEXT_BYTES: usize = 96;

/// How urgent an event of `pack` is, and what to say: "Battery 1 ...".
pub fn pack_announcement(pack: Pack, event: &PackEvent) -> (MavSeverity, String<TEXT_BYTES>) {
    let mut text = String::new();
    // A text that does not fit is cut off; a test shows that all do.
    let _ = write!(text, "Battery {} {event}", pack.number());
    (severity(event), text)
}

/// ArduPilot says failsafes as warnings.
fn severity(event: &PackEvent) -> MavSeverity {
    match event {
        PackEvent::CellsDetected { .. } | PackEvent::SensorRecovered | PackEvent::ContactRestored => {
            MavSeverity::MAV_SEVERITY_NOTICE
        }
        PackEvent::CellsAmbiguous { .. }
        | PackEvent::Swapped
        | PackEvent::ContactLost
        | PackEvent::Gap(_)
        | PackEvent::SensorFailed(_)
        | PackEvent::PoweringOff
        | PackEvent::Failsafe { .. } => MavSeverity::MAV_SEVERITY_WARNING,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::battery::{Amount, FailsafeLevel, Gap, ReadError};

    #[test]
    fn every_event_has_a_text_that_fits() {
        let gap = |counted_mah| {
            PackEvent::Gap(Gap {
                duration_s: 1e9,
                counted_mah,
            })
        };
        let failsafe = |level, consumed| PackEvent::Failsafe {
            level,
            voltage_v: 1000.0,
            consumed,
        };
        for (event, expected) in [
            (
                PackEvent::CellsDetected { count: 3 },
                "Battery 9 has 3 cells (set BATT_CELLS to be sure)",
            ),
            (
                PackEvent::CellsAmbiguous { voltage_v: 8.85 },
                "Battery 9 cells unclear at 8.85V: set BATT_CELLS",
            ),
            (PackEvent::Swapped, "Battery 9 swapped: estimates restarted"),
            (PackEvent::ContactLost, "Battery 9 not connected"),
            (PackEvent::ContactRestored, "Battery 9 connected again"),
            (
                gap(Some(12.0)),
                "Battery 9 not measured for 1000000000s: 12mAh assumed",
            ),
            (
                gap(None),
                "Battery 9 not measured for 1000000000s: consumption too low",
            ),
            (
                PackEvent::SensorFailed(ReadError::AddressTaken),
                "Battery 9 unhealthy: address already in use",
            ),
            (PackEvent::SensorRecovered, "Battery 9 healthy again"),
            (PackEvent::PoweringOff, "Battery 9 is powering off"),
            (
                failsafe(FailsafeLevel::Low, Amount::Mah(-1e9)),
                "Battery 9 is low 1000.00V used -1000000000 mAh",
            ),
            (
                failsafe(FailsafeLevel::Unhealthy, Amount::Mah(-1e9)),
                "Battery 9 is missing, last: 1000.00V used -1000000000 mAh",
            ),
            (
                failsafe(FailsafeLevel::Critical, Amount::Ml(-1e9)),
                "Battery 9 is critical, used -1000000000 ml",
            ),
        ] {
            assert_eq!(pack_announcement(Pack::Ninth, &event).1, expected);
        }
    }
}
