//! Which protocols there are, how the port is set up for the one that is set, and the device that speaks it.

use super::protocol::{Baud, Line, Protocol, Request, SerialReading, Wires};
use super::protocols::intelligent_energy::FuelCell;
use super::protocols::{IntelligentEnergy, Kiss, MegaSquirt, RichenPower, Torqeedo, TorqeedoRole};
use crate::pack::Pack;
use crate::parameter::{MonitorKind, Parameters, VehicleParameter, serial_baud};
use crate::time::Instant;

/// For each protocol what speaks it, a line each: its number in `SERIAL1_PROTOCOL` (ArduPilot's), the parameter and value that
/// select it among those with this number, and what the protocol has to know of it.
macro_rules! protocols {
    ($($protocol:ident {
        $($(#[$doc:meta])* $device:ident = $number:literal, $selection:expr, $model:expr;)+
    })+) => {
        /// A device that the serial line may have.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[cfg_attr(target_os = "none", derive(defmt::Format))]
        pub enum SerialProtocol {
            $($($(#[$doc])* $device,)+)+
        }

        impl SerialProtocol {
            /// Every one.
            pub const ALL: &'static [Self] = &[$($(Self::$device,)+)+];

            /// Its number in `SERIAL1_PROTOCOL`.
            pub const fn number(self) -> i32 {
                match self {
                    $($(Self::$device => $number,)+)+
                }
            }

            /// The parameter and its value that select it among those with the same number.
            const fn selection(self) -> Option<(VehicleParameter, i32)> {
                match self {
                    $($(Self::$device => $selection,)+)+
                }
            }

            /// The kinds of packs that it measures.
            pub const fn kinds(self) -> &'static [MonitorKind] {
                match self {
                    $($(Self::$device => $protocol::KINDS,)+)+
                }
            }

            const fn line(self) -> Line {
                match self {
                    $($(Self::$device => $protocol::LINE,)+)+
                }
            }

            /// For how long its packs may be without a reading, in microseconds.
            pub(in crate::sensor) const fn timeout_us(self) -> u64 {
                match self {
                    $($(Self::$device => $protocol::TIMEOUT_US,)+)+
                }
            }

            fn start(self) -> AnyProtocol {
                match self {
                    $($(Self::$device => AnyProtocol::$protocol($protocol::new(&$model)),)+)+
                }
            }
        }

        /// A protocol and what it knows of the device.
        #[derive(Debug)]
        enum AnyProtocol {
            $($protocol($protocol),)+
        }

        impl AnyProtocol {
            fn begin(&mut self, now: Instant) {
                match self {
                    $(Self::$protocol(protocol) => protocol.begin(now),)+
                }
            }

            fn push(&mut self, byte: u8, now: Instant, deliver: &mut impl FnMut(SerialReading)) {
                match self {
                    $(Self::$protocol(protocol) => protocol.push(byte, now, deliver),)+
                }
            }

            fn next_request(&mut self, now: Instant) -> Option<Request> {
                match self {
                    $(Self::$protocol(protocol) => protocol.next_request(now),)+
                }
            }

            fn next_due(&self) -> Option<Instant> {
                match self {
                    $(Self::$protocol(protocol) => protocol.next_due(),)+
                }
            }
        }
    };
}

protocols! {
    Kiss {
        /// A motor controller that sends by itself.
        Kiss = 16, None, ();
    }
    IntelligentEnergy {
        /// Intelligent Energy's fuel cells of 650 W and 800 W.
        IntelligentEnergy650 = 30, Some((VehicleParameter::GenType, 1)), FuelCell::Watts650;
        /// Intelligent Energy's fuel cell of 2.4 kW.
        IntelligentEnergy2400 = 30, Some((VehicleParameter::GenType, 2)), FuelCell::Kilowatts2;
    }
    RichenPower {
        /// RichenPower's hybrid generators.
        RichenPower = 30, Some((VehicleParameter::GenType, 3)), ();
    }
    MegaSquirt {
        /// A MegaSquirt engine control unit.
        MegaSquirt = 24, Some((VehicleParameter::EfiType, 1)), ();
    }
    Torqeedo {
        /// A Torqeedo battery, this board instead of its tiller.
        TorqeedoTiller = 39, Some((VehicleParameter::Trqd1Type, 1)), TorqeedoRole::Tiller;
        /// A Torqeedo motor, this board as its master.
        TorqeedoMotor = 39, Some((VehicleParameter::Trqd1Type, 2)), TorqeedoRole::Master;
    }
}

impl SerialProtocol {
    /// The one that is set; `None` if nothing is, such as a generator without `GEN_TYPE`.
    pub fn selected(parameters: &Parameters) -> Option<Self> {
        let number = parameters.get_whole(VehicleParameter::Serial1Protocol);
        let is_set = |(parameter, value)| parameters.get_whole(parameter) == value;
        let mut all = Self::ALL.iter().copied();
        all.find(|protocol| protocol.number() == number && protocol.selection().is_none_or(is_set))
    }

    /// The one that is set, if a pack is measured by it.
    pub fn in_use(parameters: &Parameters) -> Option<Self> {
        let selected = Self::selected(parameters)?;
        let mut kinds = Pack::ALL
            .into_iter()
            .filter_map(|pack| parameters.monitor_kind(pack));
        kinds
            .any(|kind| selected.kinds().contains(&kind))
            .then_some(selected)
    }
}

/// The pin that switches the driver of an RS-485 transceiver on, high while the port sends (`TRQD1_DE_PIN`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum DriverEnable {
    /// None: the transceiver switches by itself.
    None,
    /// GP22.
    Gp22,
}

/// `TRQD1_DE_PIN` for GP22.
const GP22: i32 = 22;

/// Set-up of the second serial port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SerialSetup {
    /// Its rate, in bits per second.
    pub baud: u32,
    /// Its wires.
    pub wires: Wires,
    /// The switch of the transceiver's driver.
    pub driver_enable: DriverEnable,
}

impl SerialSetup {
    /// The set-up that the parameters call for; `None` if no pack is measured by the port, whose pins stay untouched then.
    pub fn from_parameters(parameters: &Parameters) -> Option<Self> {
        let Line { baud, wires } = SerialProtocol::in_use(parameters)?.line();
        Some(Self {
            baud: match baud {
                Baud::Fixed(baud) => baud,
                Baud::Set => serial_baud(parameters.get_whole(VehicleParameter::Serial1Baud)),
            },
            wires,
            driver_enable: match wires {
                Wires::OneWire => driver_enable(parameters),
                Wires::ReceiveOnly | Wires::BothWays => DriverEnable::None,
            },
        })
    }
}

fn driver_enable(parameters: &Parameters) -> DriverEnable {
    match parameters.get_whole(VehicleParameter::Trqd1DePin) {
        GP22 => DriverEnable::Gp22,
        _ => DriverEnable::None,
    }
}

/// The device on the serial line.
#[derive(Debug)]
pub struct SerialDevice(AnyProtocol);

impl SerialDevice {
    /// The device that is set, at boot; `None` if no pack is measured by one.
    pub fn from_parameters(parameters: &Parameters) -> Option<Self> {
        let protocol = SerialProtocol::in_use(parameters)?;
        Some(Self(protocol.start()))
    }

    /// Processes bytes that were received by `now`.
    pub fn receive(&mut self, bytes: &[u8], now: Instant, mut deliver: impl FnMut(SerialReading)) {
        self.0.begin(now);
        for byte in bytes {
            self.0.push(*byte, now, &mut deliver);
        }
    }

    /// The request to send at `now`, if there is one.
    pub fn next_request(&mut self, now: Instant) -> Option<Request> {
        self.0.next_request(now)
    }

    /// When [`Self::next_request`] has to be called again; `None` if not before something was received.
    pub fn next_due(&self) -> Option<Instant> {
        self.0.next_due()
    }
}
