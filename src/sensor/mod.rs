//! Sensors: raw readings in, a [`crate::battery::Measurement`] out.

mod analog;
mod analog_monitor;
mod analog_wiring;
mod bus;
mod can;
mod controllers;
mod engine;
mod external;
mod fuel;
mod kind;
mod serial;

pub use analog::{
    ADC_FULL_SCALE, ADC_REFERENCE_V, AdcCount, AnalogIn, AnalogPin, AnalogReadings, BURST_CONVERSIONS,
    read_mean,
};
pub use analog_wiring::{AnalogWiring, CurrentSensor, VoltageDivider};
pub use bus::{
    Address, BusDevices, Buses, I2cBus, NoSpi, PartKind, Samples, SensorBus, Wiring, bus_clock_hz,
};
pub use can::{CanFrame, FRAME_BYTES};
pub use controllers::{ControllerBank, ControllerReading, MAX_CONTROLLERS, Members};
pub use engine::EngineReading;
pub use external::{Admission, ExternalReading, ExternalSource};
pub use fuel::{FuelKind, FuelMeter, FuelReadings, Pulses};
pub use kind::{MonitorKind, needs_pulses};
pub use serial::{
    DriverEnable, REQUEST_BYTES, Request, SerialDevice, SerialEvent, SerialNotice, SerialProtocol,
    SerialReading, SerialSetup, Urgency, Wires,
};
