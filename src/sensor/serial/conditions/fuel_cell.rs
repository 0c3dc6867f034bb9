//! What a fuel cell of Intelligent Energy does, and what is wrong with it.

use core::fmt;

use super::Urgency;

/// Error flags of 650 W and 800 W with which ArduPilot acts as on a critical pack.
const CRITICAL_FLAGS: u32 = 0xfbed_c460;

/// Those with which it acts as on a low pack.
const LOW_FLAGS: u32 = 0x0412_3b98;

/// Error codes of 2.4 kW: up to these they are notes or warnings.
const LAST_NOTE: u32 = 9;
const LAST_WARNING: u32 = 20;

/// What a fuel cell reports to be wrong.
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

    /// How urgent a change to it is, as in ArduPilot.
    pub(in crate::sensor::serial) fn urgency(self) -> Urgency {
        match self {
            Self::Flags(flags) if flags & CRITICAL_FLAGS != 0 => Urgency::Critical,
            Self::Flags(_) => Urgency::Warning,
            Self::Code(..=LAST_NOTE, _) => Urgency::Info,
            Self::Code(..=LAST_WARNING, _) => Urgency::Warning,
            Self::Code(..) => Urgency::Critical,
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

/// What a fuel cell does.
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

    /// How urgent a change to it is.
    pub(in crate::sensor::serial) fn urgency(self) -> Urgency {
        match self {
            Self::Off
            | Self::Starting
            | Self::Ready
            | Self::Running
            | Self::Stopping
            | Self::FallingAsleep => Urgency::Info,
            Self::Fault | Self::BatteryOnly => Urgency::Warning,
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
