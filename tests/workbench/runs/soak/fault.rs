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
    CanNoise,
    CanShorted,
    CanUnplugged,
    CanReset,
    CanSilent,
    RadioSilent,
    RadioNoise,
    AirLossy,
    AirHostile,
    BrownOut,
    RunPin,
    FlashCut,
    LogCut,
    ProgramHangs,
    ProgramCrashes,
}

impl Fault {
    pub const ALL: [Self; 27] = [
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
        Self::CanNoise,
        Self::CanShorted,
        Self::CanUnplugged,
        Self::CanReset,
        Self::CanSilent,
        Self::RadioSilent,
        Self::RadioNoise,
        Self::AirLossy,
        Self::AirHostile,
        Self::BrownOut,
        Self::RunPin,
        Self::FlashCut,
        Self::LogCut,
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
            Self::CanNoise => "CAN: a frame in ten is corrupted",
            Self::CanShorted => "CAN: the wires are shorted",
            Self::CanUnplugged => "CAN: the controller is unplugged",
            Self::CanReset => "CAN: the controller resets itself",
            Self::CanSilent => "CAN: both batteries are silent",
            Self::RadioSilent => "Wi-Fi: the radio falls silent",
            Self::RadioNoise => "Wi-Fi: the radio answers nonsense",
            Self::AirLossy => "Wi-Fi: half of the frames are lost",
            Self::AirHostile => "Wi-Fi: 100 hostile frames a second",
            Self::BrownOut => "power is gone for up to 3 s",
            Self::RunPin => "RUN is pulled low",
            Self::FlashCut => "power is gone in an erase or a write of the flash",
            Self::LogCut => "power is gone in a write of the log",
            Self::ProgramHangs => "the program hangs",
            Self::ProgramCrashes => "the program runs into an undefined instruction",
        }
    }

    /// Within this time after it has ended there is a HEARTBEAT, which comes once a second, a request is answered, and every pack
    /// is reported well and with its right voltage; by Wi-Fi there is a HEARTBEAT, too, if it was a fault of that.
    pub fn limit_us(self) -> u64 {
        match self.hits() {
            // A radio that has failed is tried again after 10 s, and takes its firmware; a laptop whose request for an address
            // was lost asks again after 10 s.
            [] if self.hits_wifi() => 25_000 * MILLISECOND,
            // The controller is looked for every second, and a bus that is off is tried again every second.
            packs::ON_CAN => 2_500 * MILLISECOND,
            // A request may be swallowed by what garbage has begun.
            [] => 2_000 * MILLISECOND,
            packs::ALL => 1_000 * MILLISECOND,
            // A voltage that no cell has is a spike, and a pack with one is not well for a second after the last of them.
            packs::ON_ADC if self == Self::AdcGlitches => 1_700 * MILLISECOND,
            packs::ON_ADC => 1_200 * MILLISECOND,
            // A part that has failed is left in peace for 200 ms, and is set up again.
            _ => 1_500 * MILLISECOND,
        }
    }

    /// The packs that it concerns.
    pub fn hits(self) -> &'static [u8] {
        match self {
            Self::AdcGlitches | Self::AdcErrors | Self::AdcStalls => packs::ON_ADC,
            Self::LineNoise
            | Self::LostBytes
            | Self::LineDead
            | Self::HostileFrames
            | Self::CanNoise
            | Self::RadioSilent
            | Self::RadioNoise
            | Self::AirLossy
            | Self::AirHostile => &[],
            Self::CanShorted | Self::CanUnplugged | Self::CanReset | Self::CanSilent => packs::ON_CAN,
            Self::BusClockHeld
            | Self::BusDataHeld
            | Self::PartsUnplugged
            | Self::PartsGarbled
            | Self::PartHangs => packs::ON_BUS,
            Self::BrownOut
            | Self::RunPin
            | Self::FlashCut
            | Self::LogCut
            | Self::ProgramHangs
            | Self::ProgramCrashes => packs::ALL,
        }
    }

    /// The packs that nothing of it may be seen at.
    pub fn spares(self) -> &'static [u8] {
        match self.hits() {
            packs::ON_ADC => packs::BUT_ADC,
            packs::ON_BUS => packs::BUT_BUS,
            packs::ON_CAN => packs::BUT_CAN,
            [] => packs::ALL,
            _ => &[],
        }
    }

    /// Whether stations in its Wi-Fi network may hear nothing of the board.
    pub fn hits_wifi(self) -> bool {
        let of_wifi = [
            Self::RadioSilent,
            Self::RadioNoise,
            Self::AirLossy,
            Self::AirHostile,
        ];
        of_wifi.contains(&self)
    }

    /// Those that can come while another one lasts.
    pub const SUDDEN: [Self; 3] = [Self::BrownOut, Self::RunPin, Self::ProgramHangs];

    /// Whether the board restarts with it.
    pub fn restarts(self) -> bool {
        self.hits() == packs::ALL
    }
}
