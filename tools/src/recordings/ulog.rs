//! PX4's logs (`.ulg`), as far as they are readable.
//!
//! A message counts if its type exists, its content fits the format that the log states for it, and another message, or the
//! end, follows. Anything else is skipped byte by byte. Formats are read of the topics only that are used here.
//!
//! PX4's own crate, `px4-ulog` 0.6.1, does not check the lengths of contents, and ends at the first damaged message.

use std::collections::{HashMap, HashSet, VecDeque};
use std::io::Read;
use std::ops::Range;
use std::rc::Rc;

use rover_battmon::battery::CellVoltages;
use rover_battmon::pack::{MAX_PACKS, Pack};
use rover_battmon::parameter::BatteryParameter;
use rover_battmon::vehicle::ArmState;

use super::entry::{Content, Entry, Reported, Sample};
use super::log::{Log, Messages};
use super::px4;

/// The beginning of a file, before its version.
const MAGIC: &[u8] = b"ULog\x01\x12\x35";
const FILE_HEADER_BYTES: usize = 16;

/// The length of a message's content and its type.
const HEADER_BYTES: usize = 3;

const TYPES: &[u8] = b"FDIMPARSOLCQB";

/// Topics that are used here.
const BATTERY: &str = "battery_status";
const ACTUATORS: &str = "actuator_armed";
const STATUS: &str = "vehicle_status";
const GPS: &str = "vehicle_gps_position";

/// `arming_state` of a vehicle that is armed.
const STATE_ARMED: f64 = 2.0;

/// UTC is unknown before 2000, in microseconds. Later times of data, as PX4's simulator has them, are since 1970.
const UTC_FROM_US: f64 = 946_684_800e6;

/// The most cells of which a log has voltages.
const MOST_CELLS: usize = 14;

/// The messages of a log.
#[derive(Default)]
pub struct ULog {
    has_header: bool,
    formats: HashMap<String, Rc<Format>>,
    /// Format of each message of data, by its number.
    topics: HashMap<u16, Topic>,
    is_armed: Option<bool>,
    has_actuators: bool,
    /// The first time of data if it is since 1970, in microseconds.
    start_us: Option<f64>,
    /// Parameters that others replace.
    replaced: HashSet<&'static str>,
    /// Older parameters of the definitions, until these end without those that replace them.
    older: Vec<(String, f64)>,
    has_cells: [bool; MAX_PACKS],
}

/// A topic that is logged.
#[derive(Clone)]
struct Topic {
    name: Rc<str>,
    instance: u8,
    format: Rc<Format>,
}

/// Fields of a topic up to the first one that is itself a topic.
struct Format {
    fields: Vec<Field>,
}

struct Field {
    name: String,
    kind: Kind,
    place: Range<usize>,
}

/// The type of a field's elements.
#[derive(Clone, Copy)]
enum Kind {
    Unsigned(usize),
    Signed(usize),
    Single,
    Double,
}

/// The fields of a message of data.
struct Data<'a> {
    format: &'a Format,
    bytes: &'a [u8],
}

/// The entries of a log that `source` delivers.
pub fn read<R: Read>(source: R) -> Log<R, ULog> {
    Log::of(source, ULog::default())
}

impl Messages for ULog {
    const MOST_NEEDED_BYTES: usize = HEADER_BYTES + u16::MAX as usize + HEADER_BYTES;

    fn take(&mut self, bytes: &[u8], _: u64, found: &mut VecDeque<Entry>) -> Option<usize> {
        if !self.has_header {
            self.has_header = is_ulog(bytes);
            let autopilot = self.has_header.then_some(Content::Autopilot(px4::AUTOPILOT));
            found.extend(autopilot.map(|content| Entry {
                time_s: None,
                content,
            }));
            return self.has_header.then_some(FILE_HEADER_BYTES);
        }
        let (kind, content) = first_message(bytes, &self.topics)?;
        let _ = self.message(kind, content, found);
        Some(HEADER_BYTES + content.len())
    }

    fn is_cut(&self, bytes: &[u8]) -> bool {
        header(bytes).map_or(bytes.len() < HEADER_BYTES, |(_, length)| {
            HEADER_BYTES + length > bytes.len()
        })
    }

    fn finish(&mut self, found: &mut VecDeque<Entry>) {
        self.end_definitions(found);
    }
}

impl ULog {
    /// `None` if the message contradicts itself.
    fn message(&mut self, kind: u8, content: &[u8], found: &mut VecDeque<Entry>) -> Option<()> {
        match kind {
            b'F' => self.format(content),
            b'A' => {
                self.end_definitions(found);
                self.topic(content)
            }
            b'D' => self.data(content, found),
            b'P' => self.parameter(content, found),
            b'I' => information(content, found),
            b'L' => {
                let (header, text) = content.split_at_checked(9)?;
                let time_s = self.time_s(u64::from_le_bytes(*header.last_chunk()?) as f64);
                let text = String::from_utf8_lossy(text).into_owned();
                push(found, Some(time_s), Content::Text(text));
                Some(())
            }
            _ => Some(()),
        }
    }

    /// Times since 1970 start at 0.
    fn time_s(&mut self, time_us: f64) -> f64 {
        if time_us < UTC_FROM_US {
            return time_us / 1e6;
        }
        let start_us = *self.start_us.get_or_insert(time_us);
        (time_us - start_us).max(0.0) / 1e6
    }

    /// Parameters follow each other in any order.
    fn end_definitions(&mut self, found: &mut VecDeque<Entry>) {
        for (name, value) in std::mem::take(&mut self.older) {
            self.setting(&name, value, found);
        }
    }

    fn setting(&mut self, name: &str, value: f64, found: &mut VecDeque<Entry>) {
        if self.replaced.contains(name) {
            return;
        }
        for (name, value) in px4::translated(name, value) {
            for (pack, has_cells) in Pack::ALL.into_iter().zip(&mut self.has_cells) {
                *has_cells |= name == BatteryParameter::Cells.of(pack).name().as_str();
            }
            push(found, None, Content::Parameter(name, value));
        }
    }

    /// The number of cells, which PX4 knows without a parameter, too.
    fn cell_count(&mut self, pack: Pack, count: Option<f64>, found: &mut VecDeque<Entry>) {
        let has_cells = &mut self.has_cells[usize::from(pack.instance())];
        if let Some(count) = count.filter(|count| *count > 0.0 && !*has_cells) {
            *has_cells = true;
            let name = BatteryParameter::Cells.of(pack).name().to_string();
            push(found, None, Content::Parameter(name, count));
        }
    }

    fn format(&mut self, content: &[u8]) -> Option<()> {
        let (name, fields) = std::str::from_utf8(content).ok()?.split_once(':')?;
        if [BATTERY, ACTUATORS, STATUS, GPS].contains(&name) {
            self.formats.insert(name.into(), Rc::new(Format::of(fields)));
        }
        Some(())
    }

    fn topic(&mut self, content: &[u8]) -> Option<()> {
        let [instance, number0, number1, name @ ..] = content else {
            return None;
        };
        let name = std::str::from_utf8(name).ok()?;
        let topic = Topic {
            name: name.into(),
            instance: *instance,
            format: self.formats.get(name)?.clone(),
        };
        self.topics
            .insert(u16::from_le_bytes([*number0, *number1]), topic);
        Some(())
    }

    fn data(&mut self, content: &[u8], found: &mut VecDeque<Entry>) -> Option<()> {
        let (number, bytes) = content.split_first_chunk()?;
        let Topic {
            name,
            instance,
            format,
        } = self.topics.get(&u16::from_le_bytes(*number))?.clone();
        let data = Data {
            format: &format,
            bytes,
        };
        let time_us = data.number("timestamp")?;
        let time_s = self.time_s(time_us);
        let content = match &*name {
            BATTERY => {
                let pack = Pack::ALL.into_iter().find(|pack| pack.instance() == instance)?;
                self.cell_count(pack, data.number("cell_count"), found);
                Content::Reading(pack, Box::new(sample(&data, time_s)))
            }
            ACTUATORS => {
                self.has_actuators = true;
                self.arm_state(data.number("armed")? != 0.0)?
            }
            STATUS if self.has_actuators => return None,
            STATUS => self.arm_state(data.number("arming_state")? == STATE_ARMED)?,
            _ => {
                let utc_us = data
                    .number("time_utc_usec")
                    .filter(|utc_us| *utc_us > UTC_FROM_US)?;
                Content::StartUtc(utc_us / 1e6 - time_s)
            }
        };
        push(found, Some(time_s), content);
        Some(())
    }

    /// `None` if that is known.
    fn arm_state(&mut self, is_armed: bool) -> Option<Content> {
        let is_news = self.is_armed.replace(is_armed) != Some(is_armed);
        is_news.then_some(Content::ArmState(match is_armed {
            true => ArmState::Armed,
            false => ArmState::Disarmed,
        }))
    }

    fn parameter(&mut self, content: &[u8], found: &mut VecDeque<Entry>) -> Option<()> {
        let (kind, name, bytes) = keyed(content)?;
        let value = match kind {
            "int32_t" => f64::from(i32::from_le_bytes(bytes.try_into().ok()?)),
            "float" => f64::from(f32::from_le_bytes(bytes.try_into().ok()?)),
            _ => return None,
        };
        if !value.is_finite() {
            return None;
        }
        self.replaced.extend(px4::replaced_by(name));
        if name == "MAV_TYPE" {
            push(found, None, Content::Vehicle(value as u8));
        }
        // Definitions end with the first topic.
        match px4::is_older(name) && self.topics.is_empty() {
            true => self.older.push((name.into(), value)),
            false => self.setting(name, value, found),
        }
        Some(())
    }
}

fn information(content: &[u8], found: &mut VecDeque<Entry>) -> Option<()> {
    let (_, name, bytes) = keyed(content)?;
    match name {
        "ver_sw_release" => {
            let [_, patch, minor, major] = u32::from_le_bytes(bytes.try_into().ok()?).to_le_bytes();
            push(found, None, Content::Version(format!("{major}.{minor}.{patch}")));
        }
        "sys_uuid" => {
            let id = String::from_utf8_lossy(bytes).into_owned();
            push(found, None, Content::Board(id));
        }
        _ => {}
    }
    Some(())
}

fn push(found: &mut VecDeque<Entry>, time_s: Option<f64>, content: Content) {
    found.push_back(Entry { time_s, content });
}

/// Whether a file begins as such a log.
pub fn is_ulog(head: &[u8]) -> bool {
    head.starts_with(MAGIC)
}

/// Type and content of the message that `bytes` begin with.
fn first_message<'a>(bytes: &'a [u8], topics: &HashMap<u16, Topic>) -> Option<(u8, &'a [u8])> {
    let (kind, length) = header(bytes)?;
    let content = bytes.get(HEADER_BYTES..HEADER_BYTES + length)?;
    let following = &bytes[HEADER_BYTES + length..];
    if following.len() >= HEADER_BYTES && header(following).is_none() {
        return None;
    }
    if kind == b'D' {
        let (number, data) = content.split_first_chunk()?;
        let topic = topics.get(&u16::from_le_bytes(*number));
        let is_too_short = topic.is_some_and(|topic| topic.format.needed_bytes() > data.len());
        return (!is_too_short).then_some((kind, content));
    }
    Some((kind, content))
}

/// Type and length of a message, if there is such a type. None is empty.
fn header(bytes: &[u8]) -> Option<(u8, usize)> {
    let [length0, length1, kind, ..] = *bytes else {
        return None;
    };
    let length = u16::from_le_bytes([length0, length1]);
    (TYPES.contains(&kind) && length > 0).then_some((kind, length.into()))
}

/// Type, name and value of a parameter or information.
fn keyed(content: &[u8]) -> Option<(&str, &str, &[u8])> {
    let (length, rest) = content.split_first()?;
    let (key, value) = rest.split_at_checked(usize::from(*length))?;
    let (kind, name) = std::str::from_utf8(key).ok()?.split_once(' ')?;
    Some((kind, name, value))
}

/// A current and a remaining charge are negative while unknown; of a pack without a temperature or cells these are NaN or 0.
fn sample(data: &Data, time_s: f64) -> Sample {
    let number = |name: &str| data.number(name).map(|number| number as f32);
    let not_negative = |name: &str| number(name).filter(|number| *number >= 0.0);
    let cells = (0..MOST_CELLS).map_while(|cell| data.element("voltage_cell_v", cell));
    let cells_mv: Vec<u16> = cells
        .take_while(|volts| *volts > 0.0)
        .map(|volts| (volts * 1e3).round() as u16)
        .collect();
    // Charging is negative, and −1 A is unknown.
    let current_a = number("current_a").filter(|amperes| *amperes != -1.0);
    Sample {
        time_s,
        voltage_v: number("voltage_v"),
        current_a,
        temperature_c: number("temperature").filter(|celsius| *celsius != 0.0),
        cells: CellVoltages::from_millivolts(&cells_mv),
        reported: Some(Reported {
            consumed_mah: not_negative("discharged_mah"),
            remaining_pct: not_negative("remaining").map(|share| 100.0 * share),
            ..Reported::default()
        }),
        ..Sample::NONE
    }
}

impl Format {
    /// Fields as in `uint64_t timestamp;float[4] voltages;`.
    fn of(text: &str) -> Self {
        let mut end = 0;
        let fields = text.split(';').map_while(|field| {
            let (kind, name) = field.split_once(' ')?;
            let (kind, count) = match kind.split_once('[') {
                Some((kind, count)) => (kind, count.strip_suffix(']')?.parse().ok()?),
                None => (kind, 1),
            };
            let kind = Kind::of(kind)?;
            let start = end;
            end = start + kind.bytes().checked_mul(count)?;
            (end <= usize::from(u16::MAX)).then(|| Field {
                name: name.into(),
                kind,
                place: start..end,
            })
        });
        Self {
            fields: fields.collect(),
        }
    }

    /// The least length of a message: the padding at its end may be left out.
    fn needed_bytes(&self) -> usize {
        let fields = self
            .fields
            .iter()
            .filter(|field| !field.name.starts_with("_padding"));
        fields.map(|field| field.place.end).max().unwrap_or(0)
    }
}

impl Kind {
    fn of(name: &str) -> Option<Self> {
        Some(match name {
            "uint8_t" | "bool" | "char" => Self::Unsigned(1),
            "uint16_t" => Self::Unsigned(2),
            "uint32_t" => Self::Unsigned(4),
            "uint64_t" => Self::Unsigned(8),
            "int8_t" => Self::Signed(1),
            "int16_t" => Self::Signed(2),
            "int32_t" => Self::Signed(4),
            "int64_t" => Self::Signed(8),
            "float" => Self::Single,
            "double" => Self::Double,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::Unsigned(bytes) | Self::Signed(bytes) => bytes,
            Self::Single => 4,
            Self::Double => 8,
        }
    }

    fn number(self, bytes: &[u8]) -> f64 {
        let bits = bytes
            .iter()
            .rev()
            .fold(0, |bits: u64, byte| bits << 8 | u64::from(*byte));
        match self {
            Self::Unsigned(_) => bits as f64,
            Self::Signed(bytes) => {
                let unused_bits = 64 - 8 * bytes as u32;
                ((bits << unused_bits) as i64 >> unused_bits) as f64
            }
            Self::Single => f64::from(f32::from_bits(bits as u32)),
            Self::Double => f64::from_bits(bits),
        }
    }
}

impl Data<'_> {
    /// `None` also for NaN.
    fn number(&self, name: &str) -> Option<f64> {
        self.element(name, 0)
    }

    fn element(&self, name: &str, index: usize) -> Option<f64> {
        let field = self.format.fields.iter().find(|field| field.name == name)?;
        let start = field.place.start + index * field.kind.bytes();
        let end = start + field.kind.bytes();
        let bytes = self.bytes.get(start..end).filter(|_| end <= field.place.end)?;
        Some(field.kind.number(bytes)).filter(|number| number.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recordings::entry::Entries;
    use proptest::prelude::*;

    fn message(kind: u8, content: &[u8]) -> Vec<u8> {
        let length = (content.len() as u16).to_le_bytes();
        [&length[..], &[kind], content].concat()
    }

    fn keyed(kind: u8, key: &str, value: [u8; 4]) -> Vec<u8> {
        message(kind, &[&[key.len() as u8], key.as_bytes(), &value].concat())
    }

    fn topic(instance: u8, number: u8, name: &str) -> Vec<u8> {
        message(b'A', &[&[instance, number, 0], name.as_bytes()].concat())
    }

    fn battery(number: u8, time_s: u64, volts: f32, amperes: f32) -> Vec<u8> {
        let time = (time_s * 1_000_000).to_le_bytes();
        let floats = [volts, amperes, 100.0, 0.5, 3.9, 3.8, 0.0, f32::NAN];
        let floats = floats.map(f32::to_le_bytes).concat();
        message(b'D', &[&[number, 0], &time[..], &floats, &[1]].concat())
    }

    fn armed(time_s: u64, is_armed: bool) -> Vec<u8> {
        let time = (time_s * 1_000_000).to_le_bytes();
        message(b'D', &[&[2, 0], &time[..], &[is_armed.into(), 0]].concat())
    }

    /// Definitions of a log with two packs.
    fn definitions() -> Vec<u8> {
        let fields = "battery_status:uint64_t timestamp;float voltage_v;float current_a;float discharged_mah;float remaining;\
                      float[3] voltage_cell_v;float temperature;bool connected;uint8_t[3] _padding0;";
        [
            &[MAGIC, &[1], &[0; 8]].concat()[..],
            &message(b'B', &[0; 40]),
            &message(b'F', b"nested:float[32767] x;"),
            &message(b'F', fields.as_bytes()),
            &message(
                b'F',
                b"actuator_armed:uint64_t timestamp;bool armed;bool lockdown;",
            ),
            &keyed(b'I', "uint32_t ver_sw_release", [255, 2, 14, 1]),
            &keyed(b'P', "int32_t BAT1_N_CELLS", 3_i32.to_le_bytes()),
            &keyed(b'P', "int32_t MAV_TYPE", 10_i32.to_le_bytes()),
            &topic(0, 0, BATTERY),
            &topic(1, 1, BATTERY),
            &topic(0, 2, ACTUATORS),
            &topic(0, 3, "vehicle_attitude"),
        ]
        .concat()
    }

    fn log(data: &[Vec<u8>]) -> Vec<u8> {
        [definitions(), data.concat()].concat()
    }

    fn entries(bytes: &[u8]) -> (Vec<Content>, u64) {
        let mut log = super::read(bytes);
        let entries = log.by_ref().map(|entry| entry.expect("it is readable").content);
        (entries.collect(), log.bytes().skipped)
    }

    /// Voltages, by packs.
    fn voltages(bytes: &[u8]) -> Vec<(u8, f32)> {
        let readings = entries(bytes).0.into_iter().filter_map(|content| match content {
            Content::Reading(pack, sample) => Some((pack.number(), sample.voltage_v?)),
            _ => None,
        });
        readings.collect()
    }

    #[test]
    fn readings_arming_and_settings_are_found_among_other_topics() {
        let other = message(b'D', &[3, 0, 1, 2, 3]);
        let data = [
            battery(0, 1, 11.5, 2.5),
            other,
            armed(2, true),
            armed(3, true),
            battery(1, 3, 7.5, -1.0),
        ];
        let (found, skipped) = entries(&log(&data));
        assert_eq!(skipped, 0);
        let [
            Content::Autopilot(12),
            Content::Version(version),
            Content::Parameter(name, 3.0),
            Content::Vehicle(10),
            Content::Reading(Pack::First, first),
            Content::ArmState(ArmState::Armed),
            Content::Reading(Pack::Second, second),
        ] = &found[..]
        else {
            panic!("{found:?}");
        };
        assert_eq!((version.as_str(), name.as_str()), ("1.14.2", "BATT_CELLS"));
        assert_eq!(
            (first.time_s, first.voltage_v, first.current_a),
            (1.0, Some(11.5), Some(2.5))
        );
        assert_eq!(
            (first.cells.millivolts(), first.temperature_c),
            (&[3900, 3800][..], None)
        );
        let reported = first.reported.expect("a report");
        assert_eq!(
            (reported.consumed_mah, reported.remaining_pct),
            (Some(100.0), Some(50.0))
        );
        assert_eq!(second.current_a, None);
    }

    /// A log of one pack with these parameters, and readings with the number of its cells.
    fn cells_by(parameters: &[(&str, i32)], cell_count: u8) -> Vec<f64> {
        let parameters = parameters
            .iter()
            .map(|(name, count)| keyed(b'P', &format!("int32_t {name}"), count.to_le_bytes()));
        let time = 1_000_000_u64.to_le_bytes();
        let reading = message(
            b'D',
            &[&[0, 0], &time[..], &22_f32.to_le_bytes(), &[cell_count]].concat(),
        );
        let log = [
            definitions()[..16].to_vec(),
            message(
                b'F',
                b"battery_status:uint64_t timestamp;float voltage_v;uint8_t cell_count;",
            ),
            parameters.collect::<Vec<_>>().concat(),
            topic(0, 0, BATTERY),
            [reading.clone(), reading].concat(),
        ];
        let found = entries(&log.concat())
            .0
            .into_iter()
            .filter_map(|content| match content {
                Content::Parameter(name, value) if name == "BATT_CELLS" => Some(value),
                _ => None,
            });
        found.collect()
    }

    #[test]
    fn older_parameters_count_only_without_those_that_replace_them() {
        let (older, newer) = ("BAT_N_CELLS", "BAT1_N_CELLS");
        assert_eq!(cells_by(&[(newer, 6), (older, 3)], 6), [6.0]);
        assert_eq!(cells_by(&[(older, 3), (newer, 6)], 6), [6.0]);
        assert_eq!(cells_by(&[(older, 3)], 4), [3.0]);
        // 0 is unknown; PX4 then knows it all the same.
        assert_eq!(cells_by(&[(older, 3), (newer, 0)], 4), [4.0]);
        assert!(cells_by(&[(older, 3), (newer, 0)], 0).is_empty());
    }

    #[test]
    fn a_vehicle_is_armed_by_its_state_where_its_actuators_are_not_logged() {
        let state = |time_s: u64, state: u8| {
            let time = (time_s * 1_000_000).to_le_bytes();
            message(b'D', &[&[4, 0], &time[..], &[state]].concat())
        };
        let topics = [
            message(b'F', b"vehicle_status:uint64_t timestamp;uint8_t arming_state;"),
            topic(0, 4, STATUS),
        ]
        .concat();
        let found = |data: &[Vec<u8>]| {
            let log = [log(&[]), topics.clone(), data.concat()].concat();
            let states = entries(&log).0.into_iter().filter_map(|content| match content {
                Content::ArmState(state) => Some(state == ArmState::Armed),
                _ => None,
            });
            states.collect::<Vec<_>>()
        };
        let states = [state(1, 1), state(2, 2), state(3, 2), state(4, 3)];
        assert_eq!(found(&states), [false, true, false]);
        assert_eq!(
            found(&[armed(1, false), state(2, 2), armed(3, true)]),
            [false, true]
        );
        assert!(found(&[]).is_empty());
    }

    #[test]
    fn times_since_1970_start_at_0() {
        let log = log(&[
            battery(0, 1_700_000_000, 11.5, 1.0),
            battery(0, 1_700_000_060, 11.5, 1.0),
        ]);
        let times = super::read(log.as_slice()).filter_map(|entry| entry.expect("it is readable").time_s);
        assert_eq!(times.collect::<Vec<_>>(), [0.0, 60.0]);
    }

    #[test]
    fn damage_costs_what_it_hits() {
        let data: Vec<Vec<u8>> = (1..=9)
            .map(|second| battery(0, second, second as f32, 1.0))
            .collect();
        let length = data[0].len();
        let whole = log(&data);
        let expected: Vec<(u8, f32)> = (1..=9).map(|second| (1, second as f32)).collect();
        assert_eq!(voltages(&whole), expected);
        let mut torn = read(&whole[..MAGIC.len()]);
        assert!(torn.by_ref().all(|entry| entry.is_ok()));
        assert_eq!(torn.bytes().read, MAGIC.len() as u64);
        // A torn end, a dropout in between, and garbage.
        assert_eq!(voltages(&whole[..whole.len() - 5]), expected[..8]);
        let (front, behind) = whole.split_at(whole.len() - 4 * length);
        let dropout = message(b'O', &[100, 0]);
        assert_eq!(voltages(&[front, &dropout, behind].concat()), expected);
        // A message that is shorter than its format.
        let short = message(b'D', &[0, 0, 1, 2, 3]);
        let with_short = [front, &short, behind].concat();
        assert_eq!(voltages(&with_short), expected);
        assert_eq!(entries(&with_short).1, short.len() as u64);
        let garbage = [front, &[0xff; 99], behind].concat();
        let found = voltages(&garbage);
        assert_eq!(found.len(), 8, "{found:?}");
    }

    #[test]
    fn data_before_its_format_and_formats_that_contradict_themselves_are_left_out() {
        let early = [definitions()[..16].to_vec(), battery(0, 1, 9.0, 1.0)].concat();
        let late = &definitions()[16..];
        assert!(voltages(&[&early, late].concat()).is_empty());
        for fields in [
            "uint64_t timestamp;float[99999999999] x;float voltage_v;",
            "float voltage_v;",
            "",
            "?[ x",
        ] {
            let format = message(b'F', format!("battery_status:{fields}").as_bytes());
            let log = [
                &definitions()[..16],
                &format,
                &topic(0, 0, BATTERY),
                &battery(0, 1, 9.0, 1.0),
            ]
            .concat();
            assert!(voltages(&log).is_empty(), "{fields}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_can_be_read(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            entries(&bytes);
            let log = log(&[battery(0, 1, 11.5, 1.0), bytes, battery(0, 2, 11.5, 1.0)]);
            let (_, skipped) = entries(&log);
            prop_assert!(skipped <= log.len() as u64);
            let mut read = read(log.as_slice());
            prop_assert!(read.by_ref().all(|entry| entry.is_ok()));
            prop_assert_eq!(read.bytes().read, log.len() as u64);
        }

        #[test]
        fn a_flipped_bit_costs_two_readings_at_most(place in 0usize..50 * 46, bit in 0u32..8) {
            let data: Vec<Vec<u8>> = (1..=50).map(|second| battery(0, second, 11.5, 1.0)).collect();
            prop_assert_eq!(data[0].len(), 46);
            let mut bytes = log(&data);
            let start = bytes.len() - 50 * 46;
            bytes[start + place] ^= 1 << bit;
            prop_assert!(voltages(&bytes).len() >= 48);
        }
    }
}
