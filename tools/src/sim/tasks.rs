//! The firmware's tasks on simulated hardware, as the simulator runs them in real time and tests in stepped time.

use std::future::pending;

use embassy_futures::join::join3;
use rover_battmon::autopilot::Start;
use rover_battmon::battery::RetainedMemory;
use rover_battmon::crash::{ParameterSource, RunEnd};
use rover_battmon::memory::flash_map;
use rover_battmon::sensor::{AnalogIn, SensorBus};
use rover_battmon::tasks::{
    ByteSource, ReceiveError, SerialLine, Shared, Storages, drive, keep_flash, read_bus, sample_batteries,
    serve_serial,
};
use rover_battmon::vehicle::{Indication, Indicators, Motors};

use super::SimulatedFlash;
use super::links::UNWATCHED;

/// The hardware below the tasks, but for flash and the wires of links.
pub struct Hardware<Pins, Bus, Line, Wheels, Lamps> {
    /// The analog inputs.
    pub pins: Pins,
    /// I2C.
    pub bus: Bus,
    /// The second serial port.
    pub line: Line,
    /// The motors.
    pub wheels: Wheels,
    /// Lamps and buzzer.
    pub lamps: Lamps,
    /// Random bytes for a password.
    pub entropy: Option<[u8; 32]>,
}

impl<Pins, Bus, Line, Wheels, Lamps> Hardware<Pins, Bus, Line, Wheels, Lamps>
where
    Pins: AnalogIn,
    Bus: SensorBus,
    Line: SerialLine,
    Wheels: Motors,
    Lamps: Indicators,
{
    /// Runs the vehicle's tasks, all but those of its links and of CAN.
    pub async fn run(
        self,
        storages: Storages<SimulatedFlash>,
        log: SimulatedFlash,
        memory: &mut RetainedMemory,
        shared: &Shared,
    ) -> ! {
        let sensors = join3(
            sample_batteries(self.pins, memory, shared, &UNWATCHED),
            read_bus(self.bus, shared, &UNWATCHED),
            serve_serial(Some(self.line), shared, &UNWATCHED),
        );
        let entropy = async || self.entropy;
        let flash = keep_flash(storages, log, flash_map::LOG, entropy, shared, &UNWATCHED);
        let drive = drive(self.wheels, self.lamps, shared, &UNWATCHED);
        join3(sensors, drive, flash).await.1
    }
}

/// Reads what `flash` has of `start`.
pub async fn boot(flash: &SimulatedFlash, start: &mut Start) -> Storages<SimulatedFlash> {
    let mut storages = Storages::of_board(flash.clone(), start.radio);
    // No mark of a drive is retained: the newest log shows how the last one ended.
    start.run_end = RunEnd::Unknown;
    storages.boot(ParameterSource::Stored, start).await;
    storages
}

/// Stands for a device on the serial line, so a pack that is measured by it is unhealthy, and for lamps and a buzzer.
pub struct NotSimulated;

impl ByteSource for NotSimulated {
    async fn receive(&mut self, _: &mut [u8]) -> Result<usize, ReceiveError> {
        pending().await
    }
}

impl SerialLine for NotSimulated {
    async fn send(&mut self, _: &[u8]) {}
}

impl Indicators for NotSimulated {
    fn show(&mut self, _: Indication) {}
}
