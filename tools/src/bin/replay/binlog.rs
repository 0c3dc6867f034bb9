//! Records of a log file in ArduPilot's DataFlash format, as far as they are readable, one after the other: a log of any length
//! takes the same memory.
//!
//! The format has no checksum. A record counts if its format is known and another record, or the end, follows it; anything
//! else is skipped byte by byte, so that damage costs the records it is in and the one before.

use std::collections::HashMap;
use std::io::{self, Read};
use std::rc::Rc;

const SYNCHRONISATION: [u8; 2] = [0xa3, 0x95];
const HEADER_BYTES: usize = 3;

/// The format of formats, by which a file describes all others and itself.
const FORMAT: u8 = 128;
const FORMAT_BYTES: usize = 89;

/// A record, whose length is a byte, and what shows that another one follows.
const MOST_NEEDED_BYTES: usize = u8::MAX as usize + SYNCHRONISATION.len();

/// What is read of a file at once.
const BUFFER_BYTES: usize = 1 << 16;

/// A record.
#[derive(Clone, Debug)]
pub struct Record {
    format: Rc<Format>,
    payload: Vec<u8>,
}

#[derive(Debug)]
struct Format {
    number: u8,
    name: String,
    columns: Vec<Column>,
    payload_bytes: usize,
}

/// A field of a format, and where it lies in the payload.
#[derive(Debug)]
struct Column {
    name: String,
    field_type: u8,
    place: std::ops::Range<usize>,
}

/// The records of a file, as they follow each other, without those that describe formats.
pub struct Records<R> {
    source: R,
    buffer: Vec<u8>,
    /// Where in the buffer the bytes are that are not used yet.
    start: usize,
    end: usize,
    is_at_end: bool,
    formats: HashMap<u8, Rc<Format>>,
    read_bytes: u64,
    skipped_bytes: u64,
}

impl Record {
    /// Name of its format: `BAT`, for example.
    pub fn name(&self) -> &str {
        &self.format.name
    }

    /// The number in a column; `None` also for a text and for NaN. Integers of all lengths are exact in a double but for times
    /// beyond 285 years.
    pub fn number(&self, column: &str) -> Option<f64> {
        let (field_type, bytes) = self.field(column)?;
        number(field_type, bytes).filter(|number| number.is_finite())
    }

    /// Number of its format in this log.
    pub fn format_number(&self) -> u8 {
        self.format.number
    }

    /// Where a column stands among all of the record.
    pub fn place(&self, column: &str) -> Option<usize> {
        self.format.columns.iter().position(|field| field.name == column)
    }

    /// Whether a column has integers without a factor of their type.
    pub fn is_unscaled_integer(&self, column: &str) -> bool {
        self.field(column)
            .is_some_and(|(field_type, _)| matches!(field_type, b'b' | b'B' | b'h' | b'H' | b'i' | b'I'))
    }

    /// The text in a column.
    pub fn text(&self, column: &str) -> Option<String> {
        let (field_type, bytes) = self.field(column)?;
        is_text(field_type).then(|| text(bytes))
    }

    fn field(&self, column: &str) -> Option<(u8, &[u8])> {
        let column = self.format.columns.iter().find(|field| field.name == column)?;
        Some((column.field_type, self.payload.get(column.place.clone())?))
    }
}

impl<R: Read> Records<R> {
    /// The records of what `source` delivers.
    pub fn of(source: R) -> Self {
        Self {
            source,
            buffer: vec![0; BUFFER_BYTES],
            start: 0,
            end: 0,
            is_at_end: false,
            formats: HashMap::new(),
            read_bytes: 0,
            skipped_bytes: 0,
        }
    }

    /// Bytes so far, of records and others.
    pub fn read_bytes(&self) -> u64 {
        self.read_bytes
    }

    /// Bytes so far that belong to no record.
    pub fn skipped_bytes(&self) -> u64 {
        self.skipped_bytes
    }

    /// Makes the next record, and what follows it, available as far as the file goes.
    fn fill(&mut self) -> io::Result<()> {
        if self.end - self.start >= MOST_NEEDED_BYTES || self.is_at_end {
            return Ok(());
        }
        self.buffer.copy_within(self.start..self.end, 0);
        (self.start, self.end) = (0, self.end - self.start);
        while self.end < MOST_NEEDED_BYTES && !self.is_at_end {
            match self.source.read(&mut self.buffer[self.end..]) {
                Ok(0) => self.is_at_end = true,
                Ok(bytes) => self.end += bytes,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Goes past bytes of the buffer.
    fn advance(&mut self, bytes: usize) {
        self.start += bytes;
        self.read_bytes += bytes as u64;
    }

    /// The next record; `None` at the end of the file.
    fn read_next(&mut self) -> io::Result<Option<Record>> {
        loop {
            self.fill()?;
            let rest = &self.buffer[self.start..self.end];
            if rest.is_empty() {
                return Ok(None);
            }
            let Some((kind, payload)) = first_record(rest, &self.formats) else {
                self.skipped_bytes += 1;
                self.advance(1);
                continue;
            };
            let length = HEADER_BYTES + payload.len();
            if kind == FORMAT {
                if let Some((kind, format)) = Format::parse(payload) {
                    self.formats.insert(kind, Rc::new(format));
                }
                self.advance(length);
            } else if let Some(format) = self.formats.get(&kind) {
                let record = Record {
                    format: format.clone(),
                    payload: payload.to_vec(),
                };
                self.advance(length);
                return Ok(Some(record));
            }
        }
    }
}

/// After an error of the source there are no more.
impl<R: Read> Iterator for Records<R> {
    type Item = io::Result<Record>;

    fn next(&mut self) -> Option<Self::Item> {
        let next = self.read_next();
        if next.is_err() {
            (self.start, self.end, self.is_at_end) = (0, 0, true);
        }
        next.transpose()
    }
}

/// Number of the format and payload of the record that `bytes` begin with, if they do.
fn first_record<'a>(bytes: &'a [u8], formats: &HashMap<u8, Rc<Format>>) -> Option<(u8, &'a [u8])> {
    if !bytes.starts_with(&SYNCHRONISATION) {
        return None;
    }
    let [_, _, kind] = *bytes.first_chunk()?;
    let length = match kind {
        FORMAT => FORMAT_BYTES,
        _ => HEADER_BYTES + formats.get(&kind)?.payload_bytes,
    };
    let (record, following) = bytes.split_at_checked(length)?;
    // As far as the file goes.
    let is_followed = following
        .iter()
        .zip(SYNCHRONISATION)
        .all(|(byte, expected)| *byte == expected);
    is_followed.then(|| (kind, &record[HEADER_BYTES..]))
}

impl Format {
    /// The format that a FMT record describes, and its number; `None` if it contradicts itself.
    fn parse(payload: &[u8]) -> Option<(u8, Self)> {
        let [kind, length, texts @ ..] = payload else {
            return None;
        };
        let (name, texts) = texts.split_at_checked(4)?;
        let (types, columns) = texts.split_at_checked(16)?;
        let (types, names) = (text(types).into_bytes(), text(columns));
        let mut end = 0;
        let places = types.iter().map(|field_type| {
            let start = end;
            end += field_bytes(*field_type);
            (*field_type, start..end)
        });
        let columns = names
            .split(',')
            .zip(places)
            .map(|(name, (field_type, place))| Column {
                name: name.into(),
                field_type,
                place,
            });
        let format = Self {
            number: *kind,
            name: text(name),
            columns: columns.collect(),
            payload_bytes: types.iter().map(|field_type| field_bytes(*field_type)).sum(),
        };
        let is_consistent = types.iter().all(|field_type| field_bytes(*field_type) > 0)
            && HEADER_BYTES + format.payload_bytes == usize::from(*length);
        is_consistent.then_some((*kind, format))
    }
}

/// Length of a field by the character of its type; 0 for one that does not exist.
pub fn field_bytes(field_type: u8) -> usize {
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

fn is_text(field_type: u8) -> bool {
    matches!(field_type, b'n' | b'N' | b'Z')
}

/// The number in a field that is as long as its type says; `None` of a text, and of an array: no record that is of use here
/// has one.
fn number(field_type: u8, bytes: &[u8]) -> Option<f64> {
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
    Some(match field_type {
        b'b' | b'h' | b'i' | b'L' | b'q' => signed() as f64,
        b'c' | b'e' => signed() as f64 / 100.0,
        b'C' | b'E' => unsigned() as f64 / 100.0,
        b'f' => f64::from(f32::from_bits(unsigned() as u32)),
        b'd' => f64::from_bits(unsigned()),
        b'a' | b'n' | b'N' | b'Z' => return None,
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
    use rover_battmon::recorder::dataflash::{ArmingMethod, Record as Recorded, opening_record};
    use rover_battmon::vehicle::ArmState;

    /// What a file of the board begins with.
    pub fn opening() -> Vec<u8> {
        (0..)
            .map_while(|index| opening_record(index, 0))
            .flatten()
            .collect()
    }

    /// The rover is armed or disarmed by a command.
    pub fn arming(state: ArmState) -> Recorded<'static> {
        Recorded::Arm {
            state,
            enabled_checks: 1,
            forced: false,
            method: ArmingMethod::Command,
        }
    }

    /// A file of the board with texts that are numbers.
    fn file(texts: std::ops::Range<u64>) -> Vec<u8> {
        let mut bytes = opening();
        bytes.extend(texts.flat_map(|time_us| Recorded::Message(&time_us.to_string()).encode(time_us)));
        bytes
    }

    /// A file that is read to its end.
    struct Log {
        records: Vec<Record>,
        skipped_bytes: u64,
    }

    impl Log {
        fn parse(bytes: &[u8]) -> Self {
            Self::read(bytes)
        }

        fn read(source: impl Read) -> Self {
            let mut records = Records::of(source);
            let all = records.by_ref().map(|record| record.expect("it is readable"));
            Self {
                records: all.collect(),
                skipped_bytes: records.skipped_bytes(),
            }
        }
    }

    /// A source that delivers a few bytes at a time.
    struct Slow<'a>(&'a [u8], usize);

    impl Read for Slow<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            let few = self.1.min(buffer.len());
            self.0.read(&mut buffer[..few])
        }
    }

    /// The texts in a file.
    fn texts(log: &Log) -> Vec<String> {
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
            panic!("{:?}", log.records);
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
        assert_eq!(parameter.text("Name").as_deref(), Some("BATT_CAPACITY_16"));
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
            assert_eq!(log.skipped_bytes, 75 - cut as u64, "{cut} bytes cut");
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
            let log = Log::parse(&after_formats);
            prop_assert!(log.skipped_bytes <= after_formats.len() as u64);
        }

        #[test]
        fn what_is_read_does_not_depend_on_how_the_source_delivers_it(
            bytes in prop::collection::vec(any::<u8>(), 0..500),
            few in 1usize..400,
        ) {
            let file = [file(0..20), bytes, file(20..40)].concat();
            let [whole, slow] = [Log::parse(&file), Log::read(Slow(&file, few))];
            prop_assert_eq!(texts(&whole), texts(&slow));
            prop_assert_eq!(whole.skipped_bytes, slow.skipped_bytes);
        }

        #[test]
        fn a_flipped_bit_costs_two_records_at_most(place in 0usize..100 * 75, bit in 0u32..8) {
            let mut bytes = file(0..100);
            let start = bytes.len() - 100 * 75;
            bytes[start + place] ^= 1 << bit;
            let log = Log::parse(&bytes);
            let expected: Vec<String> = (0..100).map(|number: u64| number.to_string()).collect();
            let intact = texts(&log).iter().filter(|text| expected.iter().any(|number| number == *text)).count();
            prop_assert!(intact >= 97, "{} of 100", intact);
        }
    }
}
