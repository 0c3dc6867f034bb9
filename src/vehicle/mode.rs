//! Driving modes.

/// A mode of ArduPilot's Rover. The others need a position estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
#[repr(u8)]
pub enum Mode {
    /// Driven by the sticks.
    Manual = 0,
    /// Brakes.
    #[default]
    Hold = 4,
}

impl Mode {
    /// The mode with this ArduPilot Rover number.
    pub fn from_number(number: u32) -> Option<Self> {
        [Self::Manual, Self::Hold]
            .into_iter()
            .find(|mode| mode.number() == number)
    }

    /// ArduPilot Rover's number: MAVLink's `custom_mode`.
    pub fn number(self) -> u32 {
        self as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_manual_and_hold_have_a_number() {
        for number in 0..300 {
            let mode = Mode::from_number(number);
            assert_eq!(mode.is_some(), [0, 4].contains(&number), "{number}");
            assert!(mode.is_none_or(|mode| mode.number() == number));
        }
    }
}
