//! Which parts there are.

use super::part::{Part, Sharing};
use super::parts::{Ad7091r5, Bebop, Bq76952, Ina2xx, Ina3221, Ltc2946, SmartBattery, ina2xx, smart_battery};
use super::{Address, SensorBus, Wiring};
use crate::battery::{Measurement, ReadError};
use crate::parameter::PartKind;

/// For each driver its kinds, a line each, and the model that distinguishes them.
macro_rules! parts {
    ($($driver:ident {
        $($kind:ident = $model:expr;)+
    })+) => {
        /// A kind's driver, with what that has to know of the kind.
        #[derive(Clone, Copy)]
        enum Selected {
            $($driver(&'static <$driver as Part>::Model),)+
        }

        impl PartKind {
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

            pub(super) fn is_announced(self) -> bool {
                match self.selected() {
                    $(Selected::$driver(_) => $driver::IS_ANNOUNCED,)+
                }
            }

            pub(super) fn first_result_us(self) -> u64 {
                match self.selected() {
                    $(Selected::$driver(_) => $driver::FIRST_RESULT_US,)+
                }
            }

            pub(super) fn sharing(self) -> Sharing {
                match self.selected() {
                    $(Selected::$driver(_) => $driver::SHARING,)+
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
            pub async fn begin_turn(&mut self, bus: &mut impl SensorBus) -> Result<(), ReadError> {
                match self {
                    $(Self::$driver(part) => part.begin_turn(bus).await,)+
                }
            }

            pub fn range(&self, wiring: &Wiring) -> Option<(&'static str, f32)> {
                match self {
                    $(Self::$driver(part) => part.range(wiring),)+
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
        SmartBattery = smart_battery::GENERIC;
        Solo = smart_battery::SOLO;
        Sui3Cells = smart_battery::SUI_3_CELLS;
        Sui6Cells = smart_battery::SUI_6_CELLS;
        NeoDesign = smart_battery::NEO_DESIGN;
        Maxell = smart_battery::MAXELL;
        Rotoye = smart_battery::ROTOYE;
    }
    Ina2xx {
        Ina2xx = ina2xx::ON_I2C;
        Ina239 = ina2xx::ON_SPI;
    }
    Ltc2946 {
        Ltc2946 = ();
    }
    Ad7091r5 {
        Ad7091r5 = ();
    }
    Ina3221 {
        Ina3221 = ();
    }
    Bq76952 {
        Bq76952 = ();
    }
    Bebop {
        Bebop = ();
    }
}
