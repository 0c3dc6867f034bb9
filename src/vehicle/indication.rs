//! What the rover's lamps and buzzer tell.

/// A colour of the rover's lamps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Colour {
    /// Dark.
    #[default]
    Off,
    /// Disarmed, and nothing is wrong.
    Green,
    /// Armed.
    Blue,
    /// A pack is low, or its sensor fails, or whoever drove the rover is not heard any more.
    Yellow,
    /// A pack is critical, or a failsafe has disarmed the rover for good.
    Red,
}

/// Whether the buzzer sounds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Tone {
    /// Silence.
    #[default]
    Silent,
    /// 2 kHz.
    Sounding,
}

/// What lamps and buzzer show at a moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct Indication {
    /// All lamps.
    pub colour: Colour,
    /// The buzzer.
    pub tone: Tone,
}

/// The rover's lamps and buzzer.
pub trait Indicators {
    /// Shows this from now on. It may be told the same again and again.
    fn show(&mut self, indication: Indication);
}
