//! Records of a log file in ArduPilot's DataFlash format, binary or as text, as far as they are readable, one after the other.
//!
//! The binary format has no checksum. A record counts if its format is known and another record, or the end, follows it; anything
//! else is skipped byte by byte, so that damage costs the records it is in and the one before.

use std::collections::HashMap;
use std::rc::Rc;

const SYNCHRONISATION: [u8; 2] = [0xa3, 0x95];
const HEADER_BYTES: usize = 3;

/// The format of formats, by which a file describes all others and itself.
const FORMAT: u8 = 128;
const FORMAT_BYTES: usize = 89;

/// Lines of a text log are shorter.
const LONGEST_LINE_BYTES: usize = 1 << 12;

/// The most formats of a text log: their numbers are bytes.
const MOST_FORMATS: usize = 256;

/// A record.
#[derive(Clone, Debug)]
pub struct Record {
    format: Rc<Format>,
    payload: Payload,
}

/// The fields of a record.
#[derive(Clone, Debug)]
enum Payload {
    /// As in a binary log.
    Bytes(Vec<u8>),
    /// As in a text log.
    Texts(Vec<String>),
}

/// A form of records.
pub trait Records {
    /// The longest record, and what shows that another one follows.
    const MOST_NEEDED_BYTES: usize;

    /// Length of the record that `bytes` begin with, and the record, unless it describes a format.
    fn first(&mut self, bytes: &[u8]) -> Option<(usize, Option<Record>)>;

    /// Whether a record begins here that is longer than all of `bytes`.
    fn is_cut(&self, bytes: &[u8]) -> bool;
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

/// The records of a binary log, as they follow each other.
pub struct BinaryRecords(Formats);

/// The formats that were described so far, at the places of their numbers.
type Formats = [Option<Rc<Format>>; 256];

impl Record {
    /// Name of its format: `BAT`, for example.
    pub fn name(&self) -> &str {
        &self.format.name
    }

    /// The number in a column; `None` also for a text and for NaN. Integers of all lengths are exact in a double but for times
    /// beyond 285 years.
    pub fn number(&self, column: &str) -> Option<f64> {
        let place = self.place(column)?;
        let Column {
            field_type,
            place: field,
            ..
        } = &self.format.columns[place];
        let number = match &self.payload {
            Payload::Bytes(bytes) => number(*field_type, bytes.get(field.clone())?),
            Payload::Texts(texts) => texts.get(place)?.parse().ok().filter(|_| !is_text(*field_type)),
        };
        number.filter(|number| number.is_finite())
    }

    /// Number of its format in this log.
    pub fn format_number(&self) -> u8 {
        self.format.number
    }

    /// Index of a column among all of the record.
    pub fn place(&self, column: &str) -> Option<usize> {
        self.format.columns.iter().position(|field| field.name == column)
    }

    /// Whether a column has integers without a factor of their type.
    pub fn is_unscaled_integer(&self, column: &str) -> bool {
        let place = self.place(column);
        place.is_some_and(|place| {
            matches!(
                self.format.columns[place].field_type,
                b'b' | b'B' | b'h' | b'H' | b'i' | b'I'
            )
        })
    }

    /// The text in a column.
    pub fn text(&self, column: &str) -> Option<String> {
        let place = self.place(column)?;
        let column = self
            .format
            .columns
            .get(place)
            .filter(|column| is_text(column.field_type))?;
        Some(match &self.payload {
            Payload::Bytes(bytes) => text(bytes.get(column.place.clone())?),
            Payload::Texts(texts) => texts.get(place)?.clone(),
        })
    }
}

impl Default for BinaryRecords {
    fn default() -> Self {
        Self([const { None }; 256])
    }
}

impl Records for BinaryRecords {
    const MOST_NEEDED_BYTES: usize = u8::MAX as usize + SYNCHRONISATION.len();

    fn first(&mut self, bytes: &[u8]) -> Option<(usize, Option<Record>)> {
        let (kind, payload) = first_record(bytes, &self.0)?;
        let length = HEADER_BYTES + payload.len();
        if kind == FORMAT {
            if let Some((kind, format)) = Format::parse(payload) {
                self.0[usize::from(kind)] = Some(Rc::new(format));
            }
            return Some((length, None));
        }
        let record = self.0[usize::from(kind)].as_ref().map(|format| Record {
            format: format.clone(),
            payload: Payload::Bytes(payload.to_vec()),
        });
        Some((length, record))
    }

    fn is_cut(&self, bytes: &[u8]) -> bool {
        match header(bytes, &self.0) {
            Some((_, length)) => length > bytes.len(),
            None => bytes.len() < HEADER_BYTES && begins(bytes),
        }
    }
}

/// The records of a text log, as Mission Planner writes it: a line each, with the names and numbers of a binary one.
#[derive(Default)]
pub struct TextRecords {
    formats: HashMap<String, Rc<Format>>,
    /// Within a line that is not readable.
    is_in_line: bool,
    /// It is the last one, without an end.
    is_cut: bool,
}

impl Records for TextRecords {
    const MOST_NEEDED_BYTES: usize = LONGEST_LINE_BYTES;

    fn first(&mut self, bytes: &[u8]) -> Option<(usize, Option<Record>)> {
        if self.is_in_line {
            self.is_in_line = bytes[0] != b'\n';
            return None;
        }
        let mut first = bytes.iter().take(LONGEST_LINE_BYTES);
        let end = first.position(|byte| *byte == b'\n');
        let length = end.map_or(bytes.len().min(LONGEST_LINE_BYTES), |end| end + 1);
        let line = String::from_utf8_lossy(&bytes[..length]);
        let (name, fields) = line.trim().split_once(',').unwrap_or((line.trim(), ""));
        let (format, record) = match self.formats.get(name) {
            _ if name == "FMT" && self.formats.len() < MOST_FORMATS => (Format::of_text(fields), None),
            Some(format) => (None, Record::of_text(format, fields)),
            None => (None, None),
        };
        if name.is_empty() || format.is_some() || record.is_some() {
            self.formats
                .extend(format.map(|format| (format.name.clone(), Rc::new(format))));
            return Some((length, record));
        }
        self.is_cut = end.is_none() && bytes.len() < LONGEST_LINE_BYTES;
        self.is_in_line = bytes[0] != b'\n';
        None
    }

    fn is_cut(&self, _: &[u8]) -> bool {
        self.is_cut
    }
}

impl Record {
    /// `None` if a field is missing. A text in the last one may have commas.
    fn of_text(format: &Rc<Format>, fields: &str) -> Option<Self> {
        let fields: Vec<String> = fields
            .splitn(format.columns.len(), ',')
            .map(|field| field.trim().into())
            .collect();
        let is_whole = fields.len() == format.columns.len();
        is_whole.then(|| Self {
            format: format.clone(),
            payload: Payload::Texts(fields),
        })
    }
}

/// Number and length of the record that `bytes` begin with, if they do.
fn header(bytes: &[u8], formats: &Formats) -> Option<(u8, usize)> {
    if !bytes.starts_with(&SYNCHRONISATION) {
        return None;
    }
    let [_, _, kind] = *bytes.first_chunk()?;
    let length = match kind {
        FORMAT => FORMAT_BYTES,
        _ => HEADER_BYTES + formats[usize::from(kind)].as_ref()?.payload_bytes,
    };
    Some((kind, length))
}

/// Whether a record may begin here, as far as the file goes.
fn begins(bytes: &[u8]) -> bool {
    bytes
        .iter()
        .zip(SYNCHRONISATION)
        .all(|(byte, expected)| *byte == expected)
}

/// Number of the format and payload of the record that `bytes` begin with, if they do.
fn first_record<'a>(bytes: &'a [u8], formats: &Formats) -> Option<(u8, &'a [u8])> {
    let (kind, length) = header(bytes, formats)?;
    let (record, following) = bytes.split_at_checked(length)?;
    begins(following).then(|| (kind, &record[HEADER_BYTES..]))
}

impl Format {
    /// The format that a FMT record describes, and its number; `None` if it contradicts itself.
    fn parse(payload: &[u8]) -> Option<(u8, Self)> {
        let [kind, length, texts @ ..] = payload else {
            return None;
        };
        let (name, texts) = texts.split_at_checked(4)?;
        let (types, columns) = texts.split_at_checked(16)?;
        let format = Self::new(*kind, text(name), &text(types), &text(columns))?;
        let is_consistent = HEADER_BYTES + format.payload_bytes == usize::from(*length);
        is_consistent.then_some((*kind, format))
    }

    /// The format that a line of a text log describes: number, length, name, types and columns.
    fn of_text(fields: &str) -> Option<Self> {
        let mut fields = fields.splitn(5, ',').map(str::trim);
        let number = fields.next()?.parse().ok()?;
        let name = fields.nth(1)?;
        Self::new(number, name.into(), fields.next()?, fields.next()?)
    }

    /// `None` if there is a type that does not exist.
    fn new(number: u8, name: String, types: &str, columns: &str) -> Option<Self> {
        let mut end = 0;
        let places = types.bytes().map(|field_type| {
            let start = end;
            end += field_bytes(field_type);
            (field_type, start..end)
        });
        let columns = columns.split(',').zip(places);
        let columns = columns.map(|(name, (field_type, place))| Column {
            name: name.trim().into(),
            field_type,
            place,
        });
        let format = Self {
            number,
            name,
            columns: columns.collect(),
            payload_bytes: types.bytes().map(field_bytes).sum(),
        };
        types
            .bytes()
            .all(|field_type| field_bytes(field_type) > 0)
            .then_some(format)
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
        let mut number = [0; 8];
        number[..bytes.len()].copy_from_slice(bytes);
        u64::from_le_bytes(number)
    };
    let signed = || {
        let unused_bits = 64 - 8 * bytes.len() as u32;
        (unsigned() << unused_bits) as i64 >> unused_bits
    };
    if matches!(field_type, b'a' | b'n' | b'N' | b'Z') {
        return None;
    }
    Some(match field_type {
        b'b' | b'h' | b'i' | b'L' | b'q' => signed() as f64,
        b'c' | b'e' => signed() as f64 / 100.0,
        b'C' | b'E' => unsigned() as f64 / 100.0,
        b'f' => f64::from(f32::from_bits(unsigned() as u32)),
        b'd' => f64::from_bits(unsigned()),
        _ => unsigned() as f64,
    })
}

fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

#[cfg(test)]
#[expect(missing_docs, reason = "another file's tests use it")]
pub mod tests {
    use super::*;
    use crate::recordings::entry::{Bytes, Entries, Entry};
    use crate::recordings::log::{self, Messages};
    use proptest::prelude::*;
    use rover_battmon::battery::{BatteryState, Readings};
    use rover_battmon::pack::Pack;
    use rover_battmon::recorder::dataflash::{Record as Recorded, opening_record};
    use std::collections::VecDeque;
    use std::io::{self, Read};

    /// Beginning of a file of the board.
    pub fn opening() -> Vec<u8> {
        (0..)
            .map_while(|index| opening_record(index, 0))
            .flatten()
            .collect()
    }

    /// A parameter of the board.
    pub fn parameter(name: &str, value: f32) -> Recorded<'_> {
        Recorded::Parameter {
            name,
            value,
            default: 0.0,
        }
    }

    /// A file of the board with texts that are numbers.
    fn file(texts: std::ops::Range<u64>) -> Vec<u8> {
        let mut bytes = opening();
        bytes.extend(texts.flat_map(|time_us| Recorded::Message(&time_us.to_string()).encode(time_us)));
        bytes
    }

    /// A file that is read to its end: its records, as they are.
    #[derive(Default)]
    struct Log<F> {
        form: F,
        records: Vec<Record>,
        bytes: Bytes,
    }

    impl<F: Records> Messages for Log<F> {
        const MOST_NEEDED_BYTES: usize = F::MOST_NEEDED_BYTES;

        fn take(&mut self, bytes: &[u8], _: u64, _: &mut VecDeque<Entry>) -> Option<usize> {
            let (length, record) = self.form.first(bytes)?;
            self.records.extend(record);
            Some(length)
        }

        fn is_cut(&self, bytes: &[u8]) -> bool {
            self.form.is_cut(bytes)
        }
    }

    impl Log<BinaryRecords> {
        fn parse(bytes: &[u8]) -> Self {
            Self::read(bytes)
        }
    }

    impl<F: Records + Default> Log<F> {
        fn read(source: impl Read) -> Self {
            let mut log = log::Log::of(source, Self::default());
            assert!(log.next().is_none());
            let bytes = log.bytes();
            let read = log.into_messages();
            Self { bytes, ..read }
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
    fn texts(log: &Log<BinaryRecords>) -> Vec<String> {
        let messages = log.records.iter().filter(|record| record.name() == "MSG");
        messages.filter_map(|record| record.text("Message")).collect()
    }

    #[test]
    fn fields_of_every_type_in_use_are_read() {
        let state = BatteryState {
            readings: Readings {
                voltage_v: Some(11.5),
                ..Readings::NONE
            },
            temperature_c: Some(-12.34),
            ..BatteryState::UNKNOWN
        };
        let mut bytes = opening();
        bytes.extend(Recorded::Battery(Pack::Second, &state).encode(1 << 40));
        bytes.extend(parameter("BATT_CAPACITY_16", -1.5).encode(1));
        let log = Log::parse(&bytes);
        assert_eq!(log.bytes.skipped, 0);
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
    fn a_text_log_has_the_same_records() {
        let text = "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\r\n\
                    FMT, 2, 31, BAT, Qfh, TimeUS,Volt,Curr\r\n\
                    FMT, 3, 75, MSG, QZ, TimeUS,Message\n\
                    BAT, 1000000, 11.5, -3\r\n\
                    \n\
                    BAT, 1100000, nan, x\n\
                    XYZ, 1, 2\n\
                    BAT, 1200000\n\
                    MSG, 1300000, low, and critical\n\
                    MSG, 14";
        let log = Log::<TextRecords>::read(text.as_bytes());
        let [first, unknown, message] = &log.records[..] else {
            panic!("{:?}", log.records);
        };
        let numbers = |record: &Record| ["TimeUS", "Volt", "Curr"].map(|column| record.number(column));
        assert_eq!(numbers(first), [Some(1e6), Some(11.5), Some(-3.0)]);
        assert!(first.is_unscaled_integer("Curr") && !first.is_unscaled_integer("Volt"));
        assert_eq!(numbers(unknown), [Some(1.1e6), None, None]);
        assert_eq!(message.text("Message").as_deref(), Some("low, and critical"));
        assert_eq!((message.number("Message"), first.text("Volt")), (None, None));
        let lost = ["XYZ, 1, 2\n", "BAT, 1200000\n", "MSG, 14"].map(str::len);
        let [lost, cut] = [lost[..2].iter().sum::<usize>(), lost[2]];
        let bytes = Bytes {
            read: text.len() as u64,
            skipped: lost as u64,
            cut: cut as u64,
        };
        assert_eq!(log.bytes, bytes);
    }

    #[test]
    fn a_format_that_changes_counts_from_then_on() {
        let format = |types: &[u8], columns: &[u8]| {
            let mut bytes = vec![0xa3, 0x95, FORMAT, 200, 7];
            for (text, length) in [(&b"T"[..], 4), (types, 16), (columns, 64)] {
                bytes.extend(text);
                bytes.resize(bytes.len() + length - text.len(), 0);
            }
            bytes
        };
        let record = [0xa3, 0x95, 200, 1, 0, 0, 0];
        let log = [
            &record[..],
            &format(b"I", b"A"),
            &record,
            &format(b"hh", b"A,B"),
            &record,
        ];
        let log = Log::parse(&log.concat());
        // The first record comes before its format.
        assert_eq!(log.bytes.skipped, 7);
        let numbers: Vec<_> = log
            .records
            .iter()
            .map(|record| [record.number("A"), record.number("B")])
            .collect();
        assert_eq!(numbers, [[Some(1.0), None], [Some(1.0), Some(0.0)]]);
    }

    #[test]
    fn a_torn_end_is_skipped() {
        let bytes = file(0..3);
        for cut in 1..75 {
            let log = Log::parse(&bytes[..bytes.len() - cut]);
            assert_eq!(
                (log.bytes.skipped, log.bytes.cut),
                (0, 75 - cut as u64),
                "{cut} bytes cut"
            );
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
        assert_eq!(log.bytes.skipped, 575);
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
        assert_eq!(log.bytes.skipped, 75);
    }

    proptest! {
        #[test]
        fn any_bytes_can_be_read(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            Log::parse(&bytes);
            let texts = Log::<TextRecords>::read(bytes.as_slice());
            prop_assert_eq!(texts.bytes.read, bytes.len() as u64);
            let after_formats = [opening(), bytes].concat();
            let log = Log::parse(&after_formats);
            prop_assert!(log.bytes.skipped <= after_formats.len() as u64);
        }

        #[test]
        fn what_is_read_does_not_depend_on_how_the_source_delivers_it(
            bytes in prop::collection::vec(any::<u8>(), 0..500),
            few in 1usize..400,
        ) {
            let file = [file(0..20), bytes, file(20..40)].concat();
            let [whole, slow] = [Log::parse(&file), Log::<BinaryRecords>::read(Slow(&file, few))];
            prop_assert_eq!(texts(&whole), texts(&slow));
            prop_assert_eq!(whole.bytes, slow.bytes);
        }

        #[test]
        fn a_flipped_bit_costs_two_records_at_most(place in 0usize..100 * 75, bit in 0u32..8) {
            let mut bytes = file(0..100);
            let start = bytes.len() - 100 * 75;
            bytes[start + place] ^= 1 << bit;
            let log = Log::parse(&bytes);
            let expected: Vec<String> = (0..100).map(|number: u64| number.to_string()).collect();
            let intact = texts(&log).iter().filter(|text| expected.contains(text)).count();
            prop_assert!(intact >= 97, "{} of 100", intact);
        }
    }
}
