//! Indications of the rover's lamps and buzzer.

/// Urgency of a pack's need for attention, for lamps and buzzer, in increasing order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum BatteryAlert {
    /// Not at all.
    #[default]
    None,
    /// It is being charged.
    Charging,
    /// It is low, has a fault, or its sensor has failed while armed.
    Warning,
    /// It is critical, nearly empty, or has failed.
    Urgent,
}

/// A colour of the rover's lamps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Colour {
    /// Lamps off.
    #[default]
    Off,
    /// Disarmed, no failure.
    Green,
    /// Armed.
    Blue,
    /// Disarmed, and a pack is being charged.
    White,
    /// A pack is low or has a fault, its sensor has failed while armed, or control inputs or ground stations have timed
    /// out.
    Yellow,
    /// A pack is critical, nearly empty or has failed, or the rover is terminated.
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

/// The present indication.
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
    /// Shows `indication` from now on; called repeatedly, also with the same one.
    fn show(&mut self, indication: Indication);
}
