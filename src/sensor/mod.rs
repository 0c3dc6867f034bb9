//! Sensors: raw readings in, a [`crate::battery::Measurement`] out.

mod analog;
mod analog_monitor;
mod analog_pin;
mod bus;
mod can;
mod controllers;
mod conversions;
mod external;
mod fuel;
mod serial;
mod set_up;
mod thermometer;

pub use analog::{AnalogWiring, CurrentSensor, VoltageDivider};
pub use analog_monitor::PinUse;
pub use analog_pin::AnalogPin;
pub use bus::{
    Address, BusDevices, Buses, I2cBus, NoSpi, Samples, SensorBus, Wiring, bus_clock_hz, part_address,
};
pub use can::{
    Acceptance, BitTiming, CanBus, CanEvent, CanFilters, CanFrame, CanInterrupt, CanNotice, CanOptions,
    CanPack, CanReport, CanSettings, CanSetup, CanState, CanStatus, ChargerPower, DroneCan, FRAME_BYTES,
    NodeId, TemperatureMessages,
};
pub use controllers::{ControllerBank, ControllerReading, Members};
pub(crate) use conversions::exceeds_tolerance;
pub use conversions::{
    ADC_FULL_SCALE, ADC_REFERENCE_V, AdcCount, AnalogIn, AnalogReadings, Conversions, LATEST_READING_US,
    PairSums, PinPull, WantedReadings,
};
pub use external::{Admission, ExternalHealth, ExternalReading, ExternalReport, ExternalSource};
pub use fuel::{EngineReading, FuelMeter, FuelReadings, Pulses, capacity_ml, tank};
pub use serial::{
    DriverEnable, FuelCellError, FuelCellState, REQUEST_BYTES, Request, RichenPowerErrors, SerialDevice,
    SerialNotice, SerialProtocol, SerialReading, SerialSetup, TorqeedoCondition, Wires,
};
pub use set_up::{set_up_error, timeout_us};
pub use thermometer::{
    Temperatures, Thermometers, packs_with_thermometer, thermometer_on_shared_pin, thermometer_pins,
};
