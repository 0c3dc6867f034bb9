//! The faults, and how long it may take until nothing is left of one.

use super::packs;
use crate::bench::MILLISECOND;

/// What happens to a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fault {
    AdcGlitches,
    AdcErrors,
    AdcStalls,
    LineNoise,
    LostBytes,
    LineDead,
    HostileFrames,
    BusClockHeld,
    BusDataHeld,
    PartsUnplugged,
    PartsGarbled,
    PartHangs,
    BrownOut,
    RunPin,
    FlashCut,
    ProgramHangs,
    ProgramCrashes,
}

impl Fault {
    pub const ALL: [Self; 17] = [
        Self::AdcGlitches,
        Self::AdcErrors,
        Self::AdcStalls,
        Self::LineNoise,
        Self::LostBytes,
        Self::LineDead,
        Self::HostileFrames,
        Self::BusClockHeld,
        Self::BusDataHeld,
        Self::PartsUnplugged,
        Self::PartsGarbled,
        Self::PartHangs,
        Self::BrownOut,
        Self::RunPin,
        Self::FlashCut,
        Self::ProgramHangs,
        Self::ProgramCrashes,
    ];

    /// As it is called in the table.
    pub fn name(self) -> &'static str {
        match self {
            Self::AdcGlitches => "ADC: 5 % of the conversions give any code",
            Self::AdcErrors => "ADC: conversions end with an error",
            Self::AdcStalls => "ADC: conversions never end",
            Self::LineNoise => "UART: each data bit to the board flips at 10^-3",
            Self::LostBytes => "UART: 1 % of the bytes to the board are lost",
            Self::LineDead => "UART: nothing arrives at the board",
            Self::HostileFrames => "UART: hostile frames fill the line",
            Self::BusClockHeld => "I2C: SCL is held low",
            Self::BusDataHeld => "I2C: SDA is held low",
            Self::PartsUnplugged => "I2C: both parts are unplugged",
            Self::PartsGarbled => "I2C: both parts answer nonsense",
            Self::PartHangs => "I2C: a part stretches the clock for 50 ms a byte",
            Self::BrownOut => "power is gone for up to 3 s",
            Self::RunPin => "RUN is pulled low",
            Self::FlashCut => "power is gone in an erase or a write of the flash",
            Self::ProgramHangs => "the program hangs",
            Self::ProgramCrashes => "the program runs into an undefined instruction",
        }
    }

    /// Within this time after it has ended there is a HEARTBEAT, which comes once a second, a request is answered, and every pack
    /// is reported well and with its right voltage.
    pub fn limit_us(self) -> u64 {
        match self.hits() {
            // A request may be swallowed by what garbage has begun.
            [] => 2_000 * MILLISECOND,
            packs::ALL => 1_000 * MILLISECOND,
            // A voltage that no cell has is a spike, and a pack with one is not well for a second after the last of them.
            packs::ON_ADC if self == Self::AdcGlitches => 1_700 * MILLISECOND,
            packs::ON_ADC => 1_200 * MILLISECOND,
            // A part that has failed is left in peace for 200 ms, and is set up anew.
            _ => 1_500 * MILLISECOND,
        }
    }

    /// The packs that it concerns.
    pub fn hits(self) -> &'static [u8] {
        match self {
            Self::AdcGlitches | Self::AdcErrors | Self::AdcStalls => packs::ON_ADC,
            Self::LineNoise | Self::LostBytes | Self::LineDead | Self::HostileFrames => &[],
            Self::BusClockHeld
            | Self::BusDataHeld
            | Self::PartsUnplugged
            | Self::PartsGarbled
            | Self::PartHangs => packs::ON_BUS,
            Self::BrownOut | Self::RunPin | Self::FlashCut | Self::ProgramHangs | Self::ProgramCrashes => {
                packs::ALL
            }
        }
    }

    /// The packs that nothing of it may be seen at.
    pub fn spares(self) -> &'static [u8] {
        match self.hits() {
            packs::ON_ADC => packs::ON_BUS,
            packs::ON_BUS => packs::ON_ADC,
            [] => packs::ALL,
            _ => &[],
        }
    }

    /// Those that can come while another one lasts.
    pub const SUDDEN: [Self; 3] = [Self::BrownOut, Self::RunPin, Self::ProgramHangs];

    /// Whether the board starts anew with it.
    pub fn restarts(self) -> bool {
        self.hits() == packs::ALL
    }
}
