//! Announcements of the autopilot itself, with their severities.

use core::fmt;

use super::recording::{LOG_FULL, LogFailure};
use super::start::ParameterLoad;
use super::stores::FlashStore;
use crate::announce::{Announce, Limit, Severity};
use crate::battery::SuggestedThresholds;
use crate::memory::storage::StorageError;
use crate::numbers::{Hundredths, round_to_i32};
use crate::pack::{Pack, PackSet};
use crate::parameter::{BatteryParameter, ParameterId, Refused, VehicleParameter};

/// An announcement of the autopilot itself.
#[derive(Clone, Copy, Debug)]
pub enum Notice {
    /// Packs are monitored, and none of them has a failsafe threshold in effect; with the parameter to set.
    FailsafesOff(ParameterId),
    /// Thresholds for a pack without any.
    Suggestion(Pack, SuggestedThresholds),
    /// A ground station has set all parameters to their defaults.
    ParametersReset,
    /// Parameters can be written again.
    ParametersSaved,
    /// Data of a store can't be written to flash.
    NotSaved(FlashStore, StorageError),
    /// Messages were ignored since they were not signed with the key.
    Unauthorized {
        /// The link they came from.
        link: &'static str,
        /// Their number so far.
        count: u32,
    },
    /// Messages were ignored since they are too old although they are signed with the key.
    TooOld {
        /// The link they came from.
        link: &'static str,
    },
    /// Signed messages were ignored since others with the same ids were signed later.
    SharedIds {
        /// The link they came from.
        link: &'static str,
        /// System and component id.
        ids: [u8; 2],
    },
    /// A ground station tried to set a parameter and was refused.
    ParameterRefused {
        /// The parameter.
        id: ParameterId,
        /// Why.
        why: Refused,
    },
    /// The rover was armed with a long time-out of its driver.
    LongTimeOut {
        /// `FS_TIMEOUT` or `FS_GCS_TIMEOUT`.
        parameter: VehicleParameter,
        /// Its value.
        seconds: f32,
    },
    /// Each page of the log stores a register of the flash chip.
    LogWearsFlash,
    /// A ground station has ended failsafe levels of packs and set their charge.
    BatteriesReset {
        /// Its link.
        link: &'static str,
        /// The packs.
        packs: PackSet,
        /// Their charge, in percent.
        percent: f32,
    },
    /// A ground station has erased all logs.
    LogsErased {
        /// Its link.
        link: &'static str,
    },
    /// A ground station has erased what is learnt of a pack.
    LearntErased {
        /// Its link.
        link: &'static str,
        /// The pack.
        pack: Pack,
    },
    /// The power went off while armed before this start. Many owners switch off so.
    PowerWentOff,
    /// The board was reset while armed before this start.
    ResetWhileArmed,
}

impl Announce for Notice {
    fn severity(&self) -> Severity {
        match self {
            Self::Suggestion(..)
            | Self::BatteriesReset { .. }
            | Self::LogsErased { .. }
            | Self::LearntErased { .. } => Severity::Notice,
            Self::ParametersSaved | Self::PowerWentOff | Self::ResetWhileArmed => Severity::Info,
            _ => Severity::Warning,
        }
    }

    fn limit(&self) -> Limit {
        match self {
            Self::Unauthorized { .. } | Self::TooOld { .. } | Self::SharedIds { .. } => {
                Limit::of(self).one_at_once()
            }
            Self::ParameterRefused { .. }
            | Self::BatteriesReset { .. }
            | Self::LogsErased { .. }
            | Self::LearntErased { .. } => Limit::of(self),
            _ => Limit::BOARD,
        }
    }
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FailsafesOff(id) => write!(f, "Battery failsafes are off: set {}", id.name()),
            Self::Suggestion(pack, suggested) => write!(
                f,
                "Set {} {}, {} {}",
                BatteryParameter::LowVolt.of(*pack).name(),
                Hundredths(suggested.low_v),
                BatteryParameter::CrtVolt.of(*pack).name(),
                Hundredths(suggested.critical_v)
            ),
            Self::ParametersReset => f.write_str("All parameters reset to their defaults"),
            Self::ParametersSaved => f.write_str("Parameters saved"),
            Self::NotSaved(store, error) => {
                f.write_str(store.content())?;
                f.write_str(match error {
                    StorageError::NoErasedSpace => " not saved until disarmed",
                    _ => " not saved: flash worn out?",
                })
            }
            Self::Unauthorized { link, count } => {
                write!(f, "{link}: not signed with the key, ignored: {count}")
            }
            Self::TooOld { link } => {
                write!(
                    f,
                    "{link}: signed frames too old: does the station hear the rover?"
                )
            }
            Self::SharedIds {
                link,
                ids: [system_id, component_id],
            } => write!(
                f,
                "{link}: two stations are {system_id}/{component_id}? Give each its own id"
            ),
            Self::ParameterRefused { id, why } => match why {
                Refused::OutOfRange => write!(f, "{} refused: valid {}", id.name(), id.row().range),
                Refused::OtherChemistry => write!(f, "{} refused: no such cell by its CHEM", id.name()),
                // ArduPilot's text.
                Refused::ReadOnly => write!(f, "Param write denied ({})", id.name()),
                Refused::Armed => write!(f, "{} refused: not raised while armed", id.name()),
                Refused::NotWhileArmed => write!(f, "{} refused: not changed while armed", id.name()),
            },
            Self::LongTimeOut { parameter, seconds } => write!(
                f,
                "Armed with {} {}: drives on for long without a driver",
                parameter.row().name,
                Hundredths(*seconds)
            ),
            Self::BatteriesReset { link, packs, percent } => {
                write!(f, "{link}: reset to {}%, battery {packs}", round_to_i32(*percent))
            }
            Self::LogsErased { link } => write!(f, "{link}: logs erased"),
            Self::LearntErased { link, pack } => {
                write!(f, "{link}: learnt data of battery {} erased", pack.number())
            }
            Self::PowerWentOff => f.write_str("Power went off while armed"),
            Self::ResetWhileArmed => f.write_str("Reset while armed"),
            Self::LogWearsFlash => f.write_str("Logging wears out this flash chip: set LOG_BITMASK 0"),
        }
    }
}

impl Announce for ParameterLoad {
    fn severity(&self) -> Severity {
        match self {
            Self::Loaded => Severity::Info,
            Self::Unknown(_) => Severity::Warning,
            Self::Interrupted | Self::Skipped => Severity::Critical,
        }
    }
}

impl fmt::Display for ParameterLoad {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Loaded => f.write_str("Parameters loaded"),
            Self::Unknown(count) => write!(f, "{count} stored parameters unknown: kept"),
            Self::Interrupted => f.write_str("Parameter storage damaged: check parameters"),
            Self::Skipped => f.write_str("5 quick resets: started with default parameters"),
        }
    }
}

impl Announce for LogFailure {
    fn severity(&self) -> Severity {
        Severity::Warning
    }
}

impl fmt::Display for LogFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Full => LOG_FULL,
            Self::NotWritten => "Log not written: flash worn out?",
        })
    }
}

/// A line of a crash report.
#[derive(Clone, Copy, Debug)]
pub struct CrashLine<'a>(pub &'a str);

impl Announce for CrashLine<'_> {
    fn severity(&self) -> Severity {
        Severity::Critical
    }
}

impl fmt::Display for CrashLine<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::announce::announced_text;
    use crate::battery::{
        Amount, ChargeState, CurrentRange, CurrentScale, FailsafeLevel, Faults, Gap, LessonObstacle,
        PackEvent, PackNotice, ReadError, SupplyEvent,
    };
    use crate::mavlink::{SigningChange, SigningTrouble};
    use crate::memory::storage::FlashFault;
    use crate::parameter::{ParameterTrouble, SaveFailure};
    use crate::sensor::{
        CanNotice, CanReport, ChargerPower, FuelCellError, FuelCellState, NodeId, SerialNotice,
        TorqeedoCondition,
    };
    use crate::vehicle::{FailsafeAction, VehicleEvent};
    use crate::wifi::WifiReport;

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
            voltage_v: Some(1000.0),
            consumed: Some(consumed),
        };
        let most_faults = Faults::all() - Faults::CELL_DIFFERS - Faults::UNDER_TEMPERATURE;
        for (event, expected) in [
            (
                PackEvent::CellsDetected { count: 3 },
                "Battery 9 has 3 cells (set BATT9_CELLS to be sure)",
            ),
            (
                PackEvent::CellsAmbiguous { voltage_v: 8.85 },
                "Battery 9 cells unclear at 8.85V: set BATT9_CELLS",
            ),
            (PackEvent::Swapped, "Battery 9 swapped: estimates restarted"),
            (PackEvent::EstimateRestarted, "Battery 9 estimate restarted"),
            (
                PackEvent::CurrentLost,
                "Battery 9 current lost: charge by voltage alone",
            ),
            (PackEvent::CurrentReversed, "Battery 9 current sensor reversed?"),
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
                PackEvent::CurrentOverRange(CurrentRange::Over),
                "Battery 9 current over range: consumption too low",
            ),
            (
                PackEvent::SensorFailed(ReadError::AddressTaken),
                "Battery 9 unhealthy: address already in use",
            ),
            (PackEvent::SensorRecovered, "Battery 9 healthy again"),
            (PackEvent::PoweringOff, "Battery 9 is powering off"),
            (PackEvent::MembersLeft(0b10), "Battery 9 sums without battery 2"),
            (
                PackEvent::MembersLeft(0b1_0000_0101),
                "Battery 9 sums without battery 1, 3, 9",
            ),
            (
                PackEvent::Charge {
                    state: ChargeState::Low,
                    remaining_pct: Some(14.6),
                    usable_pct: Some(14.6),
                    voltage_v: Some(10.95),
                },
                "Battery 9 low: 10.95V 15% left",
            ),
            (
                PackEvent::Charge {
                    state: ChargeState::Critical,
                    remaining_pct: Some(38.0),
                    usable_pct: Some(6.0),
                    voltage_v: None,
                },
                "Battery 9 critical: 6% usable",
            ),
            (
                PackEvent::Charge {
                    state: ChargeState::Emergency,
                    remaining_pct: None,
                    usable_pct: None,
                    voltage_v: Some(8.7),
                },
                "Battery 9 emergency: 8.70V",
            ),
            (PackEvent::Charging, "Battery 9 charging"),
            (
                PackEvent::Learnt {
                    capacity_mah: 2994.6,
                    resistance_ohm: 0.0871,
                },
                "Battery 9 learnt: 2995 mAh, 87 mOhm",
            ),
            (
                PackEvent::CapacityAboveLabel(Some(CurrentScale::Shunt)),
                "Battery 9 check BATT9_SHUNT or BATT9_CAPACITY",
            ),
            (
                PackEvent::Faults(Faults::CELL_FAIL | Faults::OVER_CURRENT),
                "Battery 9 fault: cell failed, over current",
            ),
            (
                PackEvent::ReportedFaults(Faults::BAD_BATTERY | Faults::OVER_TEMPERATURE),
                "Battery 9 reports: bad battery, over temperature",
            ),
            (
                PackNotice(Pack::Ninth, &PackEvent::Faults(most_faults)).split().0,
                "Battery 9 fault: cell failed, deep discharge, over temperature, over current",
            ),
            (
                PackEvent::ReportedState {
                    state: ChargeState::Failed,
                    cause: Faults::BAD_BATTERY | Faults::CELL_DIFFERS,
                },
                "Battery 9 reports: failed, bad battery, cells differ",
            ),
            (
                PackEvent::ReportedState {
                    state: ChargeState::Unhealthy,
                    cause: Faults::empty(),
                },
                "Battery 9 reports: unhealthy",
            ),
            (
                PackEvent::ReportedState {
                    state: ChargeState::Emergency,
                    cause: Faults::empty(),
                },
                "Battery 9 reports: empty",
            ),
            (
                failsafe(FailsafeLevel::Low, Amount::Mah(-1e9)),
                "Battery 9 is low 1000.00V used -1000000000 mAh",
            ),
            (
                failsafe(FailsafeLevel::Unhealthy, Amount::Mah(-1e9)),
                "Battery 9 is missing, last: 1000.00V used -1000000000 mAh",
            ),
            (
                PackEvent::Failsafe {
                    level: FailsafeLevel::Unhealthy,
                    voltage_v: None,
                    consumed: None,
                },
                "Battery 9 is missing",
            ),
            (
                failsafe(FailsafeLevel::Critical, Amount::Ml(-1e9)),
                "Battery 9 is critical, used -1000000000 ml",
            ),
        ] {
            assert_eq!(PackNotice(Pack::Ninth, &event).text(), expected);
        }
        for (event, expected) in [
            (
                SupplyEvent::MeasuredBy(192),
                "Battery 9 measured by component 192",
            ),
            (
                SupplyEvent::PowerLimited(Some(32_767)),
                "Battery 9 limits the motors: over 32767W",
            ),
            (
                SupplyEvent::PowerLimited(None),
                "Battery 9 no longer limits the motors",
            ),
            (
                SupplyEvent::PowerUnknown,
                "Battery 9 can't limit the motors: current unknown",
            ),
            (
                SupplyEvent::NotFound {
                    address: Some(0x40),
                    answering: [Some(0x0b), Some(0x41), None, None, None],
                },
                "Battery 9 not found at 0x40: the bus answers at 0x0b, 0x41",
            ),
            (
                SupplyEvent::NotFound {
                    address: None,
                    answering: [None; 5],
                },
                "Battery 9 not found: nothing answers",
            ),
            (
                SupplyEvent::Found {
                    address: 0x0b,
                    cells: Some(4),
                },
                "Battery 9 found at 0x0b, 4 cells",
            ),
            (
                SupplyEvent::Range {
                    part: "INA3221",
                    current_a: 163.84,
                },
                "Battery 9 INA3221 up to 163.8 A",
            ),
            (
                SupplyEvent::ActionTooLate(FailsafeLevel::Unhealthy),
                "Battery 9 is unhealthy already: acts next time, choose Hold",
            ),
        ] {
            assert_eq!(PackNotice(Pack::Ninth, &event).text(), expected);
        }
        for (event, expected) in [
            (
                VehicleEvent::NeedsPosition(FailsafeAction::SmartRtl),
                "SmartRTL needs a position: Hold",
            ),
            (VehicleEvent::Terminated, "Terminated by battery failsafe"),
            (VehicleEvent::ControlsTimedOut, "Radio Failsafe: Hold"),
            (VehicleEvent::GroundStationsTimedOut, "GCS Failsafe: Hold"),
        ] {
            assert_eq!(event.text(), expected);
        }
    }

    /// Severity and text, for one place of each event in the sources.
    fn line(event: &dyn Announce) -> String {
        let severity = format!("{:?}", event.severity()).to_lowercase();
        format!("{severity}: {}", announced_text(event))
    }

    #[test]
    fn severities_and_texts_of_packs_in_order() {
        let charge = |state| PackEvent::Charge {
            state,
            remaining_pct: Some(14.0),
            usable_pct: None,
            voltage_v: None,
        };
        let failsafe = |level| PackEvent::Failsafe {
            level,
            voltage_v: Some(10.0),
            consumed: Some(Amount::Mah(900.0)),
        };
        let gap = Gap {
            duration_s: 3.0,
            counted_mah: None,
        };
        let learnt = PackEvent::Learnt {
            capacity_mah: 3000.0,
            resistance_ohm: 0.08,
        };
        let events = [
            PackEvent::CellsDetected { count: 3 },
            PackEvent::CellsAmbiguous { voltage_v: 8.85 },
            PackEvent::Swapped,
            PackEvent::EstimateRestarted,
            PackEvent::ContactLost,
            PackEvent::ContactRestored,
            PackEvent::Gap(gap),
            PackEvent::CurrentOverRange(CurrentRange::Over),
            PackEvent::CurrentLost,
            PackEvent::CurrentReversed,
            PackEvent::SensorFailed(ReadError::Timeout),
            PackEvent::SensorRecovered,
            PackEvent::PoweringOff,
            PackEvent::MembersLeft(0b11),
            charge(ChargeState::Low),
            charge(ChargeState::Critical),
            charge(ChargeState::Emergency),
            PackEvent::Charging,
            learnt,
            PackEvent::CapacityAboveLabel(Some(CurrentScale::AmperesPerVolt)),
            PackEvent::CapacityAboveLabel(None),
            PackEvent::NotLearnt(LessonObstacle::NoRest),
            PackEvent::Faults(Faults::SPIKES),
            PackEvent::ReportedFaults(Faults::SPIKES),
            failsafe(FailsafeLevel::Unhealthy),
            failsafe(FailsafeLevel::Low),
            failsafe(FailsafeLevel::Critical),
        ];
        let lines = events.map(|event| line(&PackNotice(Pack::First, &event)));
        let expected = "\
notice: Battery 1 has 3 cells (set BATT_CELLS to be sure)
warning: Battery 1 cells unclear at 8.85V: set BATT_CELLS
warning: Battery 1 swapped: estimates restarted
warning: Battery 1 estimate restarted
warning: Battery 1 not connected
notice: Battery 1 connected again
warning: Battery 1 not measured for 3s: consumption too low
warning: Battery 1 current over range: consumption too low
warning: Battery 1 current lost: charge by voltage alone
warning: Battery 1 current sensor reversed?
warning: Battery 1 unhealthy: no reading in time
notice: Battery 1 healthy again
warning: Battery 1 is powering off
warning: Battery 1 sums without battery 1, 2
warning: Battery 1 low: 14% left
critical: Battery 1 critical: 14% left
critical: Battery 1 emergency: 14% left
notice: Battery 1 charging
notice: Battery 1 learnt: 3000 mAh, 80 mOhm
warning: Battery 1 check BATT_AMP_PERVLT or BATT_CAPACITY
warning: Battery 1 check BATT_CAPACITY
notice: Battery 1 not learnt: no rest of 30s at the end
warning: Battery 1 fault: voltage spikes
warning: Battery 1 reports: voltage spikes
warning: Battery 1 is missing, last: 10.00V used 900 mAh
warning: Battery 1 is low 10.00V used 900 mAh
critical: Battery 1 is critical 10.00V used 900 mAh";
        assert_eq!(lines.join("\n"), expected);
    }

    #[test]
    fn severities_and_texts_of_everything_else_in_order() {
        let node = NodeId::new(10).expect("an id");
        let flash = StorageError::Flash(FlashFault::NotVerified);
        let id = BatteryParameter::Capacity.of(Pack::First);
        let not_saved = |error| SaveFailure { error, changes: 2 };
        let refused = |why| Notice::ParameterRefused { id, why };
        let serial = [
            SerialNotice::FuelCellError(FuelCellError::Flags(0x0400)),
            SerialNotice::FuelCellError(FuelCellError::Flags(0x0010)),
            SerialNotice::FuelCellError(FuelCellError::Code(0, 0)),
            SerialNotice::FuelCellError(FuelCellError::Code(20, 0)),
            SerialNotice::FuelCellError(FuelCellError::Code(33, 7)),
            SerialNotice::FuelCellState(FuelCellState::Running),
            SerialNotice::FuelCellState(FuelCellState::Fault),
            SerialNotice::Torqeedo(TorqeedoCondition::default()),
        ];
        let announcements: [&dyn Announce; _] = [
            &PackNotice(Pack::First, &SupplyEvent::MeasuredBy(191)),
            &PackNotice(Pack::First, &SupplyEvent::AboveDrivers),
            &VehicleEvent::NeedsPosition(FailsafeAction::Rtl),
            &VehicleEvent::Terminated,
            &VehicleEvent::ControlsTimedOut,
            &VehicleEvent::GroundStationsTimedOut,
            &Notice::FailsafesOff(BatteryParameter::LowVolt.of(Pack::First)),
            &Notice::Suggestion(
                Pack::First,
                SuggestedThresholds {
                    low_v: 10.5,
                    critical_v: 10.2,
                },
            ),
            &ParameterLoad::Skipped,
            &ParameterLoad::Interrupted,
            &Notice::ParametersReset,
            &ParameterTrouble::NotRead,
            &ParameterTrouble::Damaged,
            &ParameterTrouble::HalfLoaded { missing: None },
            &ParameterTrouble::HalfLoaded { missing: Some(12) },
            &ParameterTrouble::DoesNotFit(id, None),
            &ParameterTrouble::DoesNotFit(id, Some(id)),
            &ParameterLoad::Unknown(3),
            &not_saved(StorageError::NoErasedSpace),
            &not_saved(StorageError::Full),
            &not_saved(flash),
            &Notice::ParametersSaved,
            &Notice::NotSaved(FlashStore::Learnt, StorageError::NoErasedSpace),
            &Notice::NotSaved(FlashStore::Learnt, flash),
            &Notice::NotSaved(FlashStore::Wifi, StorageError::NoErasedSpace),
            &Notice::NotSaved(FlashStore::Wifi, flash),
            &WifiReport::NoAnswer,
            &WifiReport::DownloadFailed,
            &WifiReport::NoRadio,
            &WifiReport::AccessPointUp,
            &WifiReport::Joined,
            &WifiReport::AddressObtained([192, 168, 4, 2]),
            &WifiReport::NetworkNotFound,
            &WifiReport::JoinFailed,
            &WifiReport::WrongPassword,
            &WifiReport::NoAddress,
            &WifiReport::NetworkLost,
            &WifiReport::FallbackToAccessPoint,
            &WifiReport::OffAfterCrash,
            &WifiReport::NoEntropy,
            &CanReport::ImpossibleBitRate,
            &CanReport::NoAnswer,
            &CanReport::Reconfigured,
            &CanReport::Passive,
            &CanReport::BusOff(2),
            &CanReport::Working,
            &CanReport::NoInterrupt,
            &CanReport::FramesLost(7),
            &CanNotice::Appeared(node),
            &CanNotice::Lost(node),
            &CanNotice::Restarted(node),
            &CanNotice::OwnId(node),
            &CanNotice::SameId(node),
            &CanNotice::Assigned(node),
            &CanNotice::NoIdLeft,
            &CanNotice::Source(Pack::Second, node),
            &CanNotice::Critical(Pack::Second, node),
            &CanNotice::Charger(Pack::Second, ChargerPower::On),
            &CanNotice::Charger(Pack::Second, ChargerPower::Off),
            &SigningChange::KeySet,
            &SigningChange::KeyRemoved,
            &SigningTrouble::KeyLost,
            &SigningTrouble::NotSaved,
            &Notice::Unauthorized {
                link: "UART",
                count: 5,
            },
            &Notice::TooOld { link: "UART" },
            &Notice::SharedIds {
                link: "UART",
                ids: [255, 190],
            },
            &refused(Refused::OutOfRange),
            &refused(Refused::OtherChemistry),
            &refused(Refused::ReadOnly),
            &refused(Refused::Armed),
            &refused(Refused::NotWhileArmed),
            &Notice::BatteriesReset {
                link: "UART",
                packs: PackSet::from_bits(0b101),
                percent: 100.0,
            },
            &Notice::LogsErased { link: "UART" },
            &Notice::LearntErased {
                link: "UART",
                pack: Pack::Second,
            },
            &Notice::PowerWentOff,
            &Notice::ResetWhileArmed,
            &Notice::LongTimeOut {
                parameter: VehicleParameter::FsTimeout,
                seconds: 7.5,
            },
            &LogFailure::Full,
            &LogFailure::NotWritten,
            &Notice::LogWearsFlash,
            &CrashLine("Crashed"),
        ];
        let serial = serial.iter().map(|notice| notice as &dyn Announce);
        let lines: Vec<_> = announcements.into_iter().chain(serial).map(line).collect();
        let expected = "\
warning: Battery 1 measured by component 191
warning: Battery 1 voltage above MOT_DRV_VOLT
warning: RTL needs a position: Hold
critical: Terminated by battery failsafe
warning: Radio Failsafe: Hold
warning: GCS Failsafe: Hold
warning: Battery failsafes are off: set BATT_LOW_VOLT
notice: Set BATT_LOW_VOLT 10.50, BATT_CRT_VOLT 10.20
critical: 5 quick resets: started with default parameters
critical: Parameter storage damaged: check parameters
warning: All parameters reset to their defaults
critical: Stored parameters not read: restart
critical: Parameters damaged: check them, then set PARAM_CHECKED 1
critical: Parameters half loaded: check them, then set PARAM_CHECKED 1
critical: Parameters half loaded, 12 missing: check them, then set PARAM_CHECKED 1
critical: Stored BATT_CAPACITY does not fit: check them, then set PARAM_CHECKED 1
critical: Stored BATT_CAPACITY, BATT_CAPACITY do not fit: check, then set PARAM_CHECKED 1
warning: 3 stored parameters unknown: kept
warning: Parameters: 2 not saved until disarmed
critical: Parameters can't be saved: too many changed
critical: Parameters can't be saved: flash worn out?
info: Parameters saved
warning: Learnt battery data not saved until disarmed
warning: Learnt battery data not saved: flash worn out?
warning: Wi-Fi settings not saved until disarmed
warning: Wi-Fi settings not saved: flash worn out?
warning: Wi-Fi radio does not answer
warning: Wi-Fi radio does not take its firmware
warning: No Wi-Fi radio found: GP29 free after a restart
info: Wi-Fi access point on
info: Wi-Fi network joined
info: Wi-Fi address 192.168.4.2
warning: Wi-Fi network not found
warning: Wi-Fi network can't be joined
warning: Wi-Fi network refuses the password
warning: Wi-Fi network gives no address
warning: Wi-Fi network lost
warning: No Wi-Fi network: access point instead
warning: Wi-Fi off after a crash: restart the board
warning: Wi-Fi off: no random numbers for a password
warning: CAN off: 1 Mbit/s needs a 16 MHz crystal
warning: CAN controller does not answer
warning: CAN controller was reset and configured again
warning: CAN bus has errors: check wires and bit rate
warning: CAN bus off, times: 2
info: CAN bus works
warning: CAN interrupt line GP17 does not work
warning: CAN frames lost: 7
info: CAN node 10 found
warning: CAN node 10 lost
warning: CAN node 10 restarted
info: CAN node id 10 assigned to this board
warning: CAN node id 10 used twice
info: CAN node id 10 assigned
warning: CAN: no node id left to assign
info: Battery 2 measured by CAN node 10
warning: Battery 2 CAN node 10 reports critical health
info: Battery 2 charger switched on
info: Battery 2 charger switched off
info: Signing key set
info: Signing key removed: commands are accepted from anyone
critical: Signing key lost: set up by USB (used Pico: erase)
critical: Signing not saved: set it up again after a restart
warning: UART: not signed with the key, ignored: 5
warning: UART: signed frames too old: does the station hear the rover?
warning: UART: two stations are 255/190? Give each its own id
warning: BATT_CAPACITY refused: valid 0 to 1000000
warning: BATT_CAPACITY refused: no such cell by its CHEM
warning: Param write denied (BATT_CAPACITY)
warning: BATT_CAPACITY refused: not raised while armed
warning: BATT_CAPACITY refused: not changed while armed
notice: UART: reset to 100%, battery 1, 3
notice: UART: logs erased
notice: UART: learnt data of battery 2 erased
info: Power went off while armed
info: Reset while armed
warning: Armed with FS_TIMEOUT 7.50: drives on for long without a driver
warning: Log full until disarmed
warning: Log not written: flash worn out?
warning: Logging wears out this flash chip: set LOG_BITMASK 0
critical: Crashed
critical: Fuel cell error 0x400
warning: Fuel cell error 0x10
info: Fuel cell: no error any more
warning: Fuel cell error 20
critical: Fuel cell error 33.7
info: Fuel cell running
warning: Fuel cell has failed
info: Torqeedo: no error";
        assert_eq!(lines.join("\n"), expected);
    }

    #[test]
    fn a_suggestion_can_be_copied_and_fits_one_message() {
        let suggested = SuggestedThresholds {
            low_v: 16.0 * 3.5,
            critical_v: 16.0 * 3.4,
        };
        let text = Notice::Suggestion(Pack::Ninth, suggested).text();
        assert_eq!(text, "Set BATT9_LOW_VOLT 56.00, BATT9_CRT_VOLT 54.40");
        assert!(text.len() <= 50);
    }

    #[test]
    fn long_text_is_cut_off_behind_a_whole_word() {
        let line = format!("Crashed {}°C", "x".repeat(95));
        assert_eq!(CrashLine(&line).text().as_str(), "Crashed...");
    }
}
