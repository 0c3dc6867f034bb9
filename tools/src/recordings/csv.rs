//! A recorded trace: CSV with a header; the columns may stand in any order, and others are ignored.
//!
//! | column | names | |
//! |---|---|---|
//! | `t_s` | `t`, `time`, `timestamp`, `seconds`, `elapsed` | seconds since some start; Unix time counts from the first reading |
//! | `voltage_v` | `v`, `volt`, `volts`, `voltage` | between the pack's terminals; empty where it was not measured |
//! | `current_a` | `a`, `i`, `amp`, `amps`, `amperes`, `curr`, `current` | drawn from the pack; empty where it was not measured, −1 throughout or left out for no sensor |
//! | `temperature_c` | `temperature` | of the pack, in degrees Celsius; empty where it was not measured |
//! | `healthy` | | 0 where the sensor failed; 1 if left out |
//! | `armed` | | 1 while the rover may move; 0 if left out |
//!
//! Of a name only letters and digits count, in any case, and a unit may follow: `Voltage [V]` is `voltage_v`. Fields are separated
//! by commas, or by semicolons or tabs; with the latter two, numbers may have a decimal comma. Empty lines and those that begin
//! with `#` are skipped.

use std::io::{self, Error, ErrorKind::InvalidData, Read};
use std::mem::replace;
use std::vec::IntoIter;

use rover_battmon::pack::Pack;
use rover_battmon::vehicle::ArmState;

use super::entry::{Bytes, Content, Entries, Entry, Sample};

/// Value of some recorders in every row when there is no sensor of the current.
const NO_SENSOR_A: f32 = -1.0;

/// Times from here on are Unix time, in seconds: in September 2001. No recording lasts as long.
const UNIX_TIME_FROM_S: f64 = 1e9;

/// The latest time that is read, in seconds.
const LATEST_S: f64 = 1e10;

/// Mark with which files of Windows programs may begin.
const BYTE_ORDER_MARK: char = '\u{feff}';
const BYTE_ORDER_MARKS_OF_UTF16: [[u8; 2]; 2] = [[0xff, 0xfe], [0xfe, 0xff]];

/// Separators of fields; the first of these that the header has counts.
const SEPARATORS: [char; 3] = [';', '\t', ','];

/// Characters of a field that an error shows.
const SHOWN_CHARACTERS: usize = 40;

/// The entries of a trace, which is read as a whole: its unit of time and whether it has a current show at its end only.
pub struct Csv {
    entries: IntoIter<io::Result<Entry>>,
    bytes: Bytes,
}

impl Csv {
    /// Of a trace that `source` delivers. Its only error is the first line that does not belong to one, and what it should be.
    pub fn of(mut source: impl Read) -> Self {
        let mut bytes = vec![];
        let read = source.read_to_end(&mut bytes);
        let samples = read.and_then(|_| samples(&bytes).map_err(|text| Error::new(InvalidData, text)));
        let entries = match samples {
            Ok(samples) => entries(&samples).map(Ok).collect(),
            Err(error) => vec![Err(error)],
        };
        Self {
            entries: entries.into_iter(),
            bytes: Bytes {
                read: bytes.len() as u64,
                ..Bytes::default()
            },
        }
    }
}

impl Entries for Csv {
    fn bytes(&self) -> Bytes {
        self.bytes
    }
}

impl Iterator for Csv {
    type Item = io::Result<Entry>;

    fn next(&mut self) -> Option<Self::Item> {
        self.entries.next()
    }
}

/// Readings of the first pack, and whether the rover is armed where that changes.
fn entries(samples: &[Sample]) -> impl Iterator<Item = Entry> {
    let mut was_armed = false;
    samples.iter().flat_map(move |sample| {
        let is_changed = replace(&mut was_armed, sample.armed) != sample.armed;
        let arm_state = match sample.armed {
            true => ArmState::Armed,
            false => ArmState::Disarmed,
        };
        let contents = [
            is_changed.then_some(Content::ArmState(arm_state)),
            Some(Content::Reading(Pack::First, Box::new(*sample))),
        ];
        let time_s = Some(sample.time_s);
        contents
            .into_iter()
            .flatten()
            .map(move |content| Entry { time_s, content })
    })
}

/// The readings of a trace, or the first line that does not belong to one, and what it should be.
fn samples(bytes: &[u8]) -> Result<Vec<Sample>, String> {
    let at = |line: u32| move |message: String| format!("line {line}: {message}");
    if BYTE_ORDER_MARKS_OF_UTF16
        .iter()
        .any(|mark| bytes.starts_with(mark))
    {
        return Err(at(1)("UTF-16 can't be read: save the file as UTF-8".into()));
    }
    // Names and notes may be in any encoding: what is read is ASCII.
    let text = String::from_utf8_lossy(bytes);
    let text = text.trim_start_matches([BYTE_ORDER_MARK, '\0']);
    let mut lines = text.lines().zip(1..).filter(|(line, _)| has_fields(line));
    let (header, line) = lines.next().unwrap_or(("", 1));
    let columns = Columns::find(header).map_err(at(line))?;
    let mut samples = vec![];
    let mut latest_s = 0.0;
    for (text, line) in lines {
        let sample = columns.sample(text, latest_s).map_err(at(line))?;
        latest_s = sample.time_s;
        samples.push(sample);
    }
    if samples.is_empty() {
        return Err(at(line)("no reading follows".into()));
    }
    leave_out_missing_current(&mut samples);
    start_unix_time_at_zero(&mut samples);
    Ok(samples)
}

/// Whether a line is neither empty, as programs for tables write that, nor a comment.
fn has_fields(line: &str) -> bool {
    let is_empty = line
        .chars()
        .all(|c| c.is_whitespace() || c == '"' || SEPARATORS.contains(&c));
    !is_empty && !line.trim_start().starts_with('#')
}

fn leave_out_missing_current(samples: &mut [Sample]) {
    if samples.iter().all(|sample| sample.current_a == Some(NO_SENSOR_A)) {
        samples.iter_mut().for_each(|sample| sample.current_a = None);
    }
}

fn start_unix_time_at_zero(samples: &mut [Sample]) {
    let Some(first) = samples.first().filter(|first| first.time_s >= UNIX_TIME_FROM_S) else {
        return;
    };
    let start_s = first.time_s;
    for sample in samples {
        // To the microsecond: the fraction of a large number is not exact.
        sample.time_s = ((sample.time_s - start_s) * 1e6).round() / 1e6;
    }
}

/// The names of a column, and the unit that may follow each.
struct Names {
    quantity: &'static str,
    names: &'static [&'static str],
    unit: &'static str,
}

const TIME: Names = Names {
    quantity: "time",
    names: &["t", "time", "timestamp", "seconds", "elapsed"],
    unit: "s",
};

const VOLTAGE: Names = Names {
    quantity: "voltage",
    names: &["v", "volt", "volts", "voltage"],
    unit: "v",
};

const CURRENT: Names = Names {
    quantity: "current",
    names: &["a", "i", "amp", "amps", "amperes", "curr", "current"],
    unit: "a",
};

const TEMPERATURE: Names = Names {
    quantity: "temperature",
    names: &["temperature"],
    unit: "c",
};

const HEALTHY: Names = Names {
    quantity: "state of the sensor",
    names: &["healthy"],
    unit: "",
};

const ARMED: Names = Names {
    quantity: "state of the rover",
    names: &["armed"],
    unit: "",
};

impl Names {
    fn include(&self, name: &str) -> bool {
        let letters_and_digits = name.chars().filter(char::is_ascii_alphanumeric);
        let name = letters_and_digits.collect::<String>().to_ascii_lowercase();
        let without_unit = name.strip_suffix(self.unit).unwrap_or(&name);
        self.names
            .iter()
            .any(|known| [&*name, without_unit].contains(known))
    }
}

/// Indexes of the columns.
struct Columns<'a> {
    separator: char,
    names: Vec<&'a str>,
    time: usize,
    voltage: usize,
    current: Option<usize>,
    temperature: Option<usize>,
    healthy: Option<usize>,
    armed: Option<usize>,
}

impl<'a> Columns<'a> {
    fn find(header: &'a str) -> Result<Self, String> {
        let is_used = |separator: &char| header.contains(*separator);
        let separator = SEPARATORS.into_iter().find(is_used).unwrap_or(',');
        let names = fields(header, separator);
        let find = |wanted: &Names| position(&names, wanted);
        let need = |wanted: &Names| find(wanted)?.ok_or_else(|| missing(wanted, header));
        Ok(Self {
            separator,
            time: need(&TIME)?,
            voltage: need(&VOLTAGE)?,
            current: find(&CURRENT)?,
            temperature: find(&TEMPERATURE)?,
            healthy: find(&HEALTHY)?,
            armed: find(&ARMED)?,
            names,
        })
    }

    /// The reading of a line, which is not before `latest_s`.
    fn sample(&self, line: &str, latest_s: f64) -> Result<Sample, String> {
        let fields = fields(line, self.separator);
        if fields.len() != self.names.len() {
            let (fields, columns) = (fields.len(), self.names.len());
            return Err(format!("{fields} fields in {columns} columns"));
        }
        let field = |column: usize| Field {
            column: self.names[column],
            text: fields[column],
            // Between commas there is no decimal comma.
            number: fields[column].replace(',', "."),
        };
        let optional = |column: Option<usize>| column.map(field);
        Ok(Sample {
            time_s: field(self.time).time_s(latest_s)?,
            voltage_v: field(self.voltage).quantity()?,
            current_a: optional(self.current).map_or(Ok(None), |field| field.quantity())?,
            temperature_c: optional(self.temperature).map_or(Ok(None), |field| field.quantity())?,
            healthy: optional(self.healthy).map_or(Ok(true), |field| field.flag(true))?,
            armed: optional(self.armed).map_or(Ok(false), |field| field.flag(false))?,
            ..Sample::NONE
        })
    }
}

fn fields(line: &str, separator: char) -> Vec<&str> {
    line.split(separator)
        .map(|field| field.trim().trim_matches('"').trim())
        .collect()
}

fn position(names: &[&str], wanted: &Names) -> Result<Option<usize>, String> {
    let mut found = (0..names.len()).filter(|column| wanted.include(names[*column]));
    match (found.next(), found.next()) {
        (Some(first), Some(second)) => Err(format!(
            "both {} and {} are a {}: leave one",
            shown(names[first]),
            shown(names[second]),
            wanted.quantity
        )),
        (first, _) => Ok(first),
    }
}

fn missing(wanted: &Names, header: &str) -> String {
    format!(
        "no column of a {} in {}: one has to be named {}",
        wanted.quantity,
        shown(header),
        wanted.names.join(", ")
    )
}

/// A field as an error shows it.
fn shown(text: &str) -> String {
    let short: String = text.chars().take(SHOWN_CHARACTERS).collect();
    let more = if short.len() < text.len() { "…" } else { "" };
    format!("{short:?}{more}")
}

/// A field of a line.
struct Field<'a> {
    column: &'a str,
    text: &'a str,
    /// With a decimal point.
    number: String,
}

impl Field<'_> {
    fn time_s(&self, latest_s: f64) -> Result<f64, String> {
        match self.number.parse() {
            Ok(time_s) if (0.0..latest_s).contains(&time_s) => {
                Err(self.not(&format!("at least {latest_s}, as in the reading before")))
            }
            Ok(time_s) if (0.0..LATEST_S).contains(&time_s) => Ok(time_s),
            _ => Err(self.not(&format!("seconds from 0 to {LATEST_S}"))),
        }
    }

    fn quantity(&self) -> Result<Option<f32>, String> {
        if self.text.is_empty() {
            return Ok(None);
        }
        match self.number.parse::<f32>() {
            Ok(value) if value.is_finite() => Ok(Some(value)),
            _ => Err(self.not("a number, or nothing")),
        }
    }

    fn flag(&self, default: bool) -> Result<bool, String> {
        match self.text.to_ascii_lowercase().as_str() {
            "" => Ok(default),
            "0" | "false" => Ok(false),
            "1" | "true" => Ok(true),
            _ => Err(self.not("0 or 1")),
        }
    }

    fn not(&self, valid: &str) -> String {
        format!("{} can't be {}: {valid}", self.column, shown(self.text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn only_sample(text: &str) -> Sample {
        let samples = samples(text.as_bytes()).expect("a trace");
        assert_eq!(samples.len(), 1);
        samples[0]
    }

    fn message(text: &str) -> String {
        samples(text.as_bytes()).expect_err("no trace")
    }

    #[test]
    fn columns_are_found_by_name() {
        let sample = only_sample("armed,note,current_a,voltage_v,t_s,healthy\n1,x,2.5,11.1,0.25,0\n");
        assert_eq!(
            sample,
            Sample {
                time_s: 0.25,
                voltage_v: Some(11.1),
                current_a: Some(2.5),
                healthy: false,
                armed: true,
                ..Sample::NONE
            }
        );
    }

    /// As Excel (with a byte order mark), LibreOffice, `mavlogdump.py --format csv` and people write it.
    #[test]
    fn common_files_are_read_as_they_are() {
        let expected = Sample {
            time_s: 2.5,
            voltage_v: Some(11.25),
            current_a: Some(3.5),
            armed: true,
            ..Sample::NONE
        };
        for text in [
            "\u{feff}Time (s);Voltage (V);Current (A);Armed\r\n2,5;11,25;3,5;1\r\n",
            "\u{feff}# by hand\r\n\r\n;;;\r\nTIME;VOLTAGE;CURRENT;ARMED\r\n2,50;11,250;3,50;TRUE\r\n;;;\r\n",
            "Elapsed\tVolts\tAmps\tArmed\n2,5\t11,25\t3,5\t1\n",
            "timestamp,TimeUS,Inst,Volt,VoltR,Curr,CurrTot,armed\n2.5,95000000,0,11.25,11.5,3.5,0.5,1\n",
            "  Armed , t , U , V , A \n # climbs\n 1 , 2.5 , x , 11.25 , 3.5 \n",
            "\"t_s\",\"voltage_v\",\"current_a\",\"armed\"\n\"2.5\",\"11.25\",\"3.5\",\"1\"\n",
            "t [s];U [V];Voltage [V];I [A];armed\n2.5;;11.25;3.5;1",
        ] {
            assert_eq!(only_sample(text), expected, "{text:?}");
        }
    }

    #[test]
    fn letters_of_another_encoding_do_not_matter() {
        let latin_1 = b"t_s;voltage_v;Temperatur \xb0C\n1;7,9;21\n";
        let trace = samples(latin_1).expect("a trace");
        assert_eq!(trace[0].voltage_v, Some(7.9));
        let utf_16 = b"\xff\xfet\x00_\x00s\x00";
        let error = samples(utf_16).expect_err("no trace");
        assert_eq!(error, "line 1: UTF-16 can't be read: save the file as UTF-8");
    }

    #[test]
    fn unix_time_counts_from_the_first_reading() {
        let text = "time,volts\n1763879000.3,7.9\n1763879000.4,7.9\n1763879060.3,7.9\n";
        let trace = samples(text.as_bytes()).expect("a trace");
        let times_s: Vec<f64> = trace.iter().map(|sample| sample.time_s).collect();
        assert_eq!(times_s, [0.0, 0.1, 60.0]);
    }

    #[test]
    fn what_is_left_out_is_healthy_disarmed_and_without_a_current() {
        let expected = Sample {
            time_s: 1.0,
            voltage_v: Some(7.9),
            ..Sample::NONE
        };
        assert_eq!(only_sample("t_s,voltage_v\r\n1,7.9\r\n"), expected);
        assert_eq!(only_sample("t_s,voltage_v,current_a\n1,7.9,\n"), expected);
    }

    #[test]
    fn a_temperature_is_read_where_it_was_measured() {
        let text = "t_s,voltage_v,Temperature [C]\n1,7.9,-12.5\n2,7.9,\n";
        let trace = samples(text.as_bytes()).expect("a trace");
        let temperatures_c: Vec<_> = trace.iter().map(|sample| sample.temperature_c).collect();
        assert_eq!(temperatures_c, [Some(-12.5), None]);
    }

    #[test]
    fn minus_one_throughout_is_no_sensor_but_one_reading_of_it_is_a_charger() {
        let none = samples(b"t_s,voltage_v,current_a\n0,7.9,-1\n1,7.9,-1.0000\n").unwrap();
        assert!(none.iter().all(|sample| sample.current_a.is_none()));
        let charged = samples(b"t_s,voltage_v,current_a\n0,7.9,-1\n1,7.9,-1.1\n").unwrap();
        assert_eq!(charged[0].current_a, Some(-1.0));
    }

    #[test]
    fn a_malformed_line_is_named_with_its_column_its_value_and_what_is_valid() {
        let header = "Time,Volts,current_a,healthy\n\n# rest\n0.5,7.9,1,1\n";
        for (line, expected) in [
            ("1,7.9", "2 fields in 4 columns"),
            ("1,x,1,1", "Volts can't be \"x\": a number, or nothing"),
            ("1,NaN,1,1", "Volts can't be \"NaN\": a number, or nothing"),
            (
                "1,7.9,1e99,1",
                "current_a can't be \"1e99\": a number, or nothing",
            ),
            (
                "-1,7.9,1,1",
                "Time can't be \"-1\": seconds from 0 to 10000000000",
            ),
            (",7.9,1,1", "Time can't be \"\": seconds from 0 to 10000000000"),
            (
                "12:04,7.9,1,1",
                "Time can't be \"12:04\": seconds from 0 to 10000000000",
            ),
            (
                "0.4,7.9,1,1",
                "Time can't be \"0.4\": at least 0.5, as in the reading before",
            ),
            ("1,7.9,1,2", "healthy can't be \"2\": 0 or 1"),
        ] {
            assert_eq!(
                message(&format!("{header}{line}\n")),
                format!("line 5: {expected}")
            );
        }
        let long = message(&format!("{header}1,{},1,1", "x".repeat(1000)));
        assert!(long.len() < 120, "{long}");
    }

    #[test]
    fn a_header_without_a_time_or_a_voltage_or_with_two_is_no_trace() {
        for (header, expected) in [
            (
                "",
                "no column of a time in \"\": one has to be named t, time, timestamp, seconds, elapsed",
            ),
            (
                "t_s,current_a",
                "no column of a voltage in \"t_s,current_a\": one has to be named v, volt, volts, voltage",
            ),
            (
                "t_s,voltage_mv",
                "no column of a voltage in \"t_s,voltage_mv\": one has to be named v, volt, volts, voltage",
            ),
            (
                "t_s,voltage_v,Volts",
                "both \"voltage_v\" and \"Volts\" are a voltage: leave one",
            ),
            ("t_s,voltage_v", "no reading follows"),
        ] {
            assert_eq!(message(header), format!("line 1: {expected}"));
        }
    }

    /// Lines that are nearly those of a trace.
    fn nearly_a_trace() -> impl Strategy<Value = Vec<u8>> {
        // One of them is empty: behind the second space of two.
        let fields = "0 1 2.5 2,5 -1  NaN inf 1e38 1763879000 # \" x";
        let field = prop::sample::select(fields.split(' ').collect::<Vec<_>>());
        let separator = || prop::sample::select(vec![",", ";", "\t"]);
        let line = (prop::collection::vec(field, 3..5), separator())
            .prop_map(|(fields, separator)| fields.join(separator));
        let header = separator().prop_map(|separator| ["t_s", "voltage_v", "current_a"].join(separator));
        (header, prop::collection::vec(line, 0..20))
            .prop_map(|(header, lines)| format!("{header}\n{}", lines.join("\r\n")).into_bytes())
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_trace_or_none(bytes in prop::collection::vec(any::<u8>(), 0..500)) {
            let _ = samples(&bytes);
            let _ = samples(&[b"t,v,a\n".as_slice(), &bytes].concat());
        }

        #[test]
        fn what_is_read_are_times_that_go_on_and_numbers(bytes in nearly_a_trace()) {
            if let Ok(trace) = samples(&bytes) {
                let times_s: Vec<f64> = trace.iter().map(|sample| sample.time_s).collect();
                prop_assert!(times_s.is_sorted(), "{times_s:?}");
                for sample in trace {
                    let numbers = [sample.voltage_v, sample.current_a];
                    prop_assert!(numbers.into_iter().flatten().all(f32::is_finite), "{sample:?}");
                }
            }
        }
    }
}
