//! A recorded trace: CSV with a header; the columns may stand in any order, and others are ignored.
//!
//! | column | |
//! |---|---|
//! | `t_s` | seconds since some start |
//! | `voltage_v` | between the pack's terminals; empty where it was not measured |
//! | `current_a` | drawn from the pack; empty where it was not measured, −1 throughout or left out for no sensor |
//! | `healthy` | 0 where the sensor failed; 1 if left out |
//! | `armed` | 1 while the rover may move; 0 if left out |

use std::fmt;

use rover_battmon::battery::CellVoltages;

/// What some recorders write into every row when there is no sensor of the current.
const NO_SENSOR_A: f32 = -1.0;

/// A recorded trace.
#[derive(Debug, PartialEq)]
pub struct Trace {
    /// Its readings, as they follow each other.
    pub samples: Vec<Sample>,
}

/// One reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Seconds since some start.
    pub time_s: f64,
    /// Between the pack's terminals.
    pub voltage_v: Option<f32>,
    /// Drawn from the pack.
    pub current_a: Option<f32>,
    /// The sensor delivered.
    pub healthy: bool,
    /// The rover may move.
    pub armed: bool,
    /// Of the pack, in degrees Celsius.
    pub temperature_c: Option<f32>,
    /// Of each cell.
    pub cells: CellVoltages,
    /// What the board reported then, in a log of its own.
    pub reported: Option<Reported>,
}

impl Sample {
    /// One in which nothing was measured.
    pub const NONE: Self = Self {
        time_s: 0.0,
        voltage_v: None,
        current_a: None,
        healthy: true,
        armed: false,
        temperature_c: None,
        cells: CellVoltages::NONE,
        reported: None,
    };
}

/// What the board reported of the pack.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reported {
    /// Charge drawn, in milliampere-hours.
    pub consumed_mah: Option<f32>,
    /// Remaining charge, in percent: with its fraction where the log has it.
    pub remaining_pct: Option<f32>,
    /// Number of the charge state.
    pub charge_state: Option<u8>,
}

/// Why a file is no trace.
#[derive(Debug, PartialEq)]
pub struct TraceError {
    line: usize,
    message: String,
}

impl fmt::Display for TraceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.message)
    }
}

/// Where the columns are.
struct Columns {
    count: usize,
    time: usize,
    voltage: usize,
    current: Option<usize>,
    healthy: Option<usize>,
    armed: Option<usize>,
}

impl Trace {
    /// Reads a trace from the text of its file.
    pub fn parse(text: &str) -> Result<Self, TraceError> {
        let mut lines = text.lines().zip(1..).filter(|(line, _)| !line.trim().is_empty());
        let at = |line| move |message| TraceError { line, message };
        let (header, line) = lines.next().unwrap_or(("", 1));
        let columns = Columns::find(header).map_err(at(line))?;
        let samples: Result<Vec<_>, _> = lines
            .map(|(text, line)| columns.sample(text).map_err(at(line)))
            .collect();
        let mut samples = samples?;
        if samples.iter().all(|sample| sample.current_a == Some(NO_SENSOR_A)) {
            samples.iter_mut().for_each(|sample| sample.current_a = None);
        }
        Ok(Self { samples })
    }

    /// Whether the current was measured at all.
    pub fn has_current(&self) -> bool {
        self.samples.iter().any(|sample| sample.current_a.is_some())
    }
}

impl Columns {
    fn find(header: &str) -> Result<Self, String> {
        let names: Vec<&str> = header.split(',').map(str::trim).collect();
        let find = |wanted: &str| names.iter().position(|name| *name == wanted);
        let need = |wanted: &str| find(wanted).ok_or_else(|| format!("no column {wanted}"));
        Ok(Self {
            count: names.len(),
            time: need("t_s")?,
            voltage: need("voltage_v")?,
            current: find("current_a"),
            healthy: find("healthy"),
            armed: find("armed"),
        })
    }

    fn sample(&self, line: &str) -> Result<Sample, String> {
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        if fields.len() != self.count {
            return Err(format!("{} fields instead of {}", fields.len(), self.count));
        }
        let optional = |column: Option<usize>| column.map_or("", |column| fields[column]);
        Ok(Sample {
            time_s: time_s(fields[self.time])?,
            voltage_v: quantity(fields[self.voltage])?,
            current_a: quantity(optional(self.current))?,
            healthy: flag(optional(self.healthy), true)?,
            armed: flag(optional(self.armed), false)?,
            ..Sample::NONE
        })
    }
}

fn time_s(field: &str) -> Result<f64, String> {
    match field.parse() {
        Ok(time_s) if (0.0..1e9).contains(&time_s) => Ok(time_s),
        _ => Err(format!("{field:?} is no time")),
    }
}

fn quantity(field: &str) -> Result<Option<f32>, String> {
    if field.is_empty() {
        return Ok(None);
    }
    match field.parse::<f32>() {
        Ok(value) if value.is_finite() => Ok(Some(value)),
        _ => Err(format!("{field:?} is no number")),
    }
}

fn flag(field: &str, default: bool) -> Result<bool, String> {
    match field {
        "" => Ok(default),
        "0" => Ok(false),
        "1" => Ok(true),
        _ => Err(format!("{field:?} is neither 0 nor 1")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn only_sample(text: &str) -> Sample {
        Trace::parse(text).expect("a trace").samples[0]
    }

    fn message(text: &str) -> String {
        Trace::parse(text).expect_err("no trace").to_string()
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
    fn minus_one_throughout_is_no_sensor_but_one_reading_of_it_is_a_charger() {
        let none = Trace::parse("t_s,voltage_v,current_a\n0,7.9,-1\n1,7.9,-1.0000\n").unwrap();
        assert!(!none.has_current());
        let charged = Trace::parse("t_s,voltage_v,current_a\n0,7.9,-1\n1,7.9,-1.1\n").unwrap();
        assert_eq!(charged.samples[0].current_a, Some(-1.0));
    }

    #[test]
    fn a_malformed_line_is_named() {
        let header = "t_s,voltage_v,current_a,healthy\n0,7.9,1,1\n";
        for (line, expected) in [
            ("1,7.9", "line 3: 2 fields instead of 4"),
            ("1,x,1,1", "line 3: \"x\" is no number"),
            ("1,NaN,1,1", "line 3: \"NaN\" is no number"),
            ("-1,7.9,1,1", "line 3: \"-1\" is no time"),
            (",7.9,1,1", "line 3: \"\" is no time"),
            ("1,7.9,1,2", "line 3: \"2\" is neither 0 nor 1"),
        ] {
            assert_eq!(message(&format!("{header}{line}\n")), expected);
        }
    }

    #[test]
    fn a_header_without_a_voltage_is_no_trace() {
        assert_eq!(message(""), "line 1: no column t_s");
        assert_eq!(message("t_s,current_a\n"), "line 1: no column voltage_v");
    }
}
