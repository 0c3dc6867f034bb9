//! Logs of ground stations (`.tlog`): MAVLink's messages, each behind the time at which it came, in microseconds since 1970.
//!
//! A first pass finds the vehicle, and where the station's clock was set: [`Senders`]. Messages are read by the layout of their
//! fields: a number that this version does not know costs nothing.

use std::cmp::Reverse;
use std::collections::{HashSet, VecDeque};
use std::io::{self, Read};

use ::mavlink::{Message, calculate_crc};
use rover_battmon::battery::CellVoltages;
use rover_battmon::mavlink::dialect::MavMessage;
use rover_battmon::pack::{MAX_PACKS, Pack};
use rover_battmon::vehicle::ArmState;

use super::entry::{Content, Entry, Reported, Sample};
use super::log::{Log, Messages};
use super::px4;

const TIME_BYTES: usize = 8;
const CRC_BYTES: usize = 2;
const SIGNATURE_BYTES: usize = 13;
const FLAG_SIGNED: u8 = 1;

/// Times that a log may have, in microseconds: from 2000 to 2100.
const TIMES_US: std::ops::Range<u64> = 946_684_800_000_000..4_102_444_800_000_000;

const HEARTBEAT: u32 = 0;
const SYS_STATUS: u32 = 1;
const SYSTEM_TIME: u32 = 2;
const PARAM_VALUE: u32 = 22;
const RAW_IMU: u32 = 27;
const ATTITUDE: u32 = 30;
const GLOBAL_POSITION_INT: u32 = 33;
const BATTERY_STATUS: u32 = 147;
const AUTOPILOT_VERSION: u32 = 148;
const STATUSTEXT: u32 = 253;

/// MAV_COMP_ID_AUTOPILOT1.
const AUTOPILOT_COMPONENT: u8 = 1;
/// MAV_AUTOPILOT_INVALID, of what is no autopilot.
const NO_AUTOPILOT: u8 = 8;
/// MAV_MODE_FLAG_SAFETY_ARMED.
const ARMED: u8 = 128;
/// MAV_PARAM_TYPE_INT32.
const INTEGER: u8 = 6;

/// BATTERY_STATUS: a cell that does not exist, and an unknown temperature. SYS_STATUS: an unknown voltage, beside 0.
const NO_CELL_MV: u16 = u16::MAX;
const UNKNOWN_CENTIDEGREES: i16 = i16::MAX;
/// Voltages up to here are of single cells; a single larger one is of the pack.
const MOST_OF_CELL_MV: u16 = 5000;

/// Characters of a STATUSTEXT; a longer text comes in several with the same id.
const TEXT_BYTES: usize = 50;
/// The rest of it is awaited for this long.
const TEXT_TIMEOUT_S: f64 = 2.0;

/// A step back of up to this is a message that was delayed: the reading is skipped. After a larger one the clock was set.
const DELAYED_US: i64 = 10_000_000;
/// A step back from here on is looked at, and so is one ahead from [`DELAYED_US`] on: the vehicle's clock may know better.
const BACK_US: i64 = 1_000_000;
/// The longest time without a message: a drive that is appended to the one of the day before.
const LONGEST_GAP_US: i64 = 86_400_000_000;
/// Later times of a vehicle are since 1970.
const SINCE_START_UP_US: i64 = 1_000_000_000_000_000;

/// Senders and steps that are remembered: damage may look like more.
const MOST_SENDERS: usize = 64;
const MOST_STEPS: usize = 10_000;

/// The messages of a log, after a first pass.
#[derive(Default)]
pub struct Tlog {
    senders: Senders,
    /// Number of the clock's jumps so far.
    jumps: usize,
    previous_us: Option<u64>,
    /// Since the first message; a delayed one is earlier than the latest.
    elapsed_us: i64,
    latest_us: i64,
    arm_state: Option<ArmState>,
    latest_s: [f64; MAX_PACKS],
    texts: Vec<Chunks>,
}

/// The parts of a text so far.
struct Chunks {
    id: u16,
    next: u8,
    bytes: Vec<u8>,
    began_s: f64,
}

/// Findings of a first pass over a log.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Senders {
    /// All that sent a message that is read.
    all: Vec<Sender>,
    /// The one that is read, by its place.
    vehicle: Option<usize>,
    previous_us: Option<u64>,
    /// Steps of times: place in the file, and how far.
    steps: Vec<(u64, i64)>,
    /// Time so far, without the steps.
    steady_us: i64,
}

/// A sender of messages.
#[derive(Clone, Debug, Default, PartialEq)]
struct Sender {
    system_id: u8,
    component_id: u8,
    /// Type and autopilot of its heartbeats, if it is a vehicle.
    kind: Option<[u8; 2]>,
    heartbeats: u64,
    battery_statuses: u64,
    has_first_pack: bool,
    sys_statuses: u64,
    /// Parameters that others replace.
    replaced: HashSet<&'static str>,
    /// Its clock, the steady time and the number of steps at its latest message with a time.
    clock: Option<(i64, i64, usize)>,
    /// The message of its readings by which the usual interval is known, as with [`Self::clock`].
    reading: Option<(u32, i64, usize)>,
    interval_us: i64,
    /// Steps so far that are resolved.
    resolved: usize,
    /// Steps that are no time that went by.
    jumps: Vec<Jump>,
}

/// A step of times that was no time, but a setting of the station's clock.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Jump {
    /// Place in the file of the first message behind it.
    place: u64,
    step_us: i64,
    /// The time that went by meanwhile.
    passed_us: i64,
}

/// A message whose checksum is right, or whose checksum is not known. Its payload may lack zeros at the end.
struct Frame<'a> {
    time_us: u64,
    system_id: u8,
    component_id: u8,
    message_id: u32,
    payload: &'a [u8],
}

/// The entries of a log that `source` delivers, of which this is known.
pub fn read<R: Read>(source: R, senders: Senders) -> Log<R, Tlog> {
    let messages = Tlog {
        senders,
        ..Tlog::default()
    };
    Log::of(source, messages)
}

impl Messages for Tlog {
    const MOST_NEEDED_BYTES: usize = TIME_BYTES + 10 + 255 + CRC_BYTES + SIGNATURE_BYTES + TIME_BYTES + 1;

    fn take(&mut self, bytes: &[u8], offset: u64, found: &mut VecDeque<Entry>) -> Option<usize> {
        let (length, frame) = first_frame(bytes)?;
        if self.previous_us.is_none() {
            self.begin(frame.time_us, found);
        }
        self.advance(frame.time_us, offset, found);
        let vehicle = self.senders.vehicle();
        if vehicle.is_some_and(|vehicle| vehicle.has_sent(&frame)) {
            self.message(&frame, found);
        }
        Some(length)
    }

    fn is_cut(&self, bytes: &[u8]) -> bool {
        let (time, frame) = bytes.split_at(bytes.len().min(TIME_BYTES));
        match frame_bytes(frame) {
            Some(length) => is_beginning(bytes) && length > frame.len(),
            // Zeros are no time.
            None => frame.len() < 3 && is_beginning(bytes) && time.iter().any(|byte| *byte != 0),
        }
    }

    fn finish(&mut self, found: &mut VecDeque<Entry>) {
        self.end_texts(f64::INFINITY, found);
    }
}

impl Tlog {
    /// The facts that the first pass has found.
    fn begin(&mut self, time_us: u64, found: &mut VecDeque<Entry>) {
        let mut contents = vec![Content::StartUtc(time_us as f64 / 1e6)];
        if let Some(vehicle) = self.senders.vehicle() {
            contents.push(Content::SystemId(vehicle.system_id.into()));
            if let Some([kind, autopilot]) = vehicle.kind {
                contents.extend([Content::Vehicle(kind), Content::Autopilot(autopilot)]);
            }
            contents.extend(vehicle.uses_sys_status().then_some(Content::FromSysStatus));
        }
        let others = self.senders.others();
        contents.extend(others.map(|(id, readings)| Content::OtherSystem(id, readings)));
        let time_s = None;
        found.extend(contents.into_iter().map(|content| Entry { time_s, content }));
    }

    /// Takes the time of the next message.
    fn advance(&mut self, time_us: u64, offset: u64, found: &mut VecDeque<Entry>) {
        let step_us = difference_us(time_us, self.previous_us.replace(time_us));
        let vehicle = self.senders.vehicle();
        let jump = vehicle.and_then(|vehicle| vehicle.jumps.get(self.jumps));
        let Some(jump) = jump.filter(|jump| jump.place == offset).copied() else {
            self.elapsed_us += step_us;
            self.latest_us = self.latest_us.max(self.elapsed_us);
            return;
        };
        self.jumps += 1;
        self.latest_us += jump.passed_us;
        self.elapsed_us = self.latest_us;
        let set_s = (jump.step_us - jump.passed_us) as f64 / 1e6;
        self.push(Content::ClockStep(set_s), found);
    }

    fn time_s(&self) -> f64 {
        self.latest_us as f64 / 1e6
    }

    fn push(&self, content: Content, found: &mut VecDeque<Entry>) {
        let time_s = Some(self.time_s());
        found.push_back(Entry { time_s, content });
    }

    fn message(&mut self, frame: &Frame, found: &mut VecDeque<Entry>) {
        self.end_texts(self.time_s() - TEXT_TIMEOUT_S, found);
        match frame.message_id {
            HEARTBEAT => self.heartbeat(frame, found),
            BATTERY_STATUS => {
                let instance = frame.byte(32);
                let pack = Pack::ALL.into_iter().find(|pack| pack.instance() == instance);
                if let Some(pack) = pack {
                    self.reading(pack, frame.sample(), found);
                }
            }
            SYS_STATUS if self.senders.vehicle().is_some_and(Sender::uses_sys_status) => {
                self.reading(Pack::First, frame.sample_of_sys_status(), found);
            }
            PARAM_VALUE => self.parameter(frame, found),
            STATUSTEXT => self.text(frame, found),
            AUTOPILOT_VERSION => {
                let [patch, minor, major] = [17, 18, 19].map(|place| frame.byte(place));
                let version = format!("{major}.{minor}.{patch}");
                self.push(Content::Version(version), found);
            }
            _ => {}
        }
    }

    fn heartbeat(&mut self, frame: &Frame, found: &mut VecDeque<Entry>) {
        let arm_state = match frame.byte(6) & ARMED {
            0 => ArmState::Disarmed,
            _ => ArmState::Armed,
        };
        let is_of_vehicle = frame.byte(5) != NO_AUTOPILOT;
        if is_of_vehicle && self.arm_state.replace(arm_state) != Some(arm_state) {
            self.push(Content::ArmState(arm_state), found);
        }
    }

    fn reading(&mut self, pack: Pack, sample: Sample, found: &mut VecDeque<Entry>) {
        let latest_s = &mut self.latest_s[usize::from(pack.instance())];
        if (self.elapsed_us as f64 / 1e6) < *latest_s {
            return self.push(Content::SteppedBack, found);
        }
        let time_s = self.latest_us as f64 / 1e6;
        *latest_s = time_s;
        self.push(
            Content::Reading(pack, Box::new(Sample { time_s, ..sample })),
            found,
        );
    }

    fn parameter(&mut self, frame: &Frame, found: &mut VecDeque<Entry>) {
        let Some(vehicle) = self.senders.vehicle() else {
            return;
        };
        let (name, bits) = (frame.parameter_name(), u32::from_le_bytes(frame.bytes(0)));
        let is_px4 = vehicle
            .kind
            .is_some_and(|[_, autopilot]| autopilot == px4::AUTOPILOT);
        // It sends the bits of an integer in place of a number.
        let value = match frame.byte(24) {
            INTEGER if is_px4 => f64::from(bits as i32),
            _ => f64::from(f32::from_bits(bits)),
        };
        if !value.is_finite() {
            return;
        }
        if is_px4 && !vehicle.replaced.contains(name.as_str()) {
            for (name, value) in px4::translated(&name, value) {
                self.push(Content::Parameter(name, value), found);
            }
        }
        self.push(Content::Parameter(name, value), found);
    }

    /// A part of a text, or all of it: then it has no id.
    fn text(&mut self, frame: &Frame, found: &mut VecDeque<Entry>) {
        let part = frame.characters(1, TEXT_BYTES);
        let (id, number) = (u16::from_le_bytes(frame.bytes(51)), frame.byte(53));
        let place = self.texts.iter().position(|text| text.id == id);
        let place = place.unwrap_or_else(|| {
            self.texts.push(Chunks {
                id,
                next: 0,
                bytes: vec![],
                began_s: self.time_s(),
            });
            self.texts.len() - 1
        });
        let text = &mut self.texts[place];
        // Of one that came twice the first counts.
        if number >= text.next {
            let is_missing = number > text.next;
            text.bytes.extend(if is_missing { "…" } else { "" }.as_bytes());
            text.bytes.extend(&part);
            text.next = number.saturating_add(1);
        }
        if id == 0 || part.len() < TEXT_BYTES {
            self.end_text(place, found);
        }
    }

    /// Gives texts that began up to a moment, and whose end is missing or fills its message.
    fn end_texts(&mut self, until_s: f64, found: &mut VecDeque<Entry>) {
        while self.texts.first().is_some_and(|text| text.began_s <= until_s) {
            self.end_text(0, found);
        }
    }

    fn end_text(&mut self, place: usize, found: &mut VecDeque<Entry>) {
        let text = self.texts.remove(place);
        let text = String::from_utf8_lossy(&text.bytes).into_owned();
        self.push(Content::Text(text), found);
    }
}

impl Messages for Senders {
    const MOST_NEEDED_BYTES: usize = Tlog::MOST_NEEDED_BYTES;

    fn take(&mut self, bytes: &[u8], offset: u64, _: &mut VecDeque<Entry>) -> Option<usize> {
        let (length, frame) = first_frame(bytes)?;
        self.note(&frame, offset);
        Some(length)
    }

    fn is_cut(&self, _: &[u8]) -> bool {
        false
    }
}

impl Senders {
    /// Reads a log to its end. `system` is the id of the vehicle, if the user has chosen one.
    ///
    /// # Errors
    /// It can't be read.
    pub fn of(source: impl Read, system: Option<u8>) -> io::Result<Self> {
        let mut log = Log::of(source, Self::default());
        // It gives no entry before the end of the file.
        log.next().transpose()?;
        let mut senders = log.into_messages();
        senders.choose(system);
        Ok(senders)
    }

    fn note(&mut self, frame: &Frame, offset: u64) {
        let step_us = difference_us(frame.time_us, self.previous_us.replace(frame.time_us));
        if (-BACK_US..=DELAYED_US).contains(&step_us) {
            self.steady_us += step_us;
        } else if self.steps.len() < MOST_STEPS {
            self.steps.push((offset, step_us));
        }
        if !is_read(frame.message_id) {
            return;
        }
        let mut senders = self.all.iter_mut();
        if let Some(sender) = senders.find(|sender| sender.has_sent(frame)) {
            sender.note(frame, self.steady_us, &self.steps);
        } else if self.all.len() < MOST_SENDERS {
            let mut sender = Sender {
                system_id: frame.system_id,
                component_id: frame.component_id,
                ..Sender::default()
            };
            sender.note(frame, self.steady_us, &self.steps);
            self.all.push(sender);
        }
    }

    /// The autopilot of a vehicle, by its component and type; of several the one with most readings, then most heartbeats, then
    /// the first.
    fn choose(&mut self, system: Option<u8>) {
        let places = 0..self.all.len();
        let candidates = places.filter(|place| {
            let sender = &self.all[*place];
            sender.is_candidate() && system.is_none_or(|system| sender.system_id == system)
        });
        self.vehicle = candidates.max_by_key(|place| {
            let sender = &self.all[*place];
            let is_autopilot = sender.component_id == AUTOPILOT_COMPONENT && sender.kind.is_some();
            (
                is_autopilot,
                sender.readings(),
                sender.heartbeats,
                Reverse(*place),
            )
        });
        if let Some(place) = self.vehicle {
            self.all[place].set_aside(&self.steps, 0, is_jump);
        }
        self.steps = vec![];
    }

    fn vehicle(&self) -> Option<&Sender> {
        self.all.get(self.vehicle?)
    }

    /// Whether there is a vehicle that can be read.
    pub fn has_vehicle(&self) -> bool {
        self.vehicle.is_some()
    }

    /// The ids of other vehicles with their readings.
    pub fn others(&self) -> impl Iterator<Item = (u8, u64)> {
        let own = self.vehicle().map(|vehicle| vehicle.system_id);
        let others = self.all.iter().filter(|sender| sender.is_candidate());
        let others = others.filter(move |sender| Some(sender.system_id) != own);
        others.map(|sender| (sender.system_id, sender.readings()))
    }
}

impl Sender {
    fn has_sent(&self, frame: &Frame) -> bool {
        (self.system_id, self.component_id) == (frame.system_id, frame.component_id)
    }

    /// A vehicle, or an autopilot that does not say of what.
    fn is_candidate(&self) -> bool {
        self.kind.is_some() || (self.component_id == AUTOPILOT_COMPONENT && self.readings() > 0)
    }

    fn uses_sys_status(&self) -> bool {
        !self.has_first_pack && self.sys_statuses > 0
    }

    fn readings(&self) -> u64 {
        match self.uses_sys_status() {
            true => self.battery_statuses + self.sys_statuses,
            false => self.battery_statuses,
        }
    }

    fn note(&mut self, frame: &Frame, steady_us: i64, steps: &[(u64, i64)]) {
        match frame.message_id {
            HEARTBEAT if is_vehicle(frame) => {
                self.kind = Some([frame.byte(4), frame.byte(5)]);
                self.heartbeats += 1;
            }
            BATTERY_STATUS => {
                self.battery_statuses += 1;
                self.has_first_pack |= frame.byte(32) == 0;
                self.note_reading(frame, steady_us, steps);
            }
            SYS_STATUS if frame.sample_of_sys_status().voltage_v.is_some() => {
                self.sys_statuses += 1;
                self.note_reading(frame, steady_us, steps);
            }
            PARAM_VALUE => self.replaced.extend(px4::replaced_by(&frame.parameter_name())),
            _ => {}
        }
        if let Some(clock_us) = frame.clock_us() {
            self.note_clock(clock_us, steady_us, steps);
        }
    }

    /// The vehicle's clock shows how long a step took, unless it has started again since.
    fn note_clock(&mut self, clock_us: i64, steady_us: i64, steps: &[(u64, i64)]) {
        if let Some((before_us, steady_before_us, steps_before)) = self.clock {
            let passed_us = clock_us - before_us;
            if (-DELAYED_US..0).contains(&passed_us) {
                return;
            }
            if passed_us >= 0 && self.resolved < steps.len() && steps_before == self.resolved {
                self.resolve(steps, passed_us - (steady_us - steady_before_us));
            }
        }
        self.clock = Some((clock_us, steady_us, steps.len()));
    }

    /// Without its clock, the usual interval is what went by.
    fn note_reading(&mut self, frame: &Frame, steady_us: i64, steps: &[(u64, i64)]) {
        let Some((message_id, before_us, steps_before)) = self.reading else {
            self.reading = Some((frame.message_id, steady_us, steps.len()));
            return;
        };
        if frame.message_id != message_id || (message_id == BATTERY_STATUS && frame.byte(32) != 0) {
            return;
        }
        let passed_us = steady_us - before_us;
        if steps_before == steps.len() {
            self.interval_us = match self.interval_us {
                0 => passed_us,
                interval_us => interval_us + (passed_us - interval_us) / 8,
            };
        }
        let has_clock = self
            .clock
            .is_some_and(|(.., steps_before)| steps_before == self.resolved);
        if self.resolved < steps.len() && !has_clock {
            self.set_aside(steps, self.interval_us - passed_us, is_jump);
        }
        self.reading = Some((message_id, steady_us, steps.len()));
    }

    /// Resolves new steps that took this long by the vehicle's clock: if they say the same, messages are missing.
    fn resolve(&mut self, steps: &[(u64, i64)], passed_us: i64) {
        let mut new = steps[self.resolved..].iter();
        let sum_us: i64 = new.clone().map(|(_, step_us)| step_us).sum();
        let is_gap = new.all(|(_, step_us)| *step_us > 0) && (sum_us - passed_us).abs() <= DELAYED_US;
        self.set_aside(steps, passed_us, |_| !is_gap);
    }

    /// Sets new steps aside that are jumps: the first takes the time that went by.
    fn set_aside(&mut self, steps: &[(u64, i64)], passed_us: i64, is_jump: impl Fn(i64) -> bool) {
        let mut left_us = passed_us.max(0);
        for (place, step_us) in steps[self.resolved..].iter().copied() {
            if is_jump(step_us) {
                let passed_us = std::mem::take(&mut left_us);
                self.jumps.push(Jump {
                    place,
                    step_us,
                    passed_us,
                });
            }
        }
        self.resolved = steps.len();
    }
}

/// Whether a step is a jump, as far as can be said without the vehicle's clock.
fn is_jump(step_us: i64) -> bool {
    !(-DELAYED_US..=LONGEST_GAP_US).contains(&step_us)
}

/// Whether a file begins with a message behind its time.
pub fn is_tlog(head: &[u8]) -> bool {
    first_frame(head).is_some()
}

/// Whether there are two messages in a row.
pub fn has_messages(head: &[u8]) -> bool {
    (0..head.len())
        .any(|place| first_frame(&head[place..]).is_some_and(|(length, _)| is_tlog(&head[place + length..])))
}

fn difference_us(time_us: u64, before_us: Option<u64>) -> i64 {
    time_us as i64 - before_us.unwrap_or(time_us) as i64
}

/// Length of header, content, checksum and signature of the message of which these are the first bytes.
fn frame_bytes(frame: &[u8]) -> Option<usize> {
    match *frame {
        [0xfe, length, ..] => Some(6 + usize::from(length) + CRC_BYTES),
        [0xfd, length, flags, ..] if flags & !FLAG_SIGNED == 0 => {
            Some(10 + usize::from(length) + CRC_BYTES + usize::from(flags) * SIGNATURE_BYTES)
        }
        _ => None,
    }
}

/// The message that `bytes` begin with, and its length with its time. One whose checksum is not known counts if another message,
/// or the end, follows it.
fn first_frame(bytes: &[u8]) -> Option<(usize, Frame<'_>)> {
    let time_us = time_us(bytes)?;
    let frame = &bytes[TIME_BYTES..];
    let (frame, following) = frame.split_at_checked(frame_bytes(frame)?)?;
    let (header, system_id, component_id, message_id) = match *frame {
        [0xfe, _, _, system, component, id, ..] => (6, system, component, u32::from(id)),
        [_, _, _, _, _, system, component, id0, id1, id2, ..] => {
            (10, system, component, u32::from_le_bytes([id0, id1, id2, 0]))
        }
        _ => return None,
    };
    let end = header + usize::from(frame[1]);
    let is_good = match is_read(message_id) {
        true => {
            let crc = calculate_crc(&frame[1..end], MavMessage::extra_crc(message_id));
            frame[end..].starts_with(&crc.to_le_bytes())
        }
        false => following.is_empty() || is_beginning(following),
    };
    let content = Frame {
        time_us,
        system_id,
        component_id,
        message_id,
        payload: &frame[header..end],
    };
    is_good.then_some((TIME_BYTES + frame.len(), content))
}

fn is_read(message_id: u32) -> bool {
    matches!(
        message_id,
        HEARTBEAT
            | SYS_STATUS
            | SYSTEM_TIME
            | PARAM_VALUE
            | RAW_IMU
            | ATTITUDE
            | GLOBAL_POSITION_INT
            | BATTERY_STATUS
            | AUTOPILOT_VERSION
            | STATUSTEXT
    )
}

/// Whether a heartbeat is that of a vehicle: not of a station, a camera, a gimbal, a companion computer or another component.
fn is_vehicle(heartbeat: &Frame) -> bool {
    let is_vehicle = matches!(heartbeat.byte(4), 0..=5 | 7..=17 | 19..=25 | 28 | 29 | 35 | 43 | 45..=47);
    is_vehicle && heartbeat.byte(5) != NO_AUTOPILOT
}

/// Whether a message may begin here, as far as the file goes.
fn is_beginning(bytes: &[u8]) -> bool {
    match bytes.get(TIME_BYTES) {
        Some(start) => time_us(bytes).is_some() && [0xfe, 0xfd].contains(start),
        None => true,
    }
}

fn time_us(bytes: &[u8]) -> Option<u64> {
    let time_us = u64::from_be_bytes(*bytes.first_chunk()?);
    TIMES_US.contains(&time_us).then_some(time_us)
}

impl Frame<'_> {
    fn byte(&self, place: usize) -> u8 {
        self.payload.get(place).copied().unwrap_or(0)
    }

    fn bytes<const N: usize>(&self, place: usize) -> [u8; N] {
        std::array::from_fn(|offset| self.byte(place + offset))
    }

    /// Up to the first zero.
    fn characters(&self, place: usize, length: usize) -> Vec<u8> {
        let bytes = (place..place + length).map(|place| self.byte(place));
        bytes.take_while(|byte| *byte != 0).collect()
    }

    fn parameter_name(&self) -> String {
        String::from_utf8_lossy(&self.characters(8, 16)).into_owned()
    }

    /// The sender's time since its start.
    fn clock_us(&self) -> Option<i64> {
        let milliseconds = |place| Some(i64::from(u32::from_le_bytes(self.bytes(place))) * 1000);
        match self.message_id {
            SYSTEM_TIME => milliseconds(8),
            ATTITUDE | GLOBAL_POSITION_INT => milliseconds(0),
            RAW_IMU => {
                let time_us = i64::try_from(u64::from_le_bytes(self.bytes(0))).ok()?;
                (time_us < SINCE_START_UP_US).then_some(time_us)
            }
            _ => None,
        }
    }

    /// SYS_STATUS: −1 is unknown; PX4 sends −1 A then.
    fn sample_of_sys_status(&self) -> Sample {
        let mv = u16::from_le_bytes(self.bytes(14));
        let centiamperes = i16::from_le_bytes(self.bytes(16));
        let known_a = Some(centiamperes).filter(|centiamperes| ![-1, -100].contains(centiamperes));
        let pct = self.byte(30) as i8;
        Sample {
            voltage_v: (mv != 0 && mv != NO_CELL_MV).then_some(f32::from(mv) / 1e3),
            current_a: known_a.map(|centiamperes| f32::from(centiamperes) / 1e2),
            reported: Some(Reported {
                remaining_pct: (pct != -1).then_some(f32::from(pct)),
                ..Reported::default()
            }),
            ..Sample::NONE
        }
    }

    /// BATTERY_STATUS: −1 is unknown.
    fn sample(&self) -> Sample {
        let known = |value: i32| (value != -1).then_some(value as f32);
        let whole = |place| known(i32::from_le_bytes(self.bytes(place)));
        let short = |place| i16::from_le_bytes(self.bytes(place));
        let voltage = |place| u16::from_le_bytes(self.bytes(place));
        let first = (10..30).step_by(2).map(voltage);
        // Behind the tenth a missing one is 0.
        let further = (41..49).step_by(2).map(voltage).take_while(|mv| *mv != 0);
        let voltages = first.chain(further).filter(|mv| *mv != NO_CELL_MV);
        let voltages_mv: Vec<u16> = voltages.collect();
        let is_of_cells = voltages_mv.len() > 1 && voltages_mv.iter().all(|mv| *mv <= MOST_OF_CELL_MV);
        let sum_mv: u32 = voltages_mv.iter().map(|mv| u32::from(*mv)).sum();
        let centidegrees = Some(short(8)).filter(|centidegrees| *centidegrees != UNKNOWN_CENTIDEGREES);
        let faults = u32::from_le_bytes(self.bytes(50));
        Sample {
            voltage_v: (!voltages_mv.is_empty()).then_some(sum_mv as f32 / 1e3),
            current_a: known(short(30).into()).map(|hundredths| hundredths / 1e2),
            temperature_c: centidegrees.map(|centidegrees| f32::from(centidegrees) / 1e2),
            cells: match is_of_cells {
                true => CellVoltages::from_millivolts(&voltages_mv),
                false => CellVoltages::NONE,
            },
            reported: Some(Reported {
                consumed_mah: whole(0),
                // Hectojoules.
                consumed_wh: whole(4).map(|hectojoules| hectojoules / 36.0),
                remaining_pct: known((self.byte(35) as i8).into()),
                health_pct: None,
                charge_state: Some(self.byte(40)),
                faults: Some(faults as u16),
                extremes: None,
            }),
            ..Sample::NONE
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recordings::entry::Entries;
    use proptest::prelude::*;
    use proptest::sample::Index;
    use std::collections::BTreeMap;

    const START_US: u64 = 1_700_000_000_000_000;

    /// A message of MAVLink 2 of an autopilot at a time, in milliseconds since the start.
    fn message(time_ms: i64, system_id: u8, message_id: u32, payload: &[u8]) -> Vec<u8> {
        message_of(time_ms, [system_id, AUTOPILOT_COMPONENT], message_id, payload)
    }

    fn message_of(
        time_ms: i64,
        [system_id, component_id]: [u8; 2],
        message_id: u32,
        payload: &[u8],
    ) -> Vec<u8> {
        let [id0, id1, id2, _] = message_id.to_le_bytes();
        let header = [
            payload.len() as u8,
            0,
            0,
            0,
            system_id,
            component_id,
            id0,
            id1,
            id2,
        ];
        let covered = [&header[..], payload].concat();
        let crc = calculate_crc(&covered, MavMessage::extra_crc(message_id));
        let time_us = START_US.saturating_add_signed(1000 * time_ms);
        [&time_us.to_be_bytes()[..], &[0xfd], &covered, &crc.to_le_bytes()].concat()
    }

    fn heartbeat(time_ms: i64, system_id: u8, autopilot: u8, modes: u8) -> Vec<u8> {
        message(
            time_ms,
            system_id,
            HEARTBEAT,
            &[0, 0, 0, 0, 11, autopilot, modes, 4, 3],
        )
    }

    /// Of a pack with these cells in millivolts, at 5 A.
    fn battery(time_ms: i64, system_id: u8, cells_mv: &[u16]) -> Vec<u8> {
        let mut payload = [0; 54];
        payload[..8].fill(0xff);
        payload[8..10].copy_from_slice(&UNKNOWN_CENTIDEGREES.to_le_bytes());
        payload[10..30].fill(0xff);
        payload[30..32].copy_from_slice(&500_i16.to_le_bytes());
        payload[35] = 50;
        for (place, mv) in (10..30).step_by(2).chain((41..49).step_by(2)).zip(cells_mv) {
            payload[place..place + 2].copy_from_slice(&mv.to_le_bytes());
        }
        message(time_ms, system_id, BATTERY_STATUS, &payload)
    }

    fn parameter(name: &[u8; 16], bits: [u8; 4], kind: u8) -> Vec<u8> {
        message(0, 1, PARAM_VALUE, &[&bits[..], &[0; 4], name, &[kind]].concat())
    }

    fn read_for(system: Option<u8>, bytes: &[u8]) -> (Vec<Content>, Log<&[u8], Tlog>) {
        let senders = Senders::of(bytes, system).expect("it is readable");
        let mut log = super::read(bytes, senders);
        let entries = log.by_ref().map(|entry| entry.expect("it is readable").content);
        (entries.collect(), log)
    }

    fn read(bytes: &[u8]) -> (Vec<Content>, Log<&[u8], Tlog>) {
        read_for(None, bytes)
    }

    fn samples(bytes: &[u8]) -> Vec<Sample> {
        let readings = read(bytes).0.into_iter().filter_map(|content| match content {
            Content::Reading(_, sample) => Some(*sample),
            _ => None,
        });
        readings.collect()
    }

    #[test]
    fn a_pack_has_the_sum_of_up_to_14_cells_or_its_own_voltage() {
        for (cells_mv, volts, count) in [
            (&[3500; 14][..], 49.0, 14),
            (&[4000; 3], 12.0, 3),
            (&[12_000], 12.0, 0),
            // A voltage that is too large for one field.
            (&[65_534, 4466], 70.0, 0),
        ] {
            let [sample] = samples(&battery(0, 1, cells_mv))[..] else {
                panic!("one reading");
            };
            assert_eq!(sample.voltage_v, Some(volts), "{cells_mv:?}");
            assert_eq!(sample.cells.count(), count, "{cells_mv:?}");
            let reported = sample.reported.expect("a report");
            assert_eq!((sample.current_a, sample.temperature_c), (Some(5.0), None));
            assert_eq!(
                (reported.consumed_mah, reported.remaining_pct),
                (None, Some(50.0))
            );
        }
    }

    #[test]
    fn the_vehicle_with_most_readings_is_read_and_others_are_named() {
        let log = [
            heartbeat(0, 255, NO_AUTOPILOT, ARMED),
            // A camera, with the number of an autopilot.
            message_of(0, [1, 100], HEARTBEAT, &[0, 0, 0, 0, 30, 0, ARMED, 4, 3]),
            heartbeat(0, 8, 3, ARMED),
            battery(0, 8, &[9000]),
            heartbeat(1, 7, 3, 0),
            battery(3, 7, &[12_000]),
            battery(3, 7, &[12_000]),
            heartbeat(4, 7, 3, ARMED),
        ];
        let bytes = log.concat();
        let (found, log) = read(&bytes);
        let [
            Content::StartUtc(_),
            Content::SystemId(7),
            Content::Vehicle(11),
            Content::Autopilot(3),
            Content::OtherSystem(8, 1),
            Content::ArmState(ArmState::Disarmed),
            Content::Reading(Pack::First, sample),
            Content::Reading(Pack::First, _),
            Content::ArmState(ArmState::Armed),
        ] = &found[..]
        else {
            panic!("{found:?}");
        };
        assert_eq!(sample.voltage_v, Some(12.0));
        assert_eq!(log.bytes().skipped, 0);
        let (found, _) = read_for(Some(8), &bytes);
        assert!(found.contains(&Content::SystemId(8)) && found.contains(&Content::OtherSystem(7, 2)));
        // Nothing but a camera.
        assert!(
            !Senders::of(&bytes[..80], None)
                .expect("it is readable")
                .has_vehicle()
        );
    }

    #[test]
    fn sys_status_counts_where_battery_status_is_missing() {
        let status = |time_ms, mv: u16, centiamperes: i16, pct: i8| {
            let mut payload = [0; 31];
            payload[14..16].copy_from_slice(&mv.to_le_bytes());
            payload[16..18].copy_from_slice(&centiamperes.to_le_bytes());
            payload[30] = pct as u8;
            message(time_ms, 1, SYS_STATUS, &payload)
        };
        let statuses = [
            status(0, 12_000, 250, 80),
            status(1, 0, -1, -1),
            status(2, u16::MAX, 100, 0),
            status(3, 11_000, -100, 0),
        ]
        .concat();
        let readings: Vec<_> = samples(&statuses)
            .iter()
            .map(|sample| {
                let reported = sample.reported.expect("a report");
                (sample.voltage_v, sample.current_a, reported.remaining_pct)
            })
            .collect();
        let expected = [
            (Some(12.0), Some(2.5), Some(80.0)),
            (None, None, None),
            (None, Some(1.0), Some(0.0)),
            (Some(11.0), None, Some(0.0)),
        ];
        assert_eq!(readings, expected);
        let both = [statuses, battery(3, 1, &[11_000])].concat();
        assert_eq!(samples(&both).len(), 1);
        // A vehicle without a sensor.
        assert!(samples(&status(0, 0, -1, -1)).is_empty());
    }

    #[test]
    fn parts_of_a_text_are_one_text_by_their_id() {
        let part = |time_ms, id: u16, number: u8, text: &str| {
            let mut payload = [0; 54];
            payload[1..1 + text.len()].copy_from_slice(text.as_bytes());
            payload[51..53].copy_from_slice(&id.to_le_bytes());
            payload[53] = number;
            message(time_ms, 1, STATUSTEXT, &payload)
        };
        let full = "x".repeat(TEXT_BYTES);
        for (parts, expected) in [
            (
                vec![part(0, 1, 0, &full), part(1, 1, 1, "Battery 1 is critical")],
                vec![format!("{full}Battery 1 is critical")],
            ),
            // Two at once, one of them heard twice; and a text of its own between them.
            (
                vec![
                    part(0, 1, 0, &full),
                    part(0, 2, 0, &full),
                    part(0, 1, 0, &full),
                    part(1, 0, 0, "short"),
                    part(1, 2, 1, "two"),
                    part(1, 1, 1, "one"),
                ],
                vec!["short".into(), format!("{full}two"), format!("{full}one")],
            ),
            // The first one is lost, and a text that fills its parts.
            (vec![part(0, 1, 1, "is critical")], vec!["…is critical".into()]),
            (
                vec![part(0, 1, 0, &full), part(5000, 0, 0, "later")],
                vec![full.clone(), "later".into()],
            ),
            (vec![part(0, 1, 0, &full)], vec![full.clone()]),
        ] {
            let log = [vec![heartbeat(0, 1, 3, 0)], parts].concat().concat();
            let texts = read(&log).0.into_iter().filter_map(|content| match content {
                Content::Text(text) => Some(text),
                _ => None,
            });
            let expected: Vec<String> = expected;
            assert_eq!(texts.collect::<Vec<_>>(), expected);
        }
    }

    /// A log that is written by a clock which is set: each message at its true time, and by how much the clock is ahead then.
    fn times_s(messages: &[(i64, i64, Vec<u8>)]) -> Vec<f64> {
        let at = |(time_ms, ahead_ms, message): &(i64, i64, Vec<u8>)| {
            let time_us = START_US.saturating_add_signed(1000 * (time_ms + ahead_ms));
            [&time_us.to_be_bytes(), &message[TIME_BYTES..]].concat()
        };
        let log = messages.iter().map(at).collect::<Vec<_>>().concat();
        samples(&log).iter().map(|sample| sample.time_s).collect()
    }

    #[test]
    fn a_delayed_reading_is_skipped_and_a_clock_that_is_set_moves_none() {
        let times = |times_ms: &[i64]| {
            let log: Vec<Vec<u8>> = times_ms
                .iter()
                .map(|time_ms| battery(*time_ms, 1, &[12_000]))
                .collect();
            let bytes = log.concat();
            let times_s: Vec<f64> = samples(&bytes).iter().map(|sample| sample.time_s).collect();
            let (found, _) = read(&bytes);
            let stepped_back = found
                .iter()
                .filter(|content| **content == Content::SteppedBack)
                .count();
            let steps = found.into_iter().filter_map(|content| match content {
                Content::ClockStep(step_s) => Some(step_s),
                _ => None,
            });
            (times_s, steps.collect::<Vec<_>>(), stepped_back)
        };
        assert_eq!(
            times(&[0, 100, 90, 200, 200]),
            (vec![0.0, 0.1, 0.2, 0.2], vec![], 1)
        );
        // Two drives in one file.
        assert_eq!(
            times(&[0, 1000, 80_000_000]),
            (vec![0.0, 1.0, 80_000.0], vec![], 0)
        );
        assert_eq!(
            times(&[59_000, 60_000, 1000, 2000]),
            (vec![0.0, 1.0, 2.0, 3.0], vec![-60.0], 0)
        );
        let days = 100 * 86_400_000;
        assert_eq!(
            times(&[0, 1000, days + 2000]),
            (vec![0.0, 1.0, 2.0], vec![days as f64 / 1e3], 0)
        );
    }

    #[test]
    fn the_vehicles_clock_shows_a_gap_that_is_no_step() {
        let attitude =
            |time_ms: i64, boot_ms: u32| (time_ms, message(0, 1, ATTITUDE, &boot_ms.to_le_bytes()));
        let reading = |time_ms: i64| (time_ms, battery(0, 1, &[12_000]));
        for (messages, expected) in [
            // It says that an hour went by, that 100 ms did, or nothing, as it has started again.
            (
                [
                    attitude(0, 9000),
                    reading(50),
                    reading(3_600_050),
                    attitude(3_600_100, 3_609_100),
                ],
                3600.0,
            ),
            (
                [
                    attitude(0, 9000),
                    reading(50),
                    reading(3_600_050),
                    attitude(3_600_100, 9200),
                ],
                0.1,
            ),
            (
                [
                    attitude(0, 90_000),
                    reading(50),
                    reading(3_600_050),
                    attitude(3_600_100, 200),
                ],
                3600.0,
            ),
            (
                [
                    attitude(0, 9000),
                    reading(5000),
                    reading(50),
                    attitude(100, 14_200),
                ],
                0.1,
            ),
        ] {
            let messages = messages.map(|(time_ms, message)| (time_ms, 0, message));
            let times_s = times_s(&messages);
            let [first, second] = times_s[..] else {
                panic!("{times_s:?}");
            };
            assert!((second - first - expected).abs() < 0.11, "{times_s:?}");
        }
    }

    #[test]
    fn integers_of_px4_are_bits_and_those_of_ardupilot_numbers() {
        let of = |autopilot, bits| {
            let log = [
                heartbeat(0, 1, autopilot, 0),
                parameter(b"BAT1_N_CELLS\0\0\0\0", bits, INTEGER),
            ];
            read(&log.concat()).0.pop()
        };
        let cells = |name: &str, value| Some(Content::Parameter(name.into(), value));
        assert_eq!(
            of(px4::AUTOPILOT, 4_i32.to_le_bytes()),
            cells("BAT1_N_CELLS", 4.0)
        );
        assert_eq!(of(3, 4_f32.to_le_bytes()), cells("BAT1_N_CELLS", 4.0));
    }

    #[test]
    fn an_older_parameter_counts_only_without_the_one_that_replaces_it() {
        let cells = |name: &[u8; 16], count: i32| parameter(name, count.to_le_bytes(), INTEGER);
        let [older, newer] = [b"BAT_N_CELLS\0\0\0\0\0", b"BAT1_N_CELLS\0\0\0\0"];
        for (parameters, expected) in [
            (vec![cells(older, 3)], vec![3.0]),
            (vec![cells(older, 3), cells(newer, 6)], vec![6.0]),
            (vec![cells(newer, 6), cells(older, 3)], vec![6.0]),
            (vec![cells(newer, 0), cells(older, 3)], vec![]),
        ] {
            let log = [vec![heartbeat(0, 1, px4::AUTOPILOT, 0)], parameters]
                .concat()
                .concat();
            let found = read(&log).0.into_iter().filter_map(|content| match content {
                Content::Parameter(name, value) if name == "BATT_CELLS" => Some(value),
                _ => None,
            });
            assert_eq!(found.collect::<Vec<_>>(), expected);
        }
    }

    #[test]
    fn garbage_and_a_torn_end_cost_what_they_hit() {
        let message = |second: i64| battery(1000 * second, 1, &[12_000]);
        let unknown = [&START_US.to_be_bytes()[..], &[0xfe, 2, 0, 1, 1, 199, 1, 2, 3, 4]].concat();
        let log = [message(0), unknown, vec![0xfd; 70], message(1), message(2)].concat();
        assert_eq!(samples(&log).len(), 3);
        let torn = &log[..log.len() - 1];
        assert_eq!(samples(torn).len(), 2);
        let length = message(2).len() as u64;
        assert_eq!(super::tests::read(torn).1.bytes().cut, length - 1);
        let (_, read) = read(&log);
        // Garbage, and the unknown message before it.
        assert_eq!(read.bytes().skipped, 70 + 18);
    }

    proptest! {
        #[test]
        fn any_bytes_can_be_read(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            read(&bytes);
            let log = [heartbeat(0, 1, 3, ARMED), bytes, battery(1, 1, &[12_000])].concat();
            prop_assert_eq!(samples(&log).len(), 1);
            let (_, read) = read(&log);
            prop_assert_eq!(read.bytes().read, log.len() as u64);
        }

        /// Readings twice a second, with and without a clock of the vehicle, which may start again.
        #[test]
        fn any_sequence_of_jumps_keeps_order_count_and_charge(
            jumps in prop::collection::vec((any::<Index>(), any::<bool>(), 11_000i64..20_000_000), 0..8),
            has_clock in any::<bool>(),
            restart in prop::option::of(1usize..400),
        ) {
            let count = 400;
            // One at a place, and none before the interval is known.
            let jumps: BTreeMap<usize, (bool, i64)> = jumps
                .iter()
                .map(|(place, is_back, by_ms)| (12 + place.index(count - 12), (*is_back, *by_ms)))
                .collect();
            let mut ahead_ms = vec![0; count];
            for (place, (is_back, by_ms)) in jumps {
                // Without its clock a shorter one ahead is a gap.
                let step_ms = match (is_back, has_clock && restart.is_none()) {
                    (true, _) => -by_ms,
                    (false, true) => by_ms,
                    (false, false) => by_ms + 86_400_000,
                };
                ahead_ms[place..].iter_mut().for_each(|ahead_ms| *ahead_ms += step_ms);
            }
            let mut boot_ms = 70_000;
            let messages = (0..count).map(|place| {
                let time_ms = 125 * place as i64;
                boot_ms += 125;
                if restart == Some(place) {
                    boot_ms = 0;
                }
                let message = match place % 4 {
                    0 => battery(0, 1, &[12_000]),
                    _ if has_clock => message(0, 1, ATTITUDE, &u32::to_le_bytes(boot_ms)),
                    _ => heartbeat(0, 1, 3, ARMED),
                };
                (time_ms, ahead_ms[place], message)
            });
            let times_s = times_s(&messages.collect::<Vec<_>>());
            prop_assert_eq!(times_s.len(), 100);
            prop_assert!(times_s.is_sorted(), "{:?}", times_s);
            // The charge of a constant current is its time.
            let passed_s = times_s[99] - times_s[0];
            prop_assert!((passed_s - 49.5).abs() < 0.2, "{passed_s}");
        }
    }
}
