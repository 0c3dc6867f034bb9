//! Parameter tables, live values, and what has to be saved to flash.
//!
//! Names, units and meanings are ArduPilot 4.6's. As there, the parameters of a disabled pack are hidden from lists,
//! except its `MONITOR`, and so are those of things that are not in use.

mod collections;
mod confirmation;
mod description_files;
#[cfg(not(target_os = "none"))]
pub mod documentation;
mod id;
mod named;
mod parameters;
mod stick_channel;
mod sticks;
mod table;
mod trouble;
mod unsaved;

pub use collections::{ForEachParameter, ParameterIdSet};
pub use description_files::DescriptionFile;
pub use id::{MAX_NAME_LENGTH, PARAMETER_COUNT, ParameterId};
pub use named::NamedParameter;
pub(crate) use parameters::checked;
pub use parameters::{PackParameters, Parameters, Refused, triggers};
pub use stick_channel::{StickChannel, StickChannels};
pub use table::{
    Access, BatteryParameter, Bearing, FuelKind, GroundStationParameter, Kind, Listed, MAX_CONTROLLERS,
    Meaning, MonitorKind, Parameter, PartKind, Range, StickParameter, THERMOMETER_COUNT, TemperatureSensor,
    ThermometerParameter, VehicleParameter, means, serial_baud,
};
#[cfg(not(target_os = "none"))]
pub use table::{Documentation, SimulationParameter, TakesEffect};
pub(crate) use table::{MonitorInput, TICK_TIMEOUT_US};
pub use trouble::ParameterTrouble;
pub use unsaved::{SaveFailure, Unsaved};
