//! What is wrong with a generator of RichenPower.

use core::fmt;

use super::Urgency;

/// What the generator reports to be wrong, a bit each.
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
    /// How urgent a change to these is. Maintenance can wait.
    pub(in crate::sensor::serial) fn urgency(self) -> Urgency {
        match self.0 & !MAINTENANCE {
            0 => Urgency::Info,
            _ => Urgency::Warning,
        }
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
