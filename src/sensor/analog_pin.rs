//! The pins of the board's converter.

/// An analog pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum AnalogPin {
    /// GP26, ADC0
    Gp26,
    /// GP27, ADC1
    Gp27,
    /// GP28, ADC2
    Gp28,
    /// GP29, ADC3
    Gp29,
}

impl AnalogPin {
    /// All analog pins, in the order of their discriminants.
    pub const ALL: [Self; 4] = [Self::Gp26, Self::Gp27, Self::Gp28, Self::Gp29];

    /// The pin with this GPIO number (`BATT_VOLT_PIN`, `BATT_CURR_PIN`).
    pub fn from_gpio(number: i32) -> Option<Self> {
        match number {
            26 => Some(Self::Gp26),
            27 => Some(Self::Gp27),
            28 => Some(Self::Gp28),
            29 => Some(Self::Gp29),
            _ => None,
        }
    }
}
