//! Conditions that devices on the serial line report, for ground stations.

use core::fmt;

use crate::announce::{Announce, Limit, Severity};

/// Error flags of 650 W and 800 W with which ArduPilot acts as on a critical pack.
const CRITICAL_FLAGS: u32 = 0xfbed_c460;

/// Errors with which it acts as on a low pack.
const LOW_FLAGS: u32 = 0x0412_3b98;

/// Error codes of 2.4 kW: up to these they are notes or warnings.
const LAST_NOTE: u32 = 9;
const LAST_WARNING: u32 = 20;

/// Errors that a fuel cell reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FuelCellError {
    /// Of 650 W and 800 W: flags, as the manual lists them.
    Flags(u32),
    /// Of 2.4 kW: a code and its detail, both 0 if nothing is wrong.
    Code(u32, u32),
}

impl FuelCellError {
    /// Nothing is wrong.
    pub(in crate::sensor::serial) const NONE: Self = Self::Code(0, 0);

    /// By the flags of 650 W and 800 W; those without a meaning are left out.
    pub(in crate::sensor::serial) fn of_flags(flags: u32) -> Self {
        Self::Flags(flags & (CRITICAL_FLAGS | LOW_FLAGS)).or_none()
    }

    /// Whatever means that nothing is wrong, in one way.
    fn or_none(self) -> Self {
        match self {
            Self::Flags(0) => Self::NONE,
            _ => self,
        }
    }

    /// Severity of a change to it, as in ArduPilot.
    pub(in crate::sensor::serial) fn severity(self) -> Severity {
        match self {
            Self::Flags(flags) if flags & CRITICAL_FLAGS != 0 => Severity::Critical,
            Self::Flags(_) => Severity::Warning,
            Self::Code(..=LAST_NOTE, _) => Severity::Info,
            Self::Code(..=LAST_WARNING, _) => Severity::Warning,
            Self::Code(..) => Severity::Critical,
        }
    }
}

impl fmt::Display for FuelCellError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flags(flags) => write!(f, "Fuel cell error 0x{flags:x}"),
            Self::Code(0, 0) => f.write_str("Fuel cell: no error any more"),
            Self::Code(code, 0) => write!(f, "Fuel cell error {code}"),
            Self::Code(code, detail) => write!(f, "Fuel cell error {code}.{detail}"),
        }
    }
}

/// State of a fuel cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FuelCellState {
    /// It is off.
    Off,
    /// It starts.
    Starting,
    /// It can be started.
    Ready,
    /// It supplies.
    Running,
    /// It stops.
    Stopping,
    /// It is about to switch itself off.
    FallingAsleep,
    /// It has failed.
    Fault,
    /// The battery supplies alone.
    BatteryOnly,
}

impl FuelCellState {
    /// By the code of protocols before 4; `None` if it has no meaning.
    pub(in crate::sensor::serial) fn of_code(code: u32) -> Option<Self> {
        Some(match code {
            0 => Self::Starting,
            1 => Self::Ready,
            2 => Self::Running,
            3 => Self::Fault,
            8 => Self::BatteryOnly,
            _ => return None,
        })
    }

    /// By the code of protocol 4; `None` if it has no meaning.
    pub(in crate::sensor::serial) fn of_code_of_protocol_4(code: u32) -> Option<Self> {
        Some(match code {
            0 => Self::Off,
            1 => Self::Starting,
            2 => Self::Running,
            3 => Self::Stopping,
            4 => Self::FallingAsleep,
            _ => return None,
        })
    }

    /// Severity of a change to it.
    pub(in crate::sensor::serial) fn severity(self) -> Severity {
        match self {
            Self::Off
            | Self::Starting
            | Self::Ready
            | Self::Running
            | Self::Stopping
            | Self::FallingAsleep => Severity::Info,
            Self::Fault | Self::BatteryOnly => Severity::Warning,
        }
    }
}

impl fmt::Display for FuelCellState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Off => "Fuel cell off",
            Self::Starting => "Fuel cell starting",
            Self::Ready => "Fuel cell ready",
            Self::Running => "Fuel cell running",
            Self::Stopping => "Fuel cell stopping",
            Self::FallingAsleep => "Fuel cell going to sleep",
            Self::Fault => "Fuel cell has failed",
            Self::BatteryOnly => "Fuel cell: battery supplies alone",
        })
    }
}

/// Errors that the generator reports, a bit each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RichenPowerErrors(pub(in crate::sensor::serial) u16);

const NAMES: [&str; 5] = [
    "maintenance required",
    "start disabled",
    "overload",
    "low output voltage",
    "low battery voltage",
];

const MAINTENANCE: u16 = 1;

impl RichenPowerErrors {
    /// Severity of a change to these. Maintenance can wait.
    pub(in crate::sensor::serial) fn severity(self) -> Severity {
        Severity::of_fault(self.0 & !MAINTENANCE != 0)
    }
}

impl fmt::Display for RichenPowerErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Generator: ")?;
        if self.0 == 0 {
            return f.write_str("no error any more");
        }
        let mut separator = "";
        for bit in 0..u16::BITS as usize {
            if self.0 & 1 << bit != 0 {
                f.write_str(separator)?;
                separator = ", ";
                match NAMES.get(bit) {
                    Some(name) => f.write_str(name)?,
                    None => write!(f, "error {bit}")?,
                }
            }
        }
        Ok(())
    }
}

/// Bits of the motor's status (`error_flags`) that are announced. Not bit 8, a time-out of drive commands: this board sends
/// none.
const MOTOR_ERRORS: u16 = 0x06FF;

/// Bits that the motor's status has not.
const TEMPERATURE_WARNING: u16 = 1 << 14;
const NEARLY_EMPTY: u16 = 1 << 15;

/// The bits of these two in the flags of the system state.
const STATE_TEMPERATURE_WARNING: u16 = 1 << 8;
const STATE_NEARLY_EMPTY: u16 = 1 << 10;

const TEXTS: [(u16, &str); 9] = [
    (0x0001, "overcurrent"),
    (0x0002, "motor blocked"),
    (0x0014, "voltage too high"),
    (0x0028, "voltage too low"),
    (0x00C0, "too hot"),
    (0x0200, "no temperature sensor"),
    (0x0400, "motor tilted"),
    (TEMPERATURE_WARNING, "temperature warning"),
    (NEARLY_EMPTY, "battery nearly empty"),
];

/// Errors that a Torqeedo motor or its battery reports; announced when they have changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TorqeedoCondition {
    /// The battery's error code; 0 is none.
    code: u8,
    /// [`MOTOR_ERRORS`] and warnings.
    flags: u16,
}

impl TorqeedoCondition {
    /// From the system state.
    pub(in crate::sensor::serial) fn of_system(flags: u16, code: u8) -> Self {
        let bit = |in_state, bit| if flags & in_state != 0 { bit } else { 0 };
        Self {
            code,
            flags: bit(STATE_TEMPERATURE_WARNING, TEMPERATURE_WARNING)
                | bit(STATE_NEARLY_EMPTY, NEARLY_EMPTY),
        }
    }

    /// From the motor's status.
    pub(in crate::sensor::serial) fn of_motor(error_flags: u16) -> Self {
        Self {
            code: 0,
            flags: error_flags & MOTOR_ERRORS,
        }
    }

    /// Whether nothing is wrong.
    pub fn is_good(&self) -> bool {
        *self == Self::default()
    }
}

/// The error codes of Torqeedo's manuals (such as that of the Travel models) in short; an unknown one has a number only.
fn code_text(code: u8) -> Option<&'static str> {
    Some(match code {
        2 => "motor too hot",
        5 => "motor blocked",
        6 => "motor voltage too low",
        7 => "motor overcurrent",
        8 => "electronics too hot",
        21 => "tiller not calibrated",
        22 => "tiller magnet",
        23 => "tiller range",
        30 => "no motor",
        32 => "no tiller",
        33 => "no communication",
        41 | 42 => "charging voltage",
        43 => "battery empty",
        45 => "battery overcurrent",
        46 => "battery temperature",
        48 => "charging temperature",
        _ => return None,
    })
}

impl fmt::Display for TorqeedoCondition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Torqeedo: ")?;
        if self.is_good() {
            return f.write_str("no error");
        }
        let mut separator = "";
        if self.code != 0 {
            write!(f, "error {}", self.code)?;
            separator = ", ";
        }
        let set = TEXTS.iter().filter(|(mask, _)| self.flags & mask != 0);
        for text in code_text(self.code).into_iter().chain(set.map(|(_, text)| *text)) {
            write!(f, "{separator}{text}")?;
            separator = ", ";
        }
        Ok(())
    }
}

/// A change in the state of a device on the serial line, reported once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SerialNotice {
    /// Errors of a fuel cell.
    FuelCellError(FuelCellError),
    /// State of a fuel cell.
    FuelCellState(FuelCellState),
    /// Errors of RichenPower's generator.
    RichenPower(RichenPowerErrors),
    /// Errors of a Torqeedo motor or its battery.
    Torqeedo(TorqeedoCondition),
}

impl Announce for SerialNotice {
    fn severity(&self) -> Severity {
        match self {
            Self::FuelCellError(error) => error.severity(),
            Self::FuelCellState(state) => state.severity(),
            Self::RichenPower(errors) => errors.severity(),
            Self::Torqeedo(condition) => Severity::of_fault(!condition.is_good()),
        }
    }

    fn limit(&self) -> Limit {
        Limit::of(self)
    }
}

impl fmt::Display for SerialNotice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FuelCellError(error) => write!(f, "{error}"),
            Self::FuelCellState(state) => write!(f, "{state}"),
            Self::RichenPower(errors) => write!(f, "{errors}"),
            Self::Torqeedo(condition) => write!(f, "{condition}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bit_that_is_announced_has_a_text() {
        let all = TEXTS.iter().fold(0, |all, (mask, _)| all | mask);
        assert_eq!(all, MOTOR_ERRORS | TEMPERATURE_WARNING | NEARLY_EMPTY);
    }

    #[test]
    fn text_has_what_is_wrong() {
        let motor = |errors| TorqeedoCondition::of_motor(errors).to_string();
        assert_eq!(motor(0x0100), "Torqeedo: no error");
        assert_eq!(motor(0x0042), "Torqeedo: motor blocked, too hot");
        let system = |flags, code| TorqeedoCondition::of_system(flags, code).to_string();
        let several = "Torqeedo: error 43, battery empty, temperature warning, battery nearly empty";
        assert_eq!(system(0x0503, 43), several);
        assert_eq!(system(0, 99), "Torqeedo: error 99");
        assert_eq!(system(0xFAFF, 0), "Torqeedo: no error");
    }
}
