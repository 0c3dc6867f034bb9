//! The faults, and how long it may take until nothing is left of one.

use super::packs;
use crate::bench::MILLISECOND;

/// A line for each fault: its name in the code, the packs that it concerns, and its name in the table of the documentation. Makes
/// the type [`Fault`] of them, and its methods that look up a line.
macro_rules! faults {
    ($($fault:ident, $packs:expr, $name:literal;)*) => {
        /// A fault that a board suffers.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Fault {
            $($fault,)*
        }

        impl Fault {
            pub const ALL: [Self; 27] = [$(Self::$fault,)*];

            /// As it is called in the table.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$fault => $name,)*
                }
            }

            /// The packs that it concerns.
            pub fn hits(self) -> &'static [u8] {
                match self {
                    $(Self::$fault => $packs,)*
                }
            }
        }
    };
}

faults! {
    AdcGlitches, packs::ON_ADC, "ADC: 5 % of the conversions give any code";
    AdcErrors, packs::ON_ADC, "ADC: conversions end with an error";
    AdcStalls, packs::ON_ADC, "ADC: conversions never end";
    LineNoise, &[], "UART: each data bit to the board flips at 10^-3";
    LostBytes, &[], "UART: 1 % of the bytes to the board are lost";
    LineDead, &[], "UART: nothing arrives at the board";
    HostileFrames, &[], "UART: hostile frames fill the line";
    BusClockHeld, packs::ON_BUS, "I2C: SCL is held low";
    BusDataHeld, packs::ON_BUS, "I2C: SDA is held low";
    PartsUnplugged, packs::ON_BUS, "I2C: both parts are unplugged";
    PartsGarbled, packs::ON_BUS, "I2C: both parts answer nonsense";
    PartHangs, packs::ON_BUS, "I2C: a part stretches the clock for 50 ms a byte";
    CanNoise, &[], "CAN: a frame in ten is corrupted";
    CanShorted, packs::ON_CAN, "CAN: the wires are shorted";
    CanUnplugged, packs::ON_CAN, "CAN: the controller is unplugged";
    CanReset, packs::ON_CAN, "CAN: the controller resets itself";
    CanSilent, packs::ON_CAN, "CAN: both batteries are silent";
    RadioSilent, &[], "Wi-Fi: the radio falls silent";
    RadioNoise, &[], "Wi-Fi: the radio answers nonsense";
    AirLossy, &[], "Wi-Fi: half of the frames are lost";
    AirHostile, &[], "Wi-Fi: 100 hostile frames a second";
    BrownOut, packs::ALL, "power is gone for up to 3 s";
    RunPin, packs::ALL, "RUN is pulled low";
    FlashCut, packs::ALL, "power is gone in an erase or a write of the flash";
    LogCut, packs::ALL, "power is gone in a write of the log";
    ProgramHangs, packs::ALL, "the program hangs";
    ProgramCrashes, packs::ALL, "the program runs into an undefined instruction";
}

impl Fault {
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

    /// Whether stations in its Wi-Fi network may hear nothing of the board; the name says so.
    pub fn hits_wifi(self) -> bool {
        self.name().starts_with("Wi-Fi: ")
    }

    /// Whether the board restarts with it.
    pub fn restarts(self) -> bool {
        self.hits() == packs::ALL
    }
}
