//! The modes of the rover.

/// A mode, by its name in ArduPilot's Rover. Others need a position, which this rover does not know.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
#[repr(u8)]
pub enum Mode {
    /// It drives as it is told.
    Manual = 0,
    /// It stands still.
    #[default]
    Hold = 4,
}

impl Mode {
    /// The mode with ArduPilot Rover's number for it.
    pub fn from_number(number: u32) -> Option<Self> {
        [Self::Manual, Self::Hold]
            .into_iter()
            .find(|mode| mode.number() == number)
    }

    /// ArduPilot Rover's number for it, MAVLink's `custom_mode`.
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
