//! What a motor or its battery reports to be wrong.

use core::fmt;

/// Bits of the motor's status (`error_flags`) that are announced. Not bit 8, a time-out of drive commands: this board sends
/// none.
const MOTOR_ERRORS: u16 = 0x06FF;

/// Bits that the motor's status has not.
const TEMPERATURE_WARNING: u16 = 1 << 14;
const NEARLY_EMPTY: u16 = 1 << 15;

/// The same bits in the flags of the system state.
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

/// What a Torqeedo motor or its battery reports to be wrong; announced when it has changed.
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
        let text = |condition: TorqeedoCondition| condition.to_string();
        assert_eq!(text(TorqeedoCondition::of_motor(0x0100)), "Torqeedo: no error");
        assert_eq!(
            text(TorqeedoCondition::of_motor(0x0042)),
            "Torqeedo: motor blocked, too hot"
        );
        assert_eq!(
            text(TorqeedoCondition::of_system(0x0503, 43)),
            "Torqeedo: error 43, battery empty, temperature warning, battery nearly empty"
        );
        assert_eq!(text(TorqeedoCondition::of_system(0, 99)), "Torqeedo: error 99");
        assert_eq!(
            text(TorqeedoCondition::of_system(0xFAFF, 0)),
            "Torqeedo: no error"
        );
    }
}
