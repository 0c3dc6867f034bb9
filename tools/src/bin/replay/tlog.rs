//! Logs of ground stations (`.tlog`): MAVLink's messages, each behind the time at which it came, in microseconds since 1970.
//!
//! The vehicle is the first autopilot that is heard. Messages are read by the layout of their fields: a number that this
//! version does not know costs nothing.

use std::collections::VecDeque;
use std::io::{self, Read};

use ::mavlink::{Message, calculate_crc};
use rover_battmon::battery::CellVoltages;
use rover_battmon::mavlink::dialect::MavMessage;
use rover_battmon::pack::{MAX_PACKS, Pack};
use rover_battmon::vehicle::ArmState;

use crate::entry::{Content, Entries, Entry};
use crate::px4;
use crate::trace::{Reported, Sample};
use crate::window::Window;

const TIME_BYTES: usize = 8;
const CRC_BYTES: usize = 2;
const SIGNATURE_BYTES: usize = 13;
const FLAG_SIGNED: u8 = 1;

/// The longest message of MAVLink 2 with its time, and the beginning of the next one.
const MOST_NEEDED_BYTES: usize = TIME_BYTES + 10 + 255 + CRC_BYTES + SIGNATURE_BYTES + TIME_BYTES + 1;

/// Times that a log may have, in microseconds: from 2000 to 2100.
const TIMES_US: std::ops::Range<u64> = 946_684_800_000_000..4_102_444_800_000_000;

/// The longest payload, which a shorter one continues with zeros.
const PAYLOAD_BYTES: usize = 255;

const HEARTBEAT: u32 = 0;
const PARAM_VALUE: u32 = 22;
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

/// BATTERY_STATUS: a cell that does not exist, and an unknown temperature.
const NO_CELL_MV: u16 = u16::MAX;
const UNKNOWN_CENTIDEGREES: i16 = i16::MAX;
/// Voltages up to here are of single cells; a single larger one is of the pack.
const MOST_OF_CELL_MV: u16 = 5000;

/// A step back of up to this is a message that was delayed: the reading is skipped. After a larger one the clock was set.
const DELAYED_US: u64 = 10_000_000;

/// The entries of a log.
pub struct Tlog<R> {
    window: Window<R>,
    found: VecDeque<Entry>,
    clock: Clock,
    vehicle: Option<Vehicle>,
    /// Other vehicles, that are not read.
    others: Vec<u8>,
    latest_s: [f64; MAX_PACKS],
    stepped_back: u64,
}

/// The autopilot whose messages are read.
#[derive(Clone, Copy, PartialEq)]
struct Vehicle {
    system_id: u8,
    component_id: u8,
    /// MAV_AUTOPILOT, from its heartbeat.
    autopilot: Option<u8>,
    arm_state: Option<ArmState>,
}

/// Time since the beginning, which a clock that is set back does not reverse.
#[derive(Default)]
struct Clock {
    start_us: Option<u64>,
    latest_us: u64,
    shift_us: u64,
}

/// A message whose checksum is right, or whose checksum is not known.
struct Frame {
    time_us: u64,
    system_id: u8,
    component_id: u8,
    message_id: u32,
    payload: [u8; PAYLOAD_BYTES],
}

impl<R: Read> Tlog<R> {
    /// Of a log that `source` delivers.
    pub fn of(source: R) -> Self {
        Self {
            window: Window::of(source),
            found: VecDeque::new(),
            clock: Clock::default(),
            vehicle: None,
            others: vec![],
            latest_s: [0.0; MAX_PACKS],
            stepped_back: 0,
        }
    }

    fn read_next(&mut self) -> io::Result<Option<Entry>> {
        loop {
            if let Some(entry) = self.found.pop_front() {
                return Ok(Some(entry));
            }
            let rest = self.window.look(MOST_NEEDED_BYTES)?;
            if rest.is_empty() {
                return Ok(None);
            }
            match first_frame(rest) {
                Some((length, frame)) => {
                    self.window.advance(length);
                    self.take(&frame);
                }
                None => self.window.skip(1),
            }
        }
    }

    fn take(&mut self, frame: &Frame) {
        if self.clock.start_us.is_none() {
            self.push(None, Content::StartUtc(frame.time_us as f64 / 1e6));
        }
        let time_s = self.clock.time_s(frame.time_us);
        if frame.message_id == HEARTBEAT {
            self.heartbeat(frame, time_s);
        }
        if frame.message_id == BATTERY_STATUS && self.vehicle.is_none() {
            self.choose(frame);
        }
        let Some(vehicle) = self.vehicle.filter(|vehicle| vehicle.has_sent(frame)) else {
            return;
        };
        match frame.message_id {
            BATTERY_STATUS => self.reading(frame, time_s),
            PARAM_VALUE => self.parameter(frame, time_s, vehicle),
            STATUSTEXT => self.push(Some(time_s), Content::Text(frame.text(1, 50))),
            AUTOPILOT_VERSION => {
                let [patch, minor, major] = [17, 18, 19].map(|place| frame.payload[place]);
                let version = format!("{major}.{minor}.{patch}");
                self.push(None, Content::Version(version));
            }
            _ => {}
        }
    }

    fn push(&mut self, time_s: Option<f64>, content: Content) {
        self.found.push_back(Entry { time_s, content });
    }

    /// The first one that is heard counts.
    fn choose(&mut self, frame: &Frame) {
        if frame.component_id == AUTOPILOT_COMPONENT || frame.message_id == HEARTBEAT {
            self.vehicle = Some(Vehicle {
                system_id: frame.system_id,
                component_id: frame.component_id,
                autopilot: None,
                arm_state: None,
            });
            self.push(None, Content::SystemId(frame.system_id.into()));
        }
    }

    fn heartbeat(&mut self, frame: &Frame, time_s: f64) {
        let [kind, autopilot, modes] = [4, 5, 6].map(|place| frame.payload[place]);
        if autopilot == NO_AUTOPILOT {
            return;
        }
        if self.vehicle.is_none() {
            self.choose(frame);
        }
        let Some(vehicle) = &mut self.vehicle else {
            return;
        };
        if !vehicle.has_sent(frame) {
            let is_other = vehicle.system_id != frame.system_id && !self.others.contains(&frame.system_id);
            if is_other {
                self.others.push(frame.system_id);
                self.push(None, Content::OtherSystem(frame.system_id));
            }
            return;
        }
        let arm_state = match modes & ARMED {
            0 => ArmState::Disarmed,
            _ => ArmState::Armed,
        };
        let is_new = vehicle.autopilot.replace(autopilot).is_none();
        let is_changed = vehicle.arm_state.replace(arm_state) != Some(arm_state);
        if is_new {
            self.push(None, Content::Vehicle(kind));
            self.push(None, Content::Autopilot(autopilot));
        }
        if is_changed {
            self.push(Some(time_s), Content::ArmState(arm_state));
        }
    }

    fn reading(&mut self, frame: &Frame, time_s: f64) {
        let instance = frame.payload[32];
        let Some(pack) = Pack::ALL.into_iter().find(|pack| pack.instance() == instance) else {
            return;
        };
        let latest_s = &mut self.latest_s[usize::from(instance)];
        if time_s < *latest_s {
            self.stepped_back += 1;
            return;
        }
        *latest_s = time_s;
        let sample = frame.sample(time_s);
        self.push(Some(time_s), Content::Reading(pack, Box::new(sample)));
    }

    fn parameter(&mut self, frame: &Frame, time_s: f64, vehicle: Vehicle) {
        let (name, bits) = (frame.text(8, 16), u32::from_le_bytes(frame.bytes(0)));
        let is_px4 = vehicle.autopilot == Some(px4::AUTOPILOT);
        // px4::AUTOPILOT sends the bits of an integer in place of a number.
        let value = match frame.payload[24] {
            INTEGER if is_px4 => f64::from(bits as i32),
            _ => f64::from(f32::from_bits(bits)),
        };
        if !value.is_finite() {
            return;
        }
        if is_px4 {
            for (name, value) in px4::translated(&name, value) {
                self.push(Some(time_s), Content::Parameter(name, value));
            }
        }
        self.push(Some(time_s), Content::Parameter(name, value));
    }
}

impl<R: Read> Entries for Tlog<R> {
    fn read_bytes(&self) -> u64 {
        self.window.read_bytes()
    }

    fn skipped_bytes(&self) -> u64 {
        self.window.skipped_bytes()
    }

    fn stepped_back(&self) -> u64 {
        self.stepped_back
    }
}

impl<R: Read> Iterator for Tlog<R> {
    type Item = io::Result<Entry>;

    fn next(&mut self) -> Option<Self::Item> {
        self.read_next().transpose()
    }
}

/// Whether a file begins with a message behind its time.
pub fn is_tlog(head: &[u8]) -> bool {
    first_frame(head).is_some()
}

/// The message that `bytes` begin with, and its length with its time. One whose checksum is not known counts if another message,
/// or the end, follows it.
fn first_frame(bytes: &[u8]) -> Option<(usize, Frame)> {
    let time_us = time_us(bytes)?;
    let frame = &bytes[TIME_BYTES..];
    let (header_bytes, signature_bytes) = match *frame {
        [0xfe, ..] => (6, 0),
        [0xfd, _, flags, ..] if flags & !FLAG_SIGNED == 0 => (10, usize::from(flags) * SIGNATURE_BYTES),
        _ => return None,
    };
    let header = frame.get(..header_bytes)?;
    let (system_id, component_id, message_id) = match *header {
        [_, _, _, system, component, id] => (system, component, u32::from(id)),
        [_, _, _, _, _, system, component, id0, id1, id2] => {
            (system, component, u32::from_le_bytes([id0, id1, id2, 0]))
        }
        _ => return None,
    };
    let end = header_bytes + usize::from(header[1]);
    let length = end + CRC_BYTES + signature_bytes;
    let crc = frame.get(end..end + CRC_BYTES)?;
    let (_, following) = frame.split_at_checked(length)?;
    let extra = MavMessage::extra_crc(message_id);
    let is_intact = || calculate_crc(&frame[1..end], extra).to_le_bytes() == *crc;
    let is_good = match is_read(message_id) {
        true => is_intact(),
        false => following.is_empty() || is_beginning(following),
    };
    let mut payload = [0; PAYLOAD_BYTES];
    let content = &frame[header_bytes..end];
    payload[..content.len()].copy_from_slice(content);
    is_good.then_some((
        TIME_BYTES + length,
        Frame {
            time_us,
            system_id,
            component_id,
            message_id,
            payload,
        },
    ))
}

fn is_read(message_id: u32) -> bool {
    [
        HEARTBEAT,
        PARAM_VALUE,
        BATTERY_STATUS,
        AUTOPILOT_VERSION,
        STATUSTEXT,
    ]
    .contains(&message_id)
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

impl Vehicle {
    fn has_sent(&self, frame: &Frame) -> bool {
        (self.system_id, self.component_id) == (frame.system_id, frame.component_id)
    }
}

impl Clock {
    fn time_s(&mut self, time_us: u64) -> f64 {
        let start_us = *self.start_us.get_or_insert(time_us);
        let mut since_us = time_us.saturating_add(self.shift_us).saturating_sub(start_us);
        if since_us.saturating_add(DELAYED_US) < self.latest_us {
            self.shift_us = self.shift_us.saturating_add(self.latest_us - since_us);
            since_us = self.latest_us;
        }
        self.latest_us = self.latest_us.max(since_us);
        since_us as f64 / 1e6
    }
}

impl Frame {
    fn bytes<const N: usize>(&self, place: usize) -> [u8; N] {
        std::array::from_fn(|offset| self.payload[place + offset])
    }

    fn text(&self, place: usize, length: usize) -> String {
        let bytes = &self.payload[place..place + length];
        let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(length);
        String::from_utf8_lossy(&bytes[..end]).into_owned()
    }

    /// BATTERY_STATUS: −1 is unknown.
    fn sample(&self, time_s: f64) -> Sample {
        let known = |value: i32| (value != -1).then_some(value as f32);
        let whole = |place| known(i32::from_le_bytes(self.bytes(place)));
        let short = |place| i16::from_le_bytes(self.bytes(place));
        let voltage = |place| u16::from_le_bytes(self.bytes(place));
        let first = (10..30).step_by(2).map(voltage);
        // Those behind the tenth are 0 where there is none.
        let further = (41..49).step_by(2).map(voltage).take_while(|mv| *mv != 0);
        let voltages = first.chain(further).filter(|mv| *mv != NO_CELL_MV);
        let voltages_mv: Vec<u16> = voltages.collect();
        let is_of_cells = voltages_mv.len() > 1 && voltages_mv.iter().all(|mv| *mv <= MOST_OF_CELL_MV);
        let sum_mv: u32 = voltages_mv.iter().map(|mv| u32::from(*mv)).sum();
        let centidegrees = Some(short(8)).filter(|centidegrees| *centidegrees != UNKNOWN_CENTIDEGREES);
        let faults = u32::from_le_bytes(self.bytes(50));
        Sample {
            time_s,
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
                remaining_pct: known((self.payload[35] as i8).into()),
                health_pct: None,
                charge_state: Some(self.payload[40]),
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
    use crate::survey::Survey;
    use crate::table::Drives;
    use proptest::prelude::*;

    const START_US: u64 = 1_700_000_000_000_000;

    /// A message of MAVLink 2 at a time, in milliseconds since the start.
    fn message(time_ms: i64, system_id: u8, message_id: u32, payload: &[u8]) -> Vec<u8> {
        let [id0, id1, id2, _] = message_id.to_le_bytes();
        let header = [payload.len() as u8, 0, 0, 0, system_id, 1, id0, id1, id2];
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

    fn read(bytes: &[u8]) -> (Vec<Content>, Tlog<&[u8]>) {
        let mut log = Tlog::of(bytes);
        let entries = log.by_ref().map(|entry| entry.expect("it is readable").content);
        (entries.collect(), log)
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
    fn the_first_vehicle_is_read_and_others_are_named() {
        let log = [
            heartbeat(0, 255, NO_AUTOPILOT, ARMED),
            heartbeat(0, 7, 3, 0),
            heartbeat(1, 8, 3, ARMED),
            battery(2, 8, &[9000]),
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
            Content::ArmState(ArmState::Disarmed),
            Content::OtherSystem(8),
            Content::Reading(Pack::First, sample),
            Content::ArmState(ArmState::Armed),
        ] = &found[..]
        else {
            panic!("{found:?}");
        };
        assert_eq!(sample.voltage_v, Some(12.0));
        assert_eq!(log.skipped_bytes(), 0);
    }

    #[test]
    fn a_delayed_reading_is_skipped_and_a_clock_that_is_set_back_loses_none() {
        let times = |times_ms: &[i64]| {
            let log: Vec<Vec<u8>> = times_ms
                .iter()
                .map(|time_ms| battery(*time_ms, 1, &[12_000]))
                .collect();
            let bytes = log.concat();
            let times_s: Vec<f64> = samples(&bytes).iter().map(|sample| sample.time_s).collect();
            let (_, read) = read(&bytes);
            (times_s, read.stepped_back())
        };
        assert_eq!(times(&[0, 100, 90, 200, 200]), (vec![0.0, 0.1, 0.2, 0.2], 1));
        assert_eq!(times(&[0, 60_000, 1000, 2000]), (vec![0.0, 60.0, 60.0, 61.0], 0));
        let log = [0, 100, 90]
            .map(|time_ms| battery(time_ms, 1, &[12_000]))
            .concat();
        let drives = Drives::read("log", || Ok(Box::new(Tlog::of(log.as_slice()))), &[]);
        assert_eq!(drives.expect("drives").backward_steps, 1);
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
    fn a_parameter_of_the_vehicles_own_log_does_not_arm_it() {
        let log = [
            battery(0, 1, &[12_000]),
            parameter(b"LOG_DISARMED\0\0\0\0", [0; 4], 9),
        ];
        let survey = Survey::of(Box::new(Tlog::of(log.concat().as_slice()))).expect("it is readable");
        assert_eq!(survey.armed_before(), None);
    }

    #[test]
    fn garbage_and_a_torn_end_cost_what_they_hit() {
        let message = |second: i64| battery(1000 * second, 1, &[12_000]);
        let unknown = [&START_US.to_be_bytes()[..], &[0xfe, 2, 0, 1, 1, 199, 1, 2, 3, 4]].concat();
        let log = [message(0), unknown, vec![0xfd; 70], message(1), message(2)].concat();
        assert_eq!(samples(&log).len(), 3);
        assert_eq!(samples(&log[..log.len() - 1]).len(), 2);
        let (_, read) = read(&log);
        // Garbage, and the unknown message before it.
        assert_eq!(read.skipped_bytes(), 70 + 18);
    }

    proptest! {
        #[test]
        fn any_bytes_can_be_read(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            read(&bytes);
            let log = [heartbeat(0, 1, 3, ARMED), bytes, battery(1, 1, &[12_000])].concat();
            prop_assert_eq!(samples(&log).len(), 1);
            let (_, read) = read(&log);
            prop_assert_eq!(read.read_bytes(), log.len() as u64);
        }
    }
}
