//! What a sensor is connected to: whether that is set up for it, and how often it has to report.

use super::can::CAN_TIMEOUT_US;
use super::external::EXTERNAL_TIMEOUT_US;
use super::kind::TICK_TIMEOUT_US;
use super::{BitTiming, DriverEnable, FuelKind, MonitorKind, SerialProtocol, SerialSetup};
use crate::battery::ReadError;
use crate::parameter::Parameters;

/// For how long a pack may be without a reading, in microseconds. Each sampling tick after that is a failed read.
pub fn timeout_us(kind: MonitorKind, parameters: &Parameters) -> u64 {
    match kind {
        MonitorKind::Can => CAN_TIMEOUT_US,
        MonitorKind::External => EXTERNAL_TIMEOUT_US,
        MonitorKind::GeneratorElectrical
        | MonitorKind::GeneratorFuel
        | MonitorKind::Torqeedo
        | MonitorKind::Efi => {
            SerialProtocol::selected(parameters).map_or(TICK_TIMEOUT_US, SerialProtocol::timeout_us)
        }
        MonitorKind::AnalogVoltage
        | MonitorKind::AnalogVoltageAndCurrent
        | MonitorKind::Sum
        | MonitorKind::SyntheticCurrent
        | MonitorKind::AnalogCurrent
        | MonitorKind::Esc
        | MonitorKind::Fuel(_)
        | MonitorKind::Bus(_) => TICK_TIMEOUT_US,
    }
}

/// Why a sensor can't be read with these parameters, whatever is connected: what it is connected to is not set up, or is used
/// by another sensor.
pub fn set_up_error(kind: MonitorKind, parameters: &Parameters) -> Option<ReadError> {
    match kind {
        MonitorKind::Esc => {
            let is_connected = has_protocol(kind, parameters) || has_can(parameters);
            (!is_connected).then_some(ReadError::NotSetUp)
        }
        MonitorKind::GeneratorElectrical
        | MonitorKind::GeneratorFuel
        | MonitorKind::Torqeedo
        | MonitorKind::Efi => (!has_protocol(kind, parameters)).then_some(ReadError::NotSetUp),
        MonitorKind::Can => (!has_can(parameters)).then_some(ReadError::NotSetUp),
        // GP17 is the interrupt line of the CAN controller.
        MonitorKind::Fuel(FuelKind::Flow | FuelKind::LevelPwm) => {
            has_can(parameters).then_some(ReadError::PinTaken)
        }
        MonitorKind::Bus(part) if part.is_at_spi() => {
            has_driver_enable(parameters).then_some(ReadError::PinTaken)
        }
        MonitorKind::AnalogVoltage
        | MonitorKind::AnalogVoltageAndCurrent
        | MonitorKind::Sum
        | MonitorKind::SyntheticCurrent
        | MonitorKind::AnalogCurrent
        | MonitorKind::External
        | MonitorKind::Fuel(FuelKind::LevelAnalog)
        | MonitorKind::Bus(_) => None,
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
