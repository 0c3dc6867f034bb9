//! Which parts there are.

use super::part::Part;
use super::parts::{Ad7091r5, Bebop, Bq76952, Ina2xx, Ina3221, Ltc2946, SmartBattery, ina2xx, smart_battery};
use super::{Address, SensorBus, Wiring};
use crate::battery::{Measurement, ReadError};
use crate::pack::Pack;
use crate::parameter::{BatteryParameter, Parameters};

/// For each driver its kinds, a line each: what it is, its number in `BATT_MONITOR` (ArduPilot's), and what the driver has
/// to know of it.
macro_rules! parts {
    ($($driver:ident {
        $($(#[$doc:meta])* $kind:ident = $number:literal, $model:expr;)+
    })+) => {
        /// A kind of part on the bus.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[cfg_attr(target_os = "none", derive(defmt::Format))]
        pub enum PartKind {
            $($($(#[$doc])* $kind,)+)+
        }

        /// A kind's driver, with what that has to know of the kind.
        #[derive(Clone, Copy)]
        enum Selected {
            $($driver(&'static <$driver as Part>::Model),)+
        }

        impl PartKind {
            /// Every kind.
            pub const ALL: &'static [Self] = &[$($(Self::$kind,)+)+];

            /// Its number in `BATT_MONITOR`.
            pub const fn number(self) -> i32 {
                match self {
                    $($(Self::$kind => $number,)+)+
                }
            }

            fn selected(self) -> Selected {
                match self {
                    $($(Self::$kind => Selected::$driver(&$model),)+)+
                }
            }

            pub(super) fn addresses(self) -> &'static [Address] {
                match self.selected() {
                    $(Selected::$driver(model) => $driver::addresses(model),)+
                }
            }

            pub(super) fn interval_us(self) -> u64 {
                match self.selected() {
                    $(Selected::$driver(_) => $driver::INTERVAL_US,)+
                }
            }

            pub(super) fn highest_clock_hz(self) -> u32 {
                match self.selected() {
                    $(Selected::$driver(_) => $driver::HIGHEST_CLOCK_HZ,)+
                }
            }

            pub(super) fn refuses_commands(self) -> bool {
                match self.selected() {
                    $(Selected::$driver(_) => $driver::REFUSES_COMMANDS,)+
                }
            }

            pub(super) fn channels(self) -> usize {
                match self.selected() {
                    $(Selected::$driver(_) => $driver::CHANNELS,)+
                }
            }

            pub(super) async fn set_up(
                self,
                bus: &mut impl SensorBus,
                address: Address,
                wiring: &Wiring,
            ) -> Result<AnyPart, ReadError> {
                Ok(match self.selected() {
                    $(Selected::$driver(model) => {
                        AnyPart::$driver($driver::set_up(bus, address, wiring, model).await?)
                    })+
                })
            }
        }

        /// A part that was set up.
        #[derive(Debug)]
        pub(super) enum AnyPart {
            $($driver($driver),)+
        }

        impl AnyPart {
            pub async fn check(&mut self, bus: &mut impl SensorBus) -> Result<(), ReadError> {
                match self {
                    $(Self::$driver(part) => part.check(bus).await,)+
                }
            }

            pub async fn read(
                &mut self,
                bus: &mut impl SensorBus,
                wiring: &Wiring,
            ) -> Result<Measurement, ReadError> {
                match self {
                    $(Self::$driver(part) => part.read(bus, wiring).await,)+
                }
            }
        }
    };
}

parts! {
    SmartBattery {
        /// A battery with a gauge of its own.
        SmartBattery = 7, smart_battery::GENERIC;
        /// The battery of 3D Robotics' Solo.
        Solo = 5, smart_battery::SOLO;
        /// SUI's battery of three cells.
        Sui3Cells = 13, smart_battery::SUI_3_CELLS;
        /// SUI's battery of six cells.
        Sui6Cells = 14, smart_battery::SUI_6_CELLS;
        /// NeoDesign's battery.
        NeoDesign = 15, smart_battery::NEO_DESIGN;
        /// Maxell's battery.
        Maxell = 16, smart_battery::MAXELL;
        /// Rotoye's Batmon.
        Rotoye = 19, smart_battery::ROTOYE;
    }
    Ina2xx {
        /// Texas Instruments' INA226, INA228 and their like; which one it is shows its identification.
        Ina2xx = 21, ina2xx::ON_I2C;
        /// Texas Instruments' INA239, at the SPI bus.
        Ina239 = 26, ina2xx::ON_SPI;
    }
    Ltc2946 {
        /// Analog Devices' LTC2946.
        Ltc2946 = 22, ();
    }
    Ad7091r5 {
        /// Analog Devices' AD7091R-5: four more analog pins.
        Ad7091r5 = 28, ();
    }
    Ina3221 {
        /// Texas Instruments' INA3221: three packs on one chip.
        Ina3221 = 30, ();
    }
    Bq76952 {
        /// Texas Instruments' BQ76952: monitor of a stack of up to 16 cells.
        Bq76952 = 32, ();
    }
    Bebop {
        /// Parrot's motor board of the Bebop.
        Bebop = 6, ();
    }
}

impl PartKind {
    /// The kind of part that measures a pack (`BATT_MONITOR`); `None` if no part on the bus does.
    pub(super) fn of(parameters: &Parameters, pack: Pack) -> Option<Self> {
        Self::from_number(parameters.get_whole(BatteryParameter::Monitor.of(pack)))
    }

    /// Whether it is at the SPI bus.
    pub(in crate::sensor) fn is_at_spi(self) -> bool {
        self.addresses().contains(&Address::ChipSelect)
    }

    /// The kind with this number of `BATT_MONITOR`.
    pub fn from_number(number: i32) -> Option<Self> {
        Self::ALL.iter().copied().find(|kind| kind.number() == number)
    }
}
