//! The peripherals that the parameters call for.

use super::Autopilot;
use crate::parameter::{MonitorInput, MonitorKind, VehicleParameter, serial_baud};
use crate::sensor::{self, BitTiming, CanSettings, CanSetup, SerialSetup};

/// Peripherals that the parameters call for. Those that are not used stay untouched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wiring {
    /// Baud rate of the telemetry port (`SERIAL0_BAUD`).
    pub telemetry_baud: u32,
    /// Clock of the I2C bus, in hertz.
    pub i2c_clock_hz: u32,
    /// The second serial port; `None` if no pack uses it.
    pub serial: Option<SerialSetup>,
    /// Whether a pack uses the pulse input.
    pub uses_pulses: bool,
    /// Whether a pack is measured by a part at the SPI bus.
    pub uses_spi_part: bool,
    /// The CAN bus, if it is in use: its controller's interrupts come at the pulse input.
    pub can: Option<BitTiming>,
}

impl Autopilot {
    /// The peripherals that the parameters call for.
    pub fn wiring(&self) -> Wiring {
        let parameters = &self.parameters;
        // A bit rate that is impossible was announced.
        let can = BitTiming::from_parameters(parameters).unwrap_or_default();
        Wiring {
            telemetry_baud: serial_baud(parameters.get_whole(VehicleParameter::Serial0Baud)),
            i2c_clock_hz: sensor::bus_clock_hz(parameters),
            serial: SerialSetup::from_parameters(parameters),
            uses_pulses: parameters.uses_input(MonitorInput::Pulses) && can.is_none(),
            uses_spi_part: parameters.uses_input(MonitorInput::Spi),
            can,
        }
    }

    /// Set-up of the node on the CAN bus; `None` while the bus is not in use.
    pub fn can_setup(&self) -> Option<CanSetup> {
        CanSetup::from_parameters(&self.parameters, self.identity())
    }

    /// The node's settings that may change at any time, and what a ground station has switched since the last call.
    pub fn can_settings(&mut self) -> CanSettings {
        let settings = CanSettings::new(
            self.packs.of_kind(MonitorKind::Can),
            &self.parameters,
            self.identity(),
            self.vehicle.arm_state(),
        );
        CanSettings {
            switched: self.charger_switch.take(),
            ..settings
        }
    }
}
