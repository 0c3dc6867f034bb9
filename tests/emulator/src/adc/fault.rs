//! Faults of the converter, put in by a test.

/// A fault that a test puts in. Those of a number of conversions end with the last of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AdcFault {
    #[default]
    None,
    /// Conversions start and never finish: CS.READY stays low.
    Stalled,
    /// Conversions finish with CS.ERR set.
    ConversionError,
    /// This number of conversions do, from the next one on.
    ConversionErrors(u32),
    /// One conversion of this number does, counted from power-up.
    ConversionErrorInEvery(u32),
    /// The results of this number of conversions, from the next one on, do not reach the FIFO. All else is as without the fault:
    /// CS.AINSEL goes on in round robin, and RESULT has the code.
    LostConversions(u32),
}

/// The end of a conversion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    Good,
    Error,
    Lost,
}

impl AdcFault {
    /// Ends a conversion; `conversions_before` have ended since power-up.
    pub fn end_conversion(&mut self, conversions_before: u64) -> Outcome {
        let number = conversions_before + 1;
        let outcome = match *self {
            Self::ConversionErrorInEvery(interval) if number.is_multiple_of(interval.into()) => {
                Outcome::Error
            }
            Self::None | Self::Stalled | Self::ConversionErrorInEvery(_) => Outcome::Good,
            Self::ConversionErrors(0) | Self::LostConversions(0) => Outcome::Good,
            Self::ConversionError | Self::ConversionErrors(_) => Outcome::Error,
            Self::LostConversions(_) => Outcome::Lost,
        };
        if let Self::ConversionErrors(left) | Self::LostConversions(left) = self {
            *left = left.saturating_sub(1);
        }
        outcome
    }
}
