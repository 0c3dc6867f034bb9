//! How long a bit on the bus takes.

use super::CanReport;
use crate::parameter::{Parameters, VehicleParameter};

/// Quanta of a bit after which a controller samples it at 87.5 %, where DroneCAN wants it.
const USUAL_QUANTA: u32 = 16;

/// At least so many quanta make a bit (MCP2515 data sheet DS20001801, 5.1). With two for phase segment 2 it is sampled at 75 %.
const FEWEST_QUANTA: u32 = 8;

/// A quantum is two or more periods of the crystal, by a prescaler of 1 to 64 (DS20001801, 5.1).
const PERIODS: u32 = 2;
const HIGHEST_PRESCALER: u32 = 64;

/// How a bit on the bus is divided, for a controller whose quanta are multiples of two periods of its crystal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitTiming {
    quanta: u8,
    prescaler: u8,
}

impl BitTiming {
    /// The timing of bits at `bit_rate` with a crystal of `crystal_mhz`; `None` if the crystal is too slow for that rate, or
    /// their ratio is odd.
    pub fn new(crystal_mhz: u32, bit_rate: u32) -> Option<Self> {
        let quantum_periods = crystal_mhz.checked_mul(1_000_000 / PERIODS)?;
        let whole = quantum_periods.checked_rem(bit_rate)? == 0;
        let periods = quantum_periods.checked_div(bit_rate).filter(|_| whole)?;
        let quanta = match periods {
            FEWEST_QUANTA => FEWEST_QUANTA,
            _ if periods.is_multiple_of(USUAL_QUANTA) => USUAL_QUANTA,
            _ => return None,
        };
        let prescaler = periods / quanta;
        (1..=HIGHEST_PRESCALER).contains(&prescaler).then_some(Self {
            quanta: quanta as u8,
            prescaler: prescaler as u8,
        })
    }

    /// The timing that the parameters call for; `None` if the bus is not in use.
    ///
    /// # Errors
    /// The crystal is too slow for the bit rate.
    pub fn from_parameters(parameters: &Parameters) -> Result<Option<Self>, CanReport> {
        let whole = |parameter: VehicleParameter| parameters.get_whole(parameter).unsigned_abs();
        if whole(VehicleParameter::CanP1Driver) == 0 {
            return Ok(None);
        }
        let timing = Self::new(
            whole(VehicleParameter::CanP1Crystal),
            whole(VehicleParameter::CanP1Bitrate),
        );
        timing.map(Some).ok_or(CanReport::ImpossibleBitRate)
    }

    /// Quanta of a bit, 8 or 16: the first synchronises, the last two are phase segment 2.
    pub fn quanta(self) -> u8 {
        self.quanta
    }

    /// Double periods of the crystal in a quantum, 1 to 64.
    pub fn prescaler(self) -> u8 {
        self.prescaler
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_rate_of_the_parameter_has_its_timing() {
        for (crystal_mhz, bit_rate, expected) in [
            (16, 1_000_000, Some((8, 1))),
            (16, 500_000, Some((16, 1))),
            (16, 250_000, Some((16, 2))),
            (16, 125_000, Some((16, 4))),
            (8, 1_000_000, None),
            (8, 500_000, Some((8, 1))),
            (8, 250_000, Some((16, 1))),
            (8, 125_000, Some((16, 2))),
        ] {
            let timing = BitTiming::new(crystal_mhz, bit_rate);
            let timing = timing.map(|timing| (timing.quanta(), timing.prescaler()));
            assert_eq!(timing, expected, "{crystal_mhz} MHz, {bit_rate} bit/s");
        }
    }

    #[test]
    fn a_slow_crystal_is_refused_with_the_reason() {
        let mut parameters = Parameters::defaults();
        assert_eq!(BitTiming::from_parameters(&parameters), Ok(None));
        parameters.set(VehicleParameter::CanP1Driver, 1.0).unwrap();
        assert_eq!(
            BitTiming::from_parameters(&parameters),
            Ok(BitTiming::new(16, 1_000_000))
        );
        parameters.set(VehicleParameter::CanP1Crystal, 8.0).unwrap();
        assert_eq!(
            BitTiming::from_parameters(&parameters),
            Err(CanReport::ImpossibleBitRate)
        );
        parameters.set(VehicleParameter::CanP1Bitrate, 500_000.0).unwrap();
        assert_eq!(
            BitTiming::from_parameters(&parameters),
            Ok(BitTiming::new(8, 500_000))
        );
    }

    proptest! {
        /// Whatever is set, there is a timing of exactly that rate or none.
        #[test]
        fn timing_is_exact(crystal_mhz: u32, bit_rate: u32) {
            if let Some(timing) = BitTiming::new(crystal_mhz, bit_rate) {
                let periods = u64::from(timing.quanta()) * u64::from(timing.prescaler()) * 2;
                prop_assert_eq!(periods * u64::from(bit_rate), u64::from(crystal_mhz) * 1_000_000);
                prop_assert!((1..=64).contains(&timing.prescaler()) && [8, 16].contains(&timing.quanta()));
            }
        }
    }
}
