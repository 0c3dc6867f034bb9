//! The serial line: its rate and its wires.

use super::SerialProtocol;
use crate::parameter::{Parameters, VehicleParameter, serial_baud};

/// What a protocol needs of the line. Every one has eight data bits, no parity and one stop bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Line {
    /// Its rate.
    pub baud: Baud,
    /// Its wires.
    pub wires: Wires,
}

/// The rate of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Baud {
    /// The protocol has this one and no other, in bits per second.
    Fixed(u32),
    /// Devices differ: it is set (`SERIAL1_BAUD`).
    Set,
}

/// What is connected to the port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Wires {
    /// Only its input: the output's pin stays untouched.
    ReceiveOnly,
    /// Its input, and its output by a wire of its own.
    BothWays,
    /// Both by the same wire or pair of wires, such as RS-485: one sends at a time, and may receive what it sends.
    OneWire,
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
