//! Whether the input of a sensor is set up, and how often it has to report.

use super::{BitTiming, DriverEnable, SerialProtocol, SerialSetup};
use crate::battery::ReadError;
use crate::parameter::{MonitorInput, MonitorKind, Parameters};

/// Longest time without a reading, in microseconds. Each sampling tick after that is a failed read.
pub fn timeout_us(kind: MonitorKind, parameters: &Parameters) -> u64 {
    let protocol = match kind.input() {
        MonitorInput::SerialLine => SerialProtocol::selected(parameters),
        _ => None,
    };
    protocol.map_or(kind.timeout_us(), SerialProtocol::timeout_us)
}

/// Why a sensor can't be read with these parameters, whatever is connected: its input is not set up, or another sensor uses
/// the pin.
pub fn set_up_error(kind: MonitorKind, parameters: &Parameters) -> Option<ReadError> {
    let unless = |is_set_up: bool, error| (!is_set_up).then_some(error);
    match kind.input() {
        MonitorInput::AlwaysThere => None,
        MonitorInput::Pulses => unless(!has_can(parameters), ReadError::PinTaken),
        MonitorInput::Spi => unless(!has_driver_enable(parameters), ReadError::PinTaken),
        MonitorInput::SerialLine => unless(has_protocol(kind, parameters), ReadError::NotSetUp),
        MonitorInput::Can => unless(has_can(parameters), ReadError::NotSetUp),
        MonitorInput::Controllers => {
            let is_connected = has_protocol(kind, parameters) || has_can(parameters);
            unless(is_connected, ReadError::NotSetUp)
        }
    }
}

/// Whether the serial line is set up for it.
fn has_protocol(kind: MonitorKind, parameters: &Parameters) -> bool {
    SerialProtocol::selected(parameters).is_some_and(|protocol| protocol.kinds().contains(&kind))
}

/// Whether the CAN bus is in use.
fn has_can(parameters: &Parameters) -> bool {
    matches!(BitTiming::from_parameters(parameters), Ok(Some(_)))
}

/// Whether GP22, the chip select of a part at the SPI bus, is a transceiver's driver enable.
fn has_driver_enable(parameters: &Parameters) -> bool {
    SerialSetup::from_parameters(parameters).is_some_and(|setup| setup.driver_enable == DriverEnable::Gp22)
}
