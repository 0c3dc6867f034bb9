//! A vehicle under test, whatever runs it: the tasks in stepped time, or the release firmware on an emulated board.

use rover_battmon::parameter::ParameterId;
use rover_battmon::sensor::AnalogPin;
use rover_battmon::vehicle::MotorDrive;
use rover_battmon_tools::sim::SimulatedFlash;
use rover_battmon_tools::sim::stepped::{Converter, Port, SteppedBoard, SteppedVehicle};

use crate::commands::{ACCEPTED, PREFLIGHT_REBOOT_SHUTDOWN};
use crate::frames::{
    BATTERY_STATUS, Frame, HEARTBEAT, PARAM_VALUE, ParamValue, SYS_STATUS, acknowledged, frames, of_message,
    result_of, texts_of,
};
use crate::parameter_flash;
use crate::requests::{param_read_by_name, param_set, reboot};
use crate::time::SECOND;

/// A ground station would wait longer.
const ANSWER_TIME_US: u64 = 200_000;

/// Longest wait for a restart that was requested.
const RESTART_US: u64 = 5 * SECOND;

/// A ground station's way to the vehicle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wire {
    /// The telemetry port.
    #[default]
    Uart,
    /// USB, with a program that has opened the port.
    Usb,
}

/// A vehicle with a ground station at a wire.
pub trait TestedVehicle: Sized {
    /// Switches on a vehicle that is not new, with nothing at its pins.
    fn power_up() -> Self;

    /// Switches off and on again.
    fn power_cycle(&mut self);

    /// Time since the first power-up, in µs.
    fn time_us(&self) -> u64;

    fn run_for(&mut self, duration_us: u64);

    /// Sets the voltage at a pin.
    fn set_pin_v(&mut self, pin: AnalogPin, pin_v: f32);

    fn set_converter(&mut self, converter: Converter);

    /// The wire of the ground station from now on.
    fn use_wire(&mut self, wire: Wire);

    /// Sends bytes to the vehicle.
    fn send(&mut self, bytes: &[u8]);

    /// Sends a request.
    fn request(&mut self, request: &[u8]) {
        self.send(request);
    }

    /// The bytes that have left since power-up at the present wire, each with the time of its end in µs.
    fn sent(&mut self) -> Vec<(u64, u8)>;

    /// The output for the motors on the left.
    fn left_drive(&self) -> MotorDrive;

    /// Restarts by the firmware since power-up.
    fn restarts(&self) -> usize;

    /// A vehicle with these parameters, set by a ground station and in effect after a restart.
    fn configured(parameters: &[(&str, f32)]) -> Self {
        let mut vehicle = Self::power_up();
        vehicle.run_for(SECOND);
        vehicle.set_all(parameters);
        vehicle.reboot();
        vehicle
    }

    /// The frames that ended after `time_us`; sending has to have been whole at that time.
    fn frames_since(&mut self, time_us: u64) -> Vec<Frame> {
        let mut sent = self.sent();
        sent.retain(|(at_us, _)| *at_us > time_us);
        frames(&sent)
    }

    /// Sends a request and waits for what is answered in the next 200 ms: the frames of other messages than telemetry.
    fn ask(&mut self, request: &[u8]) -> Vec<Frame> {
        let asked_us = self.time_us();
        self.request(request);
        self.run_for(ANSWER_TIME_US);
        let telemetry = [HEARTBEAT, SYS_STATUS, BATTERY_STATUS];
        let mut answers = frames(&self.sent());
        answers.retain(|frame| frame.at_us > asked_us && !telemetry.contains(&frame.message_id));
        answers
    }

    /// Sends a command and returns its result.
    fn result_of(&mut self, command: &[u8]) -> u8 {
        result_of(&self.ask(command))
    }

    /// Sets a parameter, and returns the texts that came with the answer.
    fn set(&mut self, name: &str, value: f32) -> Vec<String> {
        let answers = self.ask(&param_set(name, value));
        assert_eq!(value_of(&answers, name), Some(value), "{name}: {answers:?}");
        texts_of(&answers)
    }

    fn set_all(&mut self, parameters: &[(&str, f32)]) {
        for (name, value) in parameters {
            self.set(name, *value);
        }
    }

    /// A parameter's value, if it is answered.
    fn read_parameter(&mut self, name: &str) -> Option<f32> {
        value_of(&self.ask(&param_read_by_name(name)), name)
    }

    /// The value of a parameter there is.
    fn parameter(&mut self, name: &str) -> f32 {
        let value = self.read_parameter(name);
        value.unwrap_or_else(|| panic!("{name} was not answered"))
    }

    /// Restarts the vehicle as a ground station does.
    fn reboot(&mut self) {
        let before = self.restarts();
        let answers = self.ask(&reboot());
        assert_eq!(acknowledged(&answers)[0], (PREFLIGHT_REBOOT_SHUTDOWN, ACCEPTED));
        let deadline_us = self.time_us() + RESTART_US;
        while self.restarts() == before {
            assert!(self.time_us() < deadline_us, "no restart");
            self.run_for(1_000);
        }
        self.run_for(SECOND);
    }
}

/// A parameter's value by the answers.
pub fn value_of(answers: &[Frame], name: &str) -> Option<f32> {
    let values = of_message(answers, PARAM_VALUE);
    let mut values = values.iter().map(|frame| ParamValue(frame));
    let answer = values.find(|answer| answer.name() == name);
    answer.map(|answer| answer.value())
}

/// The tasks in stepped time.
pub struct OnHost {
    vehicle: SteppedVehicle,
    wire: Wire,
}

impl TestedVehicle for OnHost {
    fn power_up() -> Self {
        Self::with_stored([])
    }

    fn power_cycle(&mut self) {
        self.vehicle.power_cycle();
    }

    fn time_us(&self) -> u64 {
        self.vehicle.now_us()
    }

    fn run_for(&mut self, duration_us: u64) {
        self.vehicle.run_for(duration_us);
    }

    fn set_pin_v(&mut self, pin: AnalogPin, pin_v: f32) {
        self.vehicle.board.pins.set(pin, pin_v);
    }

    fn set_converter(&mut self, converter: Converter) {
        self.vehicle.board.pins.set_converter(converter);
    }

    fn use_wire(&mut self, wire: Wire) {
        self.wire = wire;
    }

    fn send(&mut self, bytes: &[u8]) {
        self.port().send(bytes);
    }

    fn sent(&mut self) -> Vec<(u64, u8)> {
        self.port().sent()
    }

    fn left_drive(&self) -> MotorDrive {
        self.vehicle.board.drives.latest().left
    }

    fn restarts(&self) -> usize {
        self.vehicle.board.restarts()
    }
}

impl OnHost {
    /// Switches on a vehicle that has stored these parameters.
    pub fn with_stored(parameters: impl IntoIterator<Item = (ParameterId, f32)>) -> Self {
        let flash = SimulatedFlash::blank();
        let stored = parameters.into_iter().map(|(id, value)| (id.key(), value));
        parameter_flash::fill(&flash, stored);
        Self {
            vehicle: SteppedVehicle::power_up(flash),
            wire: Wire::default(),
        }
    }

    /// The vehicle's hardware.
    pub fn board(&self) -> &SteppedBoard {
        &self.vehicle.board
    }

    fn port(&self) -> &Port {
        match self.wire {
            Wire::Uart => &self.vehicle.board.uart,
            Wire::Usb => &self.vehicle.board.usb,
        }
    }
}
