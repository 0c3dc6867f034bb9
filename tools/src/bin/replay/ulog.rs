//! PX4's logs (`.ulg`), as far as they are readable.
//!
//! A message counts if its type exists, its content fits the format that the log states for it, and another message, or the
//! end, follows. Anything else is skipped byte by byte. Formats are read of the topics only that are used here.
//!
//! PX4's own crate, `px4-ulog` 0.6.1, does not check the lengths of contents, and ends at the first damaged message.

use std::collections::{HashMap, VecDeque};
use std::io::{self, Read};
use std::ops::Range;
use std::rc::Rc;

use rover_battmon::battery::CellVoltages;
use rover_battmon::pack::Pack;
use rover_battmon::vehicle::ArmState;

use crate::entry::{Content, Entries, Entry};
use crate::px4;
use crate::trace::{Reported, Sample};
use crate::window::Window;

/// The beginning of a file, before its version.
const MAGIC: &[u8] = b"ULog\x01\x12\x35";
const FILE_HEADER_BYTES: usize = 16;

/// The length of a message's content and its type.
const HEADER_BYTES: usize = 3;

/// The longest message, and the beginning of the next one.
const MOST_NEEDED_BYTES: usize = HEADER_BYTES + u16::MAX as usize + HEADER_BYTES;

const TYPES: &[u8] = b"FDIMPARSOLCQB";

/// Topics that are used here.
const BATTERY: &str = "battery_status";
const ACTUATORS: &str = "actuator_armed";
const GPS: &str = "vehicle_gps_position";

/// UTC is unknown before 2000, in microseconds.
const UTC_FROM_US: f64 = 946_684_800e6;

/// The most cells of which a log has voltages.
const MOST_CELLS: usize = 14;

/// The entries of a log.
pub struct ULog<R> {
    window: Window<R>,
    found: VecDeque<Entry>,
    has_header: bool,
    formats: HashMap<String, Rc<Format>>,
    /// Format of each message of data, by its number.
    topics: HashMap<u16, Topic>,
    is_armed: Option<bool>,
}

/// A topic that is logged.
struct Topic {
    name: String,
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

impl<R: Read> ULog<R> {
    /// Of a log that `source` delivers.
    pub fn of(source: R) -> Self {
        Self {
            window: Window::of(source),
            found: VecDeque::from([Entry {
                time_s: None,
                content: Content::Autopilot(px4::AUTOPILOT),
            }]),
            has_header: false,
            formats: HashMap::new(),
            topics: HashMap::new(),
            is_armed: None,
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
            if !self.has_header {
                self.has_header = true;
                let is_header = is_ulog(rest);
                if is_header {
                    self.window.advance(FILE_HEADER_BYTES);
                }
                continue;
            }
            let Some((kind, content)) = first_message(rest, &self.topics) else {
                self.window.skip(1);
                continue;
            };
            let content = content.to_vec();
            self.window.advance(HEADER_BYTES + content.len());
            let _ = self.take(kind, &content);
        }
    }

    /// `None` if the message contradicts itself.
    fn take(&mut self, kind: u8, content: &[u8]) -> Option<()> {
        match kind {
            b'F' => self.format(content),
            b'A' => self.topic(content),
            b'D' => self.data(content),
            b'P' => self.parameter(content),
            b'I' => self.information(content),
            b'L' => {
                let (header, text) = content.split_at_checked(9)?;
                let time_s = seconds(u64::from_le_bytes(*header.last_chunk()?));
                self.push(
                    Some(time_s),
                    Content::Text(String::from_utf8_lossy(text).into_owned()),
                );
                Some(())
            }
            _ => Some(()),
        }
    }

    fn push(&mut self, time_s: Option<f64>, content: Content) {
        self.found.push_back(Entry { time_s, content });
    }

    fn format(&mut self, content: &[u8]) -> Option<()> {
        let (name, fields) = std::str::from_utf8(content).ok()?.split_once(':')?;
        if [BATTERY, ACTUATORS, GPS].contains(&name) {
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

    fn data(&mut self, content: &[u8]) -> Option<()> {
        let (number, bytes) = content.split_first_chunk()?;
        let topic = self.topics.get(&u16::from_le_bytes(*number))?;
        let data = Data {
            format: &topic.format,
            bytes,
        };
        let time_us = data.number("timestamp")?;
        let time_s = time_us / 1e6;
        let content = match topic.name.as_str() {
            BATTERY => {
                let instance = topic.instance;
                let pack = Pack::ALL.into_iter().find(|pack| pack.instance() == instance)?;
                Content::Reading(pack, Box::new(sample(&data, time_s)))
            }
            ACTUATORS => {
                let is_armed = data.number("armed")? != 0.0;
                if self.is_armed.replace(is_armed) == Some(is_armed) {
                    return None;
                }
                Content::ArmState(match is_armed {
                    true => ArmState::Armed,
                    false => ArmState::Disarmed,
                })
            }
            _ => {
                let utc_us = data
                    .number("time_utc_usec")
                    .filter(|utc_us| *utc_us > UTC_FROM_US)?;
                Content::StartUtc((utc_us - time_us) / 1e6)
            }
        };
        self.push(Some(time_s), content);
        Some(())
    }

    fn parameter(&mut self, content: &[u8]) -> Option<()> {
        let (kind, name, bytes) = keyed(content)?;
        let value = match kind {
            "int32_t" => f64::from(i32::from_le_bytes(bytes.try_into().ok()?)),
            "float" => f64::from(f32::from_le_bytes(bytes.try_into().ok()?)),
            _ => return None,
        };
        if !value.is_finite() {
            return None;
        }
        if name == "MAV_TYPE" {
            self.push(None, Content::Vehicle(value as u8));
        }
        for (name, value) in px4::translated(name, value) {
            self.push(None, Content::Parameter(name, value));
        }
        Some(())
    }

    fn information(&mut self, content: &[u8]) -> Option<()> {
        let (_, name, bytes) = keyed(content)?;
        match name {
            "ver_sw_release" => {
                let [_, patch, minor, major] = u32::from_le_bytes(bytes.try_into().ok()?).to_le_bytes();
                self.push(None, Content::Version(format!("{major}.{minor}.{patch}")));
            }
            "sys_uuid" => {
                let id = String::from_utf8_lossy(bytes).into_owned();
                self.push(None, Content::Board(id));
            }
            _ => {}
        }
        Some(())
    }
}

impl<R: Read> Entries for ULog<R> {
    fn read_bytes(&self) -> u64 {
        self.window.read_bytes()
    }

    fn skipped_bytes(&self) -> u64 {
        self.window.skipped_bytes()
    }
}

impl<R: Read> Iterator for ULog<R> {
    type Item = io::Result<Entry>;

    fn next(&mut self) -> Option<Self::Item> {
        self.read_next().transpose()
    }
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

fn seconds(time_us: u64) -> f64 {
    time_us as f64 / 1e6
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
        let mut log = ULog::of(bytes);
        let entries = log.by_ref().map(|entry| entry.expect("it is readable").content);
        (entries.collect(), log.skipped_bytes())
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

    #[test]
    fn damage_costs_what_it_hits() {
        let data: Vec<Vec<u8>> = (1..=9)
            .map(|second| battery(0, second, second as f32, 1.0))
            .collect();
        let length = data[0].len();
        let whole = log(&data);
        let expected: Vec<(u8, f32)> = (1..=9).map(|second| (1, second as f32)).collect();
        assert_eq!(voltages(&whole), expected);
        let mut torn = ULog::of(&whole[..MAGIC.len()]);
        assert!(torn.by_ref().all(|entry| entry.is_ok()));
        assert_eq!(torn.read_bytes(), MAGIC.len() as u64);
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
            let mut read = ULog::of(log.as_slice());
            prop_assert!(read.by_ref().all(|entry| entry.is_ok()));
            prop_assert_eq!(read.read_bytes(), log.len() as u64);
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
