//! How the second serial port is set up.

use super::protocol::{Baud, Line, Wires};
use super::registry::SerialProtocol;
use crate::parameter::{Parameters, VehicleParameter, serial_baud};

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

/// How the second serial port is set up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SerialSetup {
    /// Its rate, in bits per second.
    pub baud: u32,
    /// What is connected to it.
    pub wires: Wires,
    /// What switches the transceiver.
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
