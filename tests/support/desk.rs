//! The autopilot on a desk: one link, with a ground station at the other end, and no tasks.

use rover_battmon::autopilot::{
    Autopilot, FlashJob, FlashResult, FlashStore, PackIdentity, SamplingProgress, Start,
};
use rover_battmon::battery::{BatteryState, PackStatus, RetainedRecord};
use rover_battmon::mavlink::{Endpoint, Event, Framer, LinkKind};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, ParameterId, Parameters, VehicleParameter};
use rover_battmon::sensor::AnalogReadings;
use rover_battmon::system::LinkStatistics;
use rover_battmon::time::Instant;
use rover_battmon::vehicle::{SideDrives, Vehicle};
pub use rover_battmon_tools::sim::stepped::conversions;

use crate::frames::{Frame, PARAM_VALUE, ParamValue, frames, of_message, result_of};
use crate::requests::{VEHICLE, param_request_list, param_set};

/// The board's divider at the pack: its voltage by that at the pin.
pub const DIVIDER: f32 = 3.95;

pub const LOW_VOLT: ParameterId = ParameterId::Battery(Pack::First, BatteryParameter::LowVolt);
pub const EXTRA1: ParameterId = ParameterId::Vehicle(VehicleParameter::Sr0Extra1);

const FAST: u32 = 100_000;

/// The index of a parameter that is not listed.
const NOT_LISTED: u16 = u16::MAX;

const DRIVER_LIMIT: ParameterId = ParameterId::Vehicle(VehicleParameter::MotDrvVolt);

const MONITOR: ParameterId = ParameterId::Battery(Pack::First, BatteryParameter::Monitor);

/// The parameter of this name.
pub fn id_of(name: &str) -> ParameterId {
    ParameterId::from_name(name.as_bytes()).unwrap_or_else(|| panic!("no {name}"))
}

/// A start with these parameters.
pub fn start_with(named: &[(&str, f32)]) -> Start {
    let mut parameters = Parameters::defaults();
    for (name, value) in named {
        assert_eq!(parameters.set(id_of(name), *value), Ok(()), "{name} {value}");
    }
    Start::with_parameters(parameters)
}

/// The messages that leave by a link while the wire takes this many.
pub fn frames_of(
    autopilot: &mut Autopilot,
    endpoint: &mut Endpoint,
    framer: &mut Framer,
    now: Instant,
    messages: usize,
) -> Vec<Frame> {
    let mut bytes = Vec::new();
    for _ in 0..messages {
        let Some(frame) = autopilot.next_frame(endpoint, framer, now) else {
            break;
        };
        bytes.extend(frame.iter().map(|byte| (0, *byte)));
    }
    frames(&bytes)
}

/// The autopilot, and our end of a link.
pub struct Desk {
    pub autopilot: Autopilot,
    pub endpoint: Endpoint,
    pub framer: Framer,
    pub now_us: u64,
    /// For how long what is delivered may have waited on its way.
    pub waited_us: u64,
}

impl Desk {
    /// A desk without packs.
    pub fn without_packs() -> Self {
        Self::with_packs(&[])
    }

    /// A desk with packs in these states. None of them is sampled, since none was monitored at the start.
    pub fn with_packs(batteries: &[BatteryState]) -> Self {
        let mut parameters = Parameters::defaults();
        let monitor = parameters.get(MONITOR);
        parameters.restore(MONITOR.key(), 0.0).unwrap();
        let mut desk = Self::with_own_drivers(Start::with_parameters(parameters));
        let parameters = desk.autopilot.parameters_mut();
        parameters.restore(MONITOR.key(), monitor).unwrap();
        desk.set_batteries(batteries);
        desk
    }

    /// A desk after this start, whose motor drivers stand any pack.
    pub fn starting(mut start: Start) -> Self {
        start.parameters.restore(DRIVER_LIMIT.key(), 0.0).unwrap();
        Self::with_own_drivers(start)
    }

    /// A desk after this start, whose motor drivers stand what its parameters say.
    pub fn with_own_drivers(start: Start) -> Self {
        Self {
            autopilot: Autopilot::new(&start),
            endpoint: Endpoint::new("desk", LinkKind::Radio, FAST, Instant::EPOCH),
            framer: Framer::new(),
            now_us: 0,
            waited_us: 0,
        }
    }

    pub fn now(&self) -> Instant {
        Instant::from_micros(self.now_us)
    }

    /// Connects by another link, which is fast.
    pub fn connect(&mut self, kind: LinkKind) {
        self.connect_slowly(kind, FAST);
    }

    /// Connects by another link that carries `bytes_per_second`.
    pub fn connect_slowly(&mut self, kind: LinkKind, bytes_per_second: u32) {
        self.endpoint = Endpoint::new("desk", kind, bytes_per_second, self.now());
    }

    pub fn parameters(&self) -> &Parameters {
        self.autopilot.parameters()
    }

    /// Sets a parameter that is in range, not by the link.
    pub fn set(&mut self, id: impl Into<ParameterId>, value: f32) {
        self.autopilot.parameters_mut().set(id, value).expect("in range");
    }

    pub fn vehicle(&self) -> &Vehicle {
        self.autopilot.vehicle()
    }

    /// Sets the states of the first packs; the others are disabled.
    pub fn set_batteries(&mut self, batteries: &[BatteryState]) {
        let disabled = BatteryState {
            status: PackStatus::Disabled,
            ..BatteryState::default()
        };
        for (place, pack) in Pack::ALL.into_iter().enumerate() {
            let state = batteries.get(place).unwrap_or(&disabled);
            self.autopilot.set_battery(pack, *state);
        }
    }

    /// Changes the state of a pack.
    pub fn change_battery(&mut self, pack: Pack, change: impl FnOnce(&mut BatteryState)) {
        let mut state = *self.autopilot.battery(pack);
        change(&mut state);
        self.autopilot.set_battery(pack, state);
    }

    /// Samples all packs once.
    pub fn sample(&mut self, readings: AnalogReadings) {
        let mut sampling = self.autopilot.begin_sampling(self.now(), readings);
        while self.autopilot.sample_next(&mut sampling) != SamplingProgress::Complete {}
        let mut memory = [RetainedRecord::BLANK; 2];
        self.autopilot.end_sampling(sampling, &mut memory);
    }

    /// Updates the vehicle, and returns the motors' outputs.
    pub fn drive(&mut self) -> SideDrives {
        self.autopilot.drive(self.now()).drives
    }

    /// Delivers bytes in chunks of `chunk` and returns the result.
    pub fn receive_in_chunks(&mut self, bytes: &[u8], chunk: usize) -> Vec<Event> {
        let mut events = Vec::new();
        for mut part in bytes.chunks(chunk) {
            while !part.is_empty() {
                let taken = self.endpoint.push(part);
                assert!(taken > 0, "no room for another byte");
                part = &part[taken..];
                events.extend(self.handle_all());
            }
        }
        events
    }

    /// Handles every frame of what was delivered.
    pub fn handle_all(&mut self) -> Vec<Event> {
        let now = self.now();
        let received_at = now.before_us(self.waited_us);
        std::iter::from_fn(|| self.autopilot.handle_next(&mut self.endpoint, now, received_at)).collect()
    }

    /// Posts what is due at `now_us`.
    pub fn post_due(&mut self, now_us: u64) {
        let now = Instant::from_micros(now_us);
        self.autopilot.post_due(&mut self.endpoint, now);
    }

    /// When something is due next.
    pub fn next_due_us(&self) -> u64 {
        self.endpoint.next_due().as_micros()
    }

    pub fn next_flash_job(&mut self, store: FlashStore) -> Option<FlashJob> {
        self.autopilot.next_flash_job(store, self.now())
    }

    pub fn flash_done(&mut self, job: &FlashJob, result: FlashResult) {
        self.autopilot.flash_done(job, result, self.now());
    }

    pub fn learnt_read(&mut self, identity: PackIdentity, stored: FlashResult) {
        self.flash_done(&FlashJob::ReadLearnt(identity), stored);
    }

    pub fn statistics(&self) -> LinkStatistics {
        self.endpoint.statistics()
    }

    /// Delivers a request and returns the answers.
    pub fn ask(&mut self, request: &[u8]) -> Vec<Frame> {
        self.receive_in_chunks(request, 64);
        self.sent()
    }

    /// Everything that waits to leave.
    pub fn sent(&mut self) -> Vec<Frame> {
        self.sent_at_most(usize::MAX)
    }

    /// The messages that leave while the wire takes this many.
    pub fn sent_at_most(&mut self, messages: usize) -> Vec<Frame> {
        let (now, endpoint) = (self.now(), &mut self.endpoint);
        frames_of(&mut self.autopilot, endpoint, &mut self.framer, now, messages)
    }

    /// Delivers a request and returns its only answer.
    pub fn one_answer(&mut self, request: &[u8]) -> Frame {
        let answers = self.ask(request);
        assert_eq!(answers.len(), 1, "{answers:?}");
        answers[0].clone()
    }

    /// Delivers a command and returns its result.
    pub fn result_of(&mut self, command: &[u8]) -> u8 {
        result_of(&self.ask(command))
    }

    /// The parameters of a list, by name, while `meanwhile` happens after each that is sent.
    pub fn list(&mut self, mut meanwhile: impl FnMut(&str, &mut Parameters)) -> Vec<String> {
        let mut frames = self.ask(&param_request_list(VEHICLE));
        let mut listed = Vec::new();
        // A minute is more than a list takes; the streams go on for ever.
        loop {
            for frame in of_message(&frames, PARAM_VALUE) {
                let name = ParamValue(frame).name();
                meanwhile(&name, self.autopilot.parameters_mut());
                listed.push(name);
            }
            let due_us = self.next_due_us();
            if due_us > 60_000_000 {
                return listed;
            }
            self.post_due(due_us);
            frames = self.sent();
        }
    }

    /// The names of what is listed now.
    pub fn listed(&self) -> Vec<String> {
        let listed = self.parameters().listed();
        listed.map(|id| id.name().as_str().into()).collect()
    }

    /// Asserts that this announces the parameter with this value.
    pub fn assert_param_value(&self, frame: &Frame, id: ParameterId, value: f32) {
        assert_eq!(frame.message_id, PARAM_VALUE);
        let answer = ParamValue(frame);
        assert_eq!(answer.name(), id.name().as_str());
        let index = self.parameters().listed().position(|listed| listed == id);
        assert_eq!(answer.index(), index.map_or(NOT_LISTED, |index| index as u16));
        assert_eq!(usize::from(answer.count()), self.parameters().listed().count());
        assert_eq!(answer.value(), value, "{}", answer.name());
    }

    /// Asserts that a ground station can set it.
    pub fn assert_set(&mut self, name: &str, id: ParameterId, value: f32) {
        let answer = self.one_answer(&param_set(name, value));
        self.assert_param_value(&answer, id, value);
    }
}
