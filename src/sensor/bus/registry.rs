//! Which parts there are.

use super::part::Part;
use super::parts::{Ina2xx, Ina3221, SmartBattery};
use super::{Address, SensorBus, Wiring};
use crate::battery::{Measurement, ReadError};

/// Each line: what it is, its number in `BATT_MONITOR` and its name there (ArduPilot's), and its driver.
macro_rules! parts {
    ($($(#[$doc:meta])* $kind:ident = $number:literal, $label:literal => $driver:ty;)+) => {
        /// A kind of part on the bus.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[cfg_attr(target_os = "none", derive(defmt::Format))]
        pub enum PartKind {
            $($(#[$doc])* $kind,)+
        }

        impl PartKind {
            /// Every kind.
            pub const ALL: &'static [Self] = &[$(Self::$kind),+];

            /// Its number in `BATT_MONITOR`.
            pub const fn number(self) -> i32 {
                match self {
                    $(Self::$kind => $number,)+
                }
            }

            /// What a ground station calls it.
            pub const fn label(self) -> &'static str {
                match self {
                    $(Self::$kind => $label,)+
                }
            }

            pub(super) fn addresses(self) -> &'static [Address] {
                match self {
                    $(Self::$kind => <$driver>::ADDRESSES,)+
                }
            }

            pub(super) fn interval_us(self) -> u64 {
                match self {
                    $(Self::$kind => <$driver>::INTERVAL_US,)+
                }
            }

            pub(super) fn highest_clock_hz(self) -> u32 {
                match self {
                    $(Self::$kind => <$driver>::HIGHEST_CLOCK_HZ,)+
                }
            }

            pub(super) fn channels(self) -> usize {
                match self {
                    $(Self::$kind => <$driver>::CHANNELS,)+
                }
            }

            pub(super) async fn set_up(
                self,
                bus: &mut impl SensorBus,
                address: Address,
                wiring: &Wiring,
            ) -> Result<AnyPart, ReadError> {
                Ok(match self {
                    $(Self::$kind => AnyPart::$kind(<$driver>::set_up(bus, address, wiring).await?),)+
                })
            }
        }

        /// A part that was set up.
        #[derive(Debug)]
        pub(super) enum AnyPart {
            $($kind($driver),)+
        }

        impl AnyPart {
            pub async fn check(&mut self, bus: &mut impl SensorBus) -> Result<(), ReadError> {
                match self {
                    $(Self::$kind(part) => part.check(bus).await,)+
                }
            }

            pub async fn read(
                &mut self,
                bus: &mut impl SensorBus,
                wiring: &Wiring,
            ) -> Result<Measurement, ReadError> {
                match self {
                    $(Self::$kind(part) => part.read(bus, wiring).await,)+
                }
            }
        }
    };
}

parts! {
    /// A battery with a gauge of its own.
    SmartBattery = 7, "SMBus-Generic" => SmartBattery;
    /// Texas Instruments' INA226, INA228 and INA260; which one it is shows its identification.
    Ina2xx = 21, "INA2XX" => Ina2xx;
    /// Texas Instruments' INA3221: three packs on one chip.
    Ina3221 = 30, "INA3221" => Ina3221;
}

impl PartKind {
    /// The kind with this number of `BATT_MONITOR`.
    pub fn from_number(number: i32) -> Option<Self> {
        Self::ALL.iter().copied().find(|kind| kind.number() == number)
    }
}
