//! Events of a pack, and their texts.

use core::fmt;

use super::consumption::Gap;
use super::{Amount, FailsafeLevel, ReadError};

/// An event of a pack. Its text follows "Battery 1 ".
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PackEvent {
    /// The number of cells was detected from the resting voltage.
    CellsDetected {
        /// Cells in series.
        count: u8,
    },
    /// The resting voltage fits no number of cells, or several.
    CellsAmbiguous {
        /// The resting voltage, in volts.
        voltage_v: f32,
    },
    /// The pack was swapped: estimates and consumption restart.
    Swapped,
    /// The pack was disconnected while armed.
    ContactLost,
    /// It has been connected again for a while.
    ContactRestored,
    /// There was a gap in the current readings.
    Gap(Gap),
    /// Its sensor has failed repeatedly, with the latest error.
    SensorFailed(ReadError),
    /// Its sensor has recovered.
    SensorRecovered,
    /// Its power button is held.
    PoweringOff,
    /// A failsafe level was reached.
    Failsafe {
        /// The level.
        level: FailsafeLevel,
        /// The latest known terminal voltage, in volts; 0 if unknown.
        voltage_v: f32,
        /// Charge or fuel drawn; 0 if unknown.
        consumed: Amount,
    },
}

impl fmt::Display for PackEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::CellsDetected { count } => write!(f, "has {count} cells (set BATT_CELLS to be sure)"),
            Self::CellsAmbiguous { voltage_v } => {
                write!(f, "cells unclear at {}V: set BATT_CELLS", Hundredths(*voltage_v))
            }
            Self::Swapped => f.write_str("swapped: estimates restarted"),
            Self::ContactLost => f.write_str("not connected"),
            Self::ContactRestored => f.write_str("connected again"),
            Self::Gap(Gap {
                duration_s,
                counted_mah: Some(counted_mah),
            }) => write!(
                f,
                "not measured for {}s: {}mAh assumed",
                whole(*duration_s),
                whole(*counted_mah)
            ),
            Self::Gap(Gap { duration_s, .. }) => {
                write!(f, "not measured for {}s: consumption too low", whole(*duration_s))
            }
            Self::SensorFailed(error) => write!(f, "unhealthy: {error}"),
            Self::SensorRecovered => f.write_str("healthy again"),
            Self::PoweringOff => f.write_str("is powering off"),
            Self::Failsafe {
                level,
                consumed: Amount::Ml(ml),
                ..
            } => write!(f, "is {}, used {} ml", name(*level), whole(*ml)),
            Self::Failsafe {
                level,
                voltage_v,
                consumed: Amount::Mah(mah),
            } => {
                let last = if *level == FailsafeLevel::Unhealthy {
                    ", last:"
                } else {
                    ""
                };
                write!(
                    f,
                    "is {}{last} {}V used {} mAh",
                    name(*level),
                    Hundredths(*voltage_v),
                    whole(*mah)
                )
            }
        }
    }
}

fn name(level: FailsafeLevel) -> &'static str {
    match level {
        FailsafeLevel::None => "fine",
        FailsafeLevel::Unhealthy => "missing",
        FailsafeLevel::Low => "low",
        FailsafeLevel::Critical => "critical",
    }
}

/// A number with two decimals. Float formatting would take some 20 KB of flash.
struct Hundredths(f32);

impl fmt::Display for Hundredths {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let hundredths = whole(self.0 * 100.0);
        let sign = if hundredths < 0 { "-" } else { "" };
        let magnitude = hundredths.unsigned_abs();
        write!(f, "{sign}{}.{:02}", magnitude / 100, magnitude % 100)
    }
}

/// Rounds half away from zero, saturating.
fn whole(value: f32) -> i32 {
    (value + if value < 0.0 { -0.5 } else { 0.5 }) as i32
}
