//! Announcements to ground stations, with their severities.

use core::fmt;
use core::mem::{Discriminant, discriminant};

use heapless::String;

use super::recording::LogFailure;
use crate::battery::{ChargeState, FailsafeLevel, PackEvent, SuggestedThresholds};
use crate::mavlink::dialect::MavSeverity;
use crate::mavlink::{BroadcastCommand, SigningChange, SigningTrouble};
use crate::memory::storage::StorageError;
use crate::numbers::{Hundredths, text};
use crate::pack::{MAX_PACKS, Pack};
use crate::parameter::{
    BatteryParameter, ParameterId, ParameterTrouble, Refused, SaveFailure, VehicleParameter,
};
use crate::sensor::{CanNotice, CanReport, SerialNotice, Urgency};
use crate::vehicle::VehicleEvent;
use crate::wifi::WifiReport;

/// Maximum length of an announcement, in bytes: two STATUSTEXT. The rest is cut off.
pub const ANNOUNCEMENT_BYTES: usize = 96;

/// The text of an announcement.
pub type AnnouncementText = String<ANNOUNCEMENT_BYTES>;

/// Something that ground stations are informed of by STATUSTEXT.
#[derive(Clone, Copy, Debug)]
pub enum Announcement<'a> {
    /// An event of a pack.
    Pack(Pack, &'a PackEvent),
    /// The vehicle changed its state without a request.
    Vehicle(VehicleEvent),
    /// Packs are monitored, and none of them has a failsafe threshold in effect; with the parameter to set.
    FailsafesOff(ParameterId),
    /// Thresholds for a pack without any.
    Suggestion(Pack, SuggestedThresholds),
    /// The stored parameters were not loaded, after repeated quick resets.
    DefaultParameters,
    /// The last stored parameter could not be read.
    LastParameterLost,
    /// A ground station has set all parameters to their defaults.
    ParametersReset,
    /// The parameters may not be the owner's.
    Parameters(ParameterTrouble),
    /// This many stored parameters are of another version.
    ParametersUnknown(u16),
    /// Parameters can't be written to flash.
    ParametersNotSaved(SaveFailure),
    /// Parameters can be written again.
    ParametersSaved,
    /// Learnt data of a pack can't be written to flash.
    LearntNotSaved(StorageError),
    /// Names or passwords of Wi-Fi networks can't be written to flash.
    WifiNotSaved(StorageError),
    /// The radio, the access point or the network to join.
    Wifi(WifiReport),
    /// The controller of the CAN bus.
    Can(CanReport),
    /// A node on the CAN bus.
    CanNode(CanNotice),
    /// The state of the device on the serial line.
    Serial(SerialNotice),
    /// A signing key, or its removal, is in flash.
    SigningSaved(SigningChange),
    /// The signing key is lost, or can't be written to flash.
    Signing(SigningTrouble),
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
    /// There is no log although there should be one.
    NoLog(LogFailure),
    /// Each page of the log stores a register of the flash chip.
    LogWearsFlash,
    /// A line of a crash report.
    Crash(&'a str),
}

/// What shares a limit: a kind of text, not its wording, which may differ by a node, a count or an address. What is of a
/// pack has a limit for each pack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Pack(Pack, Discriminant<PackEvent>),
    Can(Discriminant<CanReport>),
    CanNode(Option<Pack>, Discriminant<CanNotice>),
    Serial(Discriminant<SerialNotice>),
    Wifi(Discriminant<WifiReport>),
    Unauthorized,
    TooOld,
    ParameterRefused,
    /// Reports of the board itself.
    Board,
}

impl Kind {
    /// How many may be announced at once, at least 1: one of each pack, or of as many nodes. States that come and go
    /// have one.
    pub fn at_once(self) -> u8 {
        match self {
            Self::Can(_) | Self::Unauthorized | Self::TooOld => 1,
            Self::Pack(..)
            | Self::CanNode(..)
            | Self::Serial(_)
            | Self::Wifi(_)
            | Self::ParameterRefused
            | Self::Board => MAX_PACKS as u8,
        }
    }
}

impl Announcement<'_> {
    /// The kind whose limit it shares.
    pub(super) fn kind(&self) -> Kind {
        match self {
            Self::Pack(pack, event) => Kind::Pack(*pack, discriminant(*event)),
            Self::Can(report) => Kind::Can(discriminant(report)),
            Self::CanNode(notice) => Kind::CanNode(notice.pack(), discriminant(notice)),
            Self::Serial(notice) => Kind::Serial(discriminant(notice)),
            Self::Wifi(report) => Kind::Wifi(discriminant(report)),
            Self::Unauthorized { .. } => Kind::Unauthorized,
            Self::TooOld { .. } => Kind::TooOld,
            Self::ParameterRefused { .. } => Kind::ParameterRefused,
            Self::Vehicle(_)
            | Self::FailsafesOff(_)
            | Self::Suggestion(..)
            | Self::DefaultParameters
            | Self::LastParameterLost
            | Self::ParametersReset
            | Self::Parameters(_)
            | Self::ParametersUnknown(_)
            | Self::ParametersNotSaved(_)
            | Self::ParametersSaved
            | Self::LearntNotSaved(_)
            | Self::WifiNotSaved(_)
            | Self::SigningSaved(_)
            | Self::Signing(_)
            | Self::LongTimeOut { .. }
            | Self::NoLog(_)
            | Self::LogWearsFlash
            | Self::Crash(_) => Kind::Board,
        }
    }

    /// Its severity. A low battery is a warning, as in ArduPilot; a critical one is critical, where ArduPilot has a warning.
    pub fn severity(&self) -> MavSeverity {
        match self {
            // A ground station shows what is critical in a box.
            Self::Pack(
                _,
                PackEvent::Failsafe {
                    level: FailsafeLevel::Critical,
                    ..
                }
                | PackEvent::Charge {
                    state: ChargeState::Critical | ChargeState::Emergency,
                    ..
                },
            ) => MavSeverity::MAV_SEVERITY_CRITICAL,
            Self::Pack(
                _,
                PackEvent::CellsDetected { .. }
                | PackEvent::SensorRecovered
                | PackEvent::ContactRestored
                | PackEvent::Found { .. }
                | PackEvent::Charging
                | PackEvent::Learnt { .. }
                | PackEvent::NotLearnt(_),
            ) => MavSeverity::MAV_SEVERITY_NOTICE,
            Self::Pack(
                _,
                PackEvent::CellsAmbiguous { .. }
                | PackEvent::Swapped
                | PackEvent::EstimateRestarted
                | PackEvent::ContactLost
                | PackEvent::Gap(_)
                | PackEvent::CurrentOverRange
                | PackEvent::CurrentReversed
                | PackEvent::AboveDrivers
                | PackEvent::PowerLimited(_)
                | PackEvent::NotFound { .. }
                | PackEvent::CapacityAboveLabel
                | PackEvent::SensorFailed(_)
                | PackEvent::PoweringOff
                | PackEvent::MembersLeft(_)
                | PackEvent::Charge { .. }
                | PackEvent::Faults(_)
                | PackEvent::ReportedFaults(_)
                | PackEvent::Failsafe { .. },
            ) => MavSeverity::MAV_SEVERITY_WARNING,
            Self::Vehicle(VehicleEvent::Terminated) => MavSeverity::MAV_SEVERITY_CRITICAL,
            Self::Vehicle(
                VehicleEvent::NeedsPosition(_)
                | VehicleEvent::ControlsTimedOut
                | VehicleEvent::GroundStationsTimedOut,
            ) => MavSeverity::MAV_SEVERITY_WARNING,
            Self::Suggestion(..) => MavSeverity::MAV_SEVERITY_NOTICE,
            Self::SigningSaved(_) | Self::ParametersSaved => MavSeverity::MAV_SEVERITY_INFO,
            Self::ParametersNotSaved(SaveFailure {
                error: StorageError::NoErasedSpace,
                ..
            }) => MavSeverity::MAV_SEVERITY_WARNING,
            Self::Wifi(report) if report.is_fault() => MavSeverity::MAV_SEVERITY_WARNING,
            Self::Can(report) if report.is_fault() => MavSeverity::MAV_SEVERITY_WARNING,
            Self::CanNode(notice) if notice.is_fault() => MavSeverity::MAV_SEVERITY_WARNING,
            Self::Wifi(_) | Self::Can(_) | Self::CanNode(_) => MavSeverity::MAV_SEVERITY_INFO,
            Self::Serial(notice) => match notice.urgency() {
                Urgency::Info => MavSeverity::MAV_SEVERITY_INFO,
                Urgency::Warning => MavSeverity::MAV_SEVERITY_WARNING,
                Urgency::Critical => MavSeverity::MAV_SEVERITY_CRITICAL,
            },
            Self::FailsafesOff(_)
            | Self::ParametersReset
            | Self::ParametersUnknown(_)
            | Self::LearntNotSaved(_)
            | Self::WifiNotSaved(_)
            | Self::NoLog(_)
            | Self::LogWearsFlash
            | Self::ParameterRefused { .. }
            | Self::LongTimeOut { .. }
            | Self::Unauthorized { .. }
            | Self::TooOld { .. } => MavSeverity::MAV_SEVERITY_WARNING,
            Self::DefaultParameters
            | Self::LastParameterLost
            | Self::Parameters(_)
            | Self::ParametersNotSaved(_)
            | Self::Signing(_)
            | Self::Crash(_) => MavSeverity::MAV_SEVERITY_CRITICAL,
        }
    }

    /// The command it is sent as, too: a companion computer may act on it.
    pub fn command(&self) -> Option<BroadcastCommand> {
        match self {
            Self::Pack(pack, PackEvent::PoweringOff) => Some(BroadcastCommand::power_off_initiated(*pack)),
            _ => None,
        }
    }

    /// The text, cut off if it is too long.
    pub fn text(&self) -> AnnouncementText {
        text(format_args!("{self}"))
    }

    /// The text, after this many of its kind were left out.
    pub(super) fn text_after(&self, left_out: u16) -> AnnouncementText {
        match left_out {
            0 => self.text(),
            _ => text(format_args!("{self} (+{left_out} left out)")),
        }
    }
}

impl fmt::Display for Announcement<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Pack(pack, event) => {
                write!(f, "Battery {} {event}", pack.number())?;
                let cells = BatteryParameter::Cells.of(*pack).name();
                match event {
                    PackEvent::CellsDetected { .. } => write!(f, " (set {cells} to be sure)"),
                    PackEvent::CellsAmbiguous { .. } => write!(f, ": set {cells}"),
                    _ => Ok(()),
                }
            }
            Self::Vehicle(event) => write!(f, "{event}"),
            Self::FailsafesOff(id) => write!(f, "Battery failsafes are off: set {}", id.name()),
            Self::Suggestion(pack, suggested) => write!(
                f,
                "Set {} {}, {} {}",
                BatteryParameter::LowVolt.of(*pack).name(),
                Hundredths(suggested.low_v),
                BatteryParameter::CrtVolt.of(*pack).name(),
                Hundredths(suggested.critical_v)
            ),
            Self::DefaultParameters => f.write_str("5 quick resets: started with default parameters"),
            Self::LastParameterLost => f.write_str("Parameter storage damaged: check parameters"),
            Self::ParametersReset => f.write_str("All parameters reset to their defaults"),
            Self::Parameters(trouble) => trouble.fmt(f),
            Self::ParametersUnknown(count) => write!(f, "{count} stored parameters unknown: kept"),
            Self::ParametersNotSaved(failure) => write!(f, "{failure}"),
            Self::ParametersSaved => f.write_str("Parameters saved"),
            Self::LearntNotSaved(StorageError::NoErasedSpace) => {
                f.write_str("Learnt battery data not saved until disarmed")
            }
            Self::LearntNotSaved(_) => f.write_str("Learnt battery data not saved: flash worn out?"),
            Self::WifiNotSaved(StorageError::NoErasedSpace) => {
                f.write_str("Wi-Fi settings not saved until disarmed")
            }
            Self::WifiNotSaved(_) => f.write_str("Wi-Fi settings not saved: flash worn out?"),
            Self::Wifi(report) => write!(f, "{report}"),
            Self::Can(report) => write!(f, "{report}"),
            Self::CanNode(notice) => write!(f, "{notice}"),
            Self::Serial(notice) => write!(f, "{notice}"),
            Self::SigningSaved(change) => f.write_str(change.text()),
            Self::NoLog(LogFailure::Full) => f.write_str("Log full until disarmed"),
            Self::NoLog(LogFailure::NotWritten) => f.write_str("Log not written: flash worn out?"),
            Self::LogWearsFlash => f.write_str("Logging wears out this flash chip: set LOG_BITMASK 0"),
            Self::Signing(trouble) => f.write_str(trouble.text()),
            Self::Unauthorized { link, count } => {
                write!(f, "{link}: not signed with the key, ignored: {count}")
            }
            Self::TooOld { link } => {
                write!(
                    f,
                    "{link}: signed frames too old: does the station hear the rover?"
                )
            }
            Self::ParameterRefused { id, why } => match why {
                Refused::OutOfRange => write!(f, "{} refused: valid {}", id.name(), id.row().range),
                // ArduPilot's text.
                Refused::ReadOnly => write!(f, "Param write denied ({})", id.name()),
                Refused::Armed => write!(f, "{} refused: not raised while armed", id.name()),
            },
            Self::LongTimeOut { parameter, seconds } => write!(
                f,
                "Armed with {} {}: drives on for long without a driver",
                parameter.row().name,
                Hundredths(*seconds)
            ),
            Self::Crash(line) => f.write_str(line),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::battery::{Amount, ChargeState, FailsafeLevel, Faults, Gap, LessonObstacle, ReadError};
    use crate::memory::storage::FlashFault;
    use crate::sensor::{ChargerPower, FuelCellError, FuelCellState, NodeId, TorqeedoCondition};
    use crate::vehicle::FailsafeAction;

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
                "Battery 9 has 3 cells (set BATT9_CELLS to be sure)",
            ),
            (
                PackEvent::CellsAmbiguous { voltage_v: 8.85 },
                "Battery 9 cells unclear at 8.85V: set BATT9_CELLS",
            ),
            (PackEvent::Swapped, "Battery 9 swapped: estimates restarted"),
            (PackEvent::EstimateRestarted, "Battery 9 estimate restarted"),
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
                PackEvent::CurrentOverRange,
                "Battery 9 current over range: consumption too low",
            ),
            (
                PackEvent::SensorFailed(ReadError::AddressTaken),
                "Battery 9 unhealthy: address already in use",
            ),
            (
                PackEvent::PowerLimited(32_767.0),
                "Battery 9 limits the motors: over 32767W",
            ),
            (
                PackEvent::NotFound {
                    address: Some(0x40),
                    answering: [Some(0x0b), Some(0x41), None, None, None],
                },
                "Battery 9 not found at 0x40: the bus answers at 0x0b, 0x41",
            ),
            (
                PackEvent::NotFound {
                    address: None,
                    answering: [None; 5],
                },
                "Battery 9 not found: nothing answers",
            ),
            (
                PackEvent::Found {
                    address: 0x0b,
                    cells: 4,
                },
                "Battery 9 found at 0x0b, 4 cells",
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
                PackEvent::Faults(Faults::CELL_FAIL | Faults::OVER_CURRENT),
                "Battery 9 fault: cell failed, over current",
            ),
            (
                PackEvent::ReportedFaults(Faults::BAD_BATTERY | Faults::OVER_TEMPERATURE),
                "Battery 9 reports: bad battery, over temperature",
            ),
            (
                PackEvent::Faults(Faults::all() - Faults::CELL_DIFFERS - Faults::UNDER_TEMPERATURE),
                "Battery 9 fault: cell failed, deep discharge, over temperature, over current, voltage does not f",
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
                failsafe(FailsafeLevel::Critical, Amount::Ml(-1e9)),
                "Battery 9 is critical, used -1000000000 ml",
            ),
        ] {
            assert_eq!(Announcement::Pack(Pack::Ninth, &event).text(), expected);
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
            assert_eq!(Announcement::Vehicle(event).text(), expected);
        }
    }

    /// Severity and text, for one place of each event in the sources.
    fn line(announcement: &Announcement<'_>) -> std::string::String {
        let severity = match announcement.severity() {
            MavSeverity::MAV_SEVERITY_INFO => "info",
            MavSeverity::MAV_SEVERITY_NOTICE => "notice",
            MavSeverity::MAV_SEVERITY_WARNING => "warning",
            MavSeverity::MAV_SEVERITY_CRITICAL => "critical",
            other => panic!("{other:?} is not announced"),
        };
        format!("{severity}: {}", announcement.text())
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
            voltage_v: 10.0,
            consumed: Amount::Mah(900.0),
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
            PackEvent::CurrentOverRange,
            PackEvent::CurrentReversed,
            PackEvent::AboveDrivers,
            PackEvent::SensorFailed(ReadError::Timeout),
            PackEvent::SensorRecovered,
            PackEvent::PoweringOff,
            PackEvent::MembersLeft(0b11),
            charge(ChargeState::Low),
            charge(ChargeState::Critical),
            charge(ChargeState::Emergency),
            PackEvent::Charging,
            learnt,
            PackEvent::CapacityAboveLabel,
            PackEvent::NotLearnt(LessonObstacle::NoRest),
            PackEvent::Faults(Faults::SPIKES),
            PackEvent::ReportedFaults(Faults::SPIKES),
            failsafe(FailsafeLevel::Unhealthy),
            failsafe(FailsafeLevel::Low),
            failsafe(FailsafeLevel::Critical),
        ];
        let lines = events.map(|event| line(&Announcement::Pack(Pack::First, &event)));
        let expected = "\
notice: Battery 1 has 3 cells (set BATT_CELLS to be sure)
warning: Battery 1 cells unclear at 8.85V: set BATT_CELLS
warning: Battery 1 swapped: estimates restarted
warning: Battery 1 estimate restarted
warning: Battery 1 not connected
notice: Battery 1 connected again
warning: Battery 1 not measured for 3s: consumption too low
warning: Battery 1 current over range: consumption too low
warning: Battery 1 current sensor reversed?
warning: Battery 1 voltage above MOT_DRV_VOLT
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
        let not_saved = |error| Announcement::ParametersNotSaved(SaveFailure { error, changes: 2 });
        let refused = |why| Announcement::ParameterRefused { id, why };
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
        let announcements = [
            Announcement::Vehicle(VehicleEvent::NeedsPosition(FailsafeAction::Rtl)),
            Announcement::Vehicle(VehicleEvent::Terminated),
            Announcement::Vehicle(VehicleEvent::ControlsTimedOut),
            Announcement::Vehicle(VehicleEvent::GroundStationsTimedOut),
            Announcement::FailsafesOff(BatteryParameter::LowVolt.of(Pack::First)),
            Announcement::Suggestion(
                Pack::First,
                SuggestedThresholds {
                    low_v: 10.5,
                    critical_v: 10.2,
                },
            ),
            Announcement::DefaultParameters,
            Announcement::LastParameterLost,
            Announcement::ParametersReset,
            Announcement::Parameters(ParameterTrouble::NotRead),
            Announcement::Parameters(ParameterTrouble::Damaged),
            Announcement::Parameters(ParameterTrouble::HalfLoaded),
            Announcement::Parameters(ParameterTrouble::DoesNotFit(id)),
            Announcement::ParametersUnknown(3),
            not_saved(StorageError::NoErasedSpace),
            not_saved(StorageError::Full),
            not_saved(flash),
            Announcement::ParametersSaved,
            Announcement::LearntNotSaved(StorageError::NoErasedSpace),
            Announcement::LearntNotSaved(flash),
            Announcement::WifiNotSaved(StorageError::NoErasedSpace),
            Announcement::WifiNotSaved(flash),
            Announcement::Wifi(WifiReport::NoAnswer),
            Announcement::Wifi(WifiReport::DownloadFailed),
            Announcement::Wifi(WifiReport::NoRadio),
            Announcement::Wifi(WifiReport::AccessPointUp),
            Announcement::Wifi(WifiReport::Joined),
            Announcement::Wifi(WifiReport::AddressObtained([192, 168, 4, 2])),
            Announcement::Wifi(WifiReport::NetworkNotFound),
            Announcement::Wifi(WifiReport::JoinFailed),
            Announcement::Wifi(WifiReport::WrongPassword),
            Announcement::Wifi(WifiReport::NoAddress),
            Announcement::Wifi(WifiReport::NetworkLost),
            Announcement::Wifi(WifiReport::FallbackToAccessPoint),
            Announcement::Wifi(WifiReport::OffAfterCrash),
            Announcement::Wifi(WifiReport::NoEntropy),
            Announcement::Can(CanReport::ImpossibleBitRate),
            Announcement::Can(CanReport::NoAnswer),
            Announcement::Can(CanReport::Reconfigured),
            Announcement::Can(CanReport::Passive),
            Announcement::Can(CanReport::BusOff(2)),
            Announcement::Can(CanReport::Working),
            Announcement::Can(CanReport::NoInterrupt),
            Announcement::Can(CanReport::FramesLost(7)),
            Announcement::CanNode(CanNotice::Appeared(node)),
            Announcement::CanNode(CanNotice::Lost(node)),
            Announcement::CanNode(CanNotice::Restarted(node)),
            Announcement::CanNode(CanNotice::OwnId(node)),
            Announcement::CanNode(CanNotice::SameId(node)),
            Announcement::CanNode(CanNotice::Assigned(node)),
            Announcement::CanNode(CanNotice::NoIdLeft),
            Announcement::CanNode(CanNotice::Source(Pack::Second, node)),
            Announcement::CanNode(CanNotice::Charger(Pack::Second, ChargerPower::On)),
            Announcement::CanNode(CanNotice::Charger(Pack::Second, ChargerPower::Off)),
            Announcement::SigningSaved(SigningChange::KeySet),
            Announcement::SigningSaved(SigningChange::KeyRemoved),
            Announcement::Signing(SigningTrouble::KeyLost),
            Announcement::Signing(SigningTrouble::NotSaved),
            Announcement::Unauthorized {
                link: "UART",
                count: 5,
            },
            Announcement::TooOld { link: "UART" },
            refused(Refused::OutOfRange),
            refused(Refused::ReadOnly),
            refused(Refused::Armed),
            Announcement::LongTimeOut {
                parameter: VehicleParameter::FsTimeout,
                seconds: 7.5,
            },
            Announcement::NoLog(LogFailure::Full),
            Announcement::NoLog(LogFailure::NotWritten),
            Announcement::LogWearsFlash,
            Announcement::Crash("Crashed"),
        ];
        let serial = serial.map(Announcement::Serial);
        let lines: Vec<_> = announcements.iter().chain(&serial).map(line).collect();
        let expected = "\
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
critical: Stored BATT_CAPACITY does not fit: check them, then set PARAM_CHECKED 1
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
info: Battery 2 charger switched on
info: Battery 2 charger switched off
info: Signing key set
info: Signing key removed: commands are accepted from anyone
critical: Signing key lost: set up by USB (used Pico: erase)
critical: Signing not saved: set it up again after a restart
warning: UART: not signed with the key, ignored: 5
warning: UART: signed frames too old: does the station hear the rover?
warning: BATT_CAPACITY refused: valid 0 to 1000000
warning: Param write denied (BATT_CAPACITY)
warning: BATT_CAPACITY refused: not raised while armed
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
        let text = Announcement::Suggestion(Pack::Ninth, suggested).text();
        assert_eq!(text, "Set BATT9_LOW_VOLT 56.00, BATT9_CRT_VOLT 54.40");
        assert!(text.len() <= 50);
    }

    #[test]
    fn only_a_pack_that_powers_off_is_announced_by_a_command() {
        let command = |event| Announcement::Pack(Pack::Ninth, &event).command();
        let power_off = BroadcastCommand {
            number: 42000,
            param1: 9.0,
        };
        assert_eq!(command(PackEvent::PoweringOff), Some(power_off));
        for event in [PackEvent::ContactLost, PackEvent::Swapped] {
            assert_eq!(command(event), None);
        }
        let off = Announcement::FailsafesOff(BatteryParameter::LowVolt.of(Pack::First));
        assert_eq!(off.command(), None);
    }

    #[test]
    fn long_text_is_cut_off_at_a_whole_character() {
        let line = format!("{}°C", "x".repeat(95));
        assert_eq!(Announcement::Crash(&line).text().as_str(), "x".repeat(95));
    }
}
