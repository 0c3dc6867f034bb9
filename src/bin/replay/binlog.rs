//! Records of a log file in ArduPilot's DataFlash format, as far as they are readable.
//!
//! The format has no checksum. A record counts if its format is known and another record, or the end, follows it; anything
//! else is skipped byte by byte, so that damage costs the records it is in and the one before.

use std::collections::HashMap;
use std::rc::Rc;

const SYNCHRONISATION: [u8; 2] = [0xa3, 0x95];
const HEADER_BYTES: usize = 3;

/// The format of formats, by which a file describes all others and itself.
const FORMAT: u8 = 128;
const FORMAT_BYTES: usize = 89;

/// A record.
#[derive(Clone, Debug)]
pub struct Record {
    format: Rc<Format>,
    fields: Vec<Field>,
}

/// What a field holds. Integers of all lengths are exact in a double but for times beyond 285 years.
#[derive(Clone, Debug, PartialEq)]
enum Field {
    Number(f64),
    Text(String),
}

#[derive(Debug)]
struct Format {
    name: String,
    types: Vec<u8>,
    columns: Vec<String>,
}

/// What a file holds.
#[derive(Debug, Default)]
pub struct Log {
    /// Its records, as they follow each other, without those that describe formats.
    pub records: Vec<Record>,
    /// Bytes that belong to no record.
    pub skipped_bytes: usize,
}

impl Record {
    /// Name of its format: `BAT`, for example.
    pub fn name(&self) -> &str {
        &self.format.name
    }

    /// The number in a column; `None` also for a text and for NaN.
    pub fn number(&self, column: &str) -> Option<f64> {
        match self.field(column)? {
            Field::Number(number) => Some(*number).filter(|number| number.is_finite()),
            Field::Text(_) => None,
        }
    }

    /// The text in a column.
    pub fn text(&self, column: &str) -> Option<&str> {
        match self.field(column)? {
            Field::Text(text) => Some(text),
            Field::Number(_) => None,
        }
    }

    fn field(&self, column: &str) -> Option<&Field> {
        let place = self.format.columns.iter().position(|name| name == column)?;
        self.fields.get(place)
    }
}

impl Log {
    /// Reads what is readable.
    pub fn parse(bytes: &[u8]) -> Self {
        let mut log = Self::default();
        let mut formats: HashMap<u8, Rc<Format>> = HashMap::new();
        let mut rest = bytes;
        while !rest.is_empty() {
            let Some((kind, payload)) = first_record(rest, &formats) else {
                log.skipped_bytes += 1;
                rest = &rest[1..];
                continue;
            };
            rest = &rest[HEADER_BYTES + payload.len()..];
            if kind == FORMAT {
                if let Some((kind, format)) = Format::parse(payload) {
                    formats.insert(kind, Rc::new(format));
                }
            } else if let Some(format) = formats.get(&kind) {
                log.records.push(Record {
                    format: format.clone(),
                    fields: format.fields(payload),
                });
            }
        }
        log
    }
}

/// Number of the format and payload of the record that `bytes` begin with, if they do.
fn first_record<'a>(bytes: &'a [u8], formats: &HashMap<u8, Rc<Format>>) -> Option<(u8, &'a [u8])> {
    let [_, _, kind] = *bytes.first_chunk()?;
    let length = match kind {
        FORMAT => FORMAT_BYTES,
        _ => HEADER_BYTES + formats.get(&kind)?.payload_bytes(),
    };
    let (record, following) = bytes.split_at_checked(length)?;
    // As far as the file goes.
    let is_followed = following
        .iter()
        .zip(SYNCHRONISATION)
        .all(|(byte, expected)| *byte == expected);
    (record.starts_with(&SYNCHRONISATION) && is_followed).then(|| (kind, &record[HEADER_BYTES..]))
}

impl Format {
    /// The format that a FMT record describes, and its number; `None` if it contradicts itself.
    fn parse(payload: &[u8]) -> Option<(u8, Self)> {
        let [kind, length, texts @ ..] = payload else {
            return None;
        };
        let (name, texts) = texts.split_at_checked(4)?;
        let (types, columns) = texts.split_at_checked(16)?;
        let format = Self {
            name: text(name),
            types: text(types).into_bytes(),
            columns: text(columns).split(',').map(String::from).collect(),
        };
        let is_consistent = format.types.iter().all(|field_type| field_bytes(*field_type) > 0)
            && HEADER_BYTES + format.payload_bytes() == usize::from(*length);
        is_consistent.then_some((*kind, format))
    }

    fn payload_bytes(&self) -> usize {
        self.types.iter().map(|field_type| field_bytes(*field_type)).sum()
    }

    fn fields(&self, mut payload: &[u8]) -> Vec<Field> {
        let fields = self.types.iter().map(|field_type| {
            let (bytes, rest) = payload.split_at(field_bytes(*field_type));
            payload = rest;
            field(*field_type, bytes)
        });
        fields.collect()
    }
}

/// Length of a field by the character of its type; 0 for one that does not exist.
fn field_bytes(field_type: u8) -> usize {
    match field_type {
        b'b' | b'B' | b'M' => 1,
        b'h' | b'H' | b'c' | b'C' => 2,
        b'i' | b'I' | b'e' | b'E' | b'f' | b'L' | b'n' => 4,
        b'q' | b'Q' | b'd' => 8,
        b'N' => 16,
        b'a' | b'Z' => 64,
        _ => 0,
    }
}

fn field(field_type: u8, bytes: &[u8]) -> Field {
    // Those that are written here are as long as their type says.
    let unsigned = || {
        bytes
            .iter()
            .rev()
            .fold(0, |number: u64, byte| number << 8 | u64::from(*byte))
    };
    let signed = || {
        let unused_bits = 64 - 8 * bytes.len() as u32;
        (unsigned() << unused_bits) as i64 >> unused_bits
    };
    Field::Number(match field_type {
        b'b' | b'h' | b'i' | b'L' | b'q' => signed() as f64,
        b'c' | b'e' => signed() as f64 / 100.0,
        b'C' | b'E' => unsigned() as f64 / 100.0,
        b'f' => f64::from(f32::from_bits(unsigned() as u32)),
        b'd' => f64::from_bits(unsigned()),
        b'n' | b'N' | b'Z' => return Field::Text(text(bytes)),
        // An array: no record that is of use here has one.
        b'a' => f64::NAN,
        _ => unsigned() as f64,
    })
}

fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use proptest::prelude::*;
    use rover_battmon::battery::BatteryState;
    use rover_battmon::pack::Pack;
    use rover_battmon::recorder::dataflash::{Record as Recorded, opening_record};

    /// What a file of the board begins with.
    pub fn opening() -> Vec<u8> {
        (0..)
            .map_while(|index| opening_record(index, 0))
            .flatten()
            .collect()
    }

    /// A file of the board with texts that are numbers.
    fn file(texts: std::ops::Range<u64>) -> Vec<u8> {
        let mut bytes = opening();
        bytes.extend(texts.flat_map(|time_us| Recorded::Message(&time_us.to_string()).encode(time_us)));
        bytes
    }

    /// The texts in a file.
    fn texts(log: &Log) -> Vec<&str> {
        let messages = log.records.iter().filter(|record| record.name() == "MSG");
        messages.filter_map(|record| record.text("Message")).collect()
    }

    #[test]
    fn fields_of_every_type_in_use_are_read() {
        let state = BatteryState {
            voltage_v: Some(11.5),
            temperature_c: Some(-12.34),
            ..BatteryState::UNKNOWN
        };
        let mut bytes = opening();
        bytes.extend(Recorded::Battery(Pack::Second, &state).encode(1 << 40));
        bytes.extend(
            Recorded::Parameter {
                name: "BATT_CAPACITY_16",
                value: -1.5,
                default: 0.0,
            }
            .encode(1),
        );
        let log = Log::parse(&bytes);
        assert_eq!(log.skipped_bytes, 0);
        let [.., battery, parameter] = log.records.as_slice() else {
            panic!("{log:?}");
        };
        assert_eq!(battery.name(), "BAT");
        for (column, expected) in [
            ("TimeUS", Some((1u64 << 40) as f64)),
            ("Inst", Some(1.0)),
            ("Volt", Some(11.5)),
            ("Curr", None),
            ("Temp", Some(-12.34)),
            ("RemPct", Some(255.0)),
            ("Nothing", None),
        ] {
            assert_eq!(battery.number(column), expected, "{column}");
        }
        assert_eq!(parameter.text("Name"), Some("BATT_CAPACITY_16"));
        assert_eq!(parameter.number("Value"), Some(-1.5));
        assert_eq!((parameter.number("Name"), parameter.text("Value")), (None, None));
        // MULT has the only double.
        let multiplier = log.records.iter().rfind(|record| record.name() == "MULT");
        assert_eq!(multiplier.and_then(|record| record.number("Mult")), Some(1e-6));
    }

    #[test]
    fn a_torn_end_is_skipped() {
        let bytes = file(0..3);
        for cut in 1..75 {
            let log = Log::parse(&bytes[..bytes.len() - cut]);
            assert_eq!(log.skipped_bytes, 75 - cut, "{cut} bytes cut");
            assert_eq!(texts(&log), ["0", "1"]);
        }
    }

    #[test]
    fn garbage_costs_the_record_before_it() {
        let mut bytes = file(0..2);
        bytes.extend([0xff; 500]);
        bytes.extend(&file(2..4)[opening().len()..]);
        let log = Log::parse(&bytes);
        assert_eq!(texts(&log), ["0", "2", "3"]);
        assert_eq!(log.skipped_bytes, 575);
    }

    #[test]
    fn a_format_that_contradicts_itself_is_not_used() {
        let mut bytes = opening();
        let message = bytes
            .windows(4)
            .position(|name| name == b"MSG\0")
            .expect("its format");
        bytes[message - 1] += 1;
        bytes.extend(Recorded::Message("lost").encode(0));
        let log = Log::parse(&bytes);
        assert!(texts(&log).is_empty());
        assert_eq!(log.skipped_bytes, 75);
    }

    proptest! {
        #[test]
        fn any_bytes_can_be_read(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            Log::parse(&bytes);
            let after_formats = [opening(), bytes].concat();
            Log::parse(&after_formats);
        }

        #[test]
        fn a_flipped_bit_costs_two_records_at_most(place in 0usize..100 * 75, bit in 0u32..8) {
            let mut bytes = file(0..100);
            let start = bytes.len() - 100 * 75;
            bytes[start + place] ^= 1 << bit;
            let log = Log::parse(&bytes);
            let expected: Vec<String> = (0..100).map(|number: u64| number.to_string()).collect();
            let intact = texts(&log).iter().filter(|text| expected.iter().any(|number| number == **text)).count();
            prop_assert!(intact >= 97, "{} of 100", intact);
        }
    }
}
