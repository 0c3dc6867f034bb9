//! A drive in a log of the board: the readings of a pack, and what the log says as a whole.

use std::io;

use rover_battmon::pack::Pack;
use rover_battmon::parameter::ParameterId;
use rover_battmon_tools::recordings::entry::{Content, Entries, Sample};

use crate::assignments::{Assignment, LogParameters};
use crate::readings::Readings;
use crate::survey::{Inputs, Survey};

/// The readings of a pack.
#[derive(Debug, PartialEq)]
pub struct Trace {
    /// As they follow each other.
    pub samples: Vec<Sample>,
    /// Parameters that were set between them, in their order.
    pub changes: Vec<Change>,
}

/// A parameter that was set during a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Readings before it.
    pub readings: usize,
    /// The parameter and its new value.
    pub assignment: Assignment,
}

/// A drive.
#[derive(Debug)]
pub struct Drive {
    /// The readings of the pack.
    pub trace: Trace,
    /// Facts of the log as a whole; none of a trace.
    pub survey: Survey,
}

impl Drive {
    /// The drive of `pack` in a log that can be opened twice, or why there is none.
    pub fn read<'a>(
        open: impl Fn() -> io::Result<Box<dyn Entries + 'a>>,
        pack: Pack,
    ) -> Result<Self, String> {
        let in_words = |error: io::Error| error.to_string();
        let survey = open().and_then(Survey::of).map_err(in_words)?;
        if let Some(obstacle) = survey.obstacle() {
            return Err(obstacle.into());
        }
        let trace = open().and_then(|entries| Trace::of_pack(entries, pack, &survey));
        let trace = trace.map_err(in_words)?;
        if trace.samples.is_empty() {
            return Err(no_reading(&survey, pack));
        }
        Ok(Self { trace, survey })
    }

    /// When its first reading was, in seconds since 1970 (UTC), if the log has it.
    pub fn began_utc_s(&self) -> Option<f64> {
        Some(self.survey.started_utc_s? + self.trace.samples.first()?.time_s)
    }
}

impl Trace {
    /// Takes the rover for armed at each reading.
    pub fn arm_throughout(&mut self) {
        for sample in &mut self.samples {
            sample.armed = true;
        }
    }

    /// Quantities that were measured in any of its readings.
    pub fn measured(&self) -> Inputs {
        Inputs {
            voltage: true,
            current: self.samples.iter().any(|sample| sample.current_a.is_some()),
        }
    }

    /// The readings of a pack in a log.
    fn of_pack(entries: Box<dyn Entries + '_>, pack: Pack, survey: &Survey) -> io::Result<Self> {
        let mut samples = vec![];
        let mut changes = vec![];
        let mut parameters = LogParameters::default();
        let mut readings = Readings::beginning(survey.initial_arm_state());
        let take = |samples: &mut Vec<Sample>, of: Pack, sample: Sample| {
            if of == pack {
                samples.push(sample);
            }
        };
        for entry in entries {
            let entry = entry?;
            readings.add(&entry, |of, sample| take(&mut samples, of, sample));
            let Content::Parameter(name, value) = &entry.content else {
                continue;
            };
            let changed = parameters.changed_value(name, *value);
            let is_of_other = |id| matches!(id, ParameterId::Battery(other, _) if other != pack);
            if let Some((id, value)) = changed.filter(|(id, _)| !is_of_other(*id)) {
                readings.finish(|of, sample| take(&mut samples, of, sample));
                changes.push(Change {
                    readings: samples.len(),
                    assignment: Assignment { id, value },
                });
            }
        }
        readings.finish(|of, sample| take(&mut samples, of, sample));
        Ok(Self { samples, changes })
    }
}

fn no_reading(survey: &Survey, pack: Pack) -> String {
    let numbers: Vec<String> = Pack::ALL
        .iter()
        .filter(|pack| survey.measured(**pack).is_some())
        .map(|pack| pack.number().to_string())
        .collect();
    format!(
        "no reading of pack {}, but of {}",
        pack.number(),
        numbers.join(", ")
    )
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use proptest::prelude::*;
    use rover_battmon::battery::{
        Amount, BatteryState, CellVoltages, ChargeState, Extremes, PackStatus, Readings,
    };
    use rover_battmon::parameter::BatteryParameter;
    use rover_battmon::recorder::dataflash::{ArmingMethod, Record as Recorded, opening_record};
    use rover_battmon::time::Utc;
    use rover_battmon::vehicle::ArmState;
    use rover_battmon_tools::recordings::csv::Csv;
    use rover_battmon_tools::recordings::dataflash;
    use rover_battmon_tools::recordings::entry::Reported;

    /// Beginning of a file of the board.
    pub fn opening() -> Vec<u8> {
        let records = (0..).map_while(|index| opening_record(index, 0));
        records.flatten().collect()
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

    /// A parameter of the board.
    pub fn parameter(name: &str, value: f32) -> Recorded<'_> {
        Recorded::Parameter {
            name,
            value,
            default: 0.0,
        }
    }

    /// A trace in columns.
    pub fn trace_of(text: &str) -> Trace {
        let drive = Drive::read(|| Ok(Box::new(Csv::of(text.as_bytes()))), Pack::First);
        drive.expect("a trace").trace
    }

    fn log(records: &[Recorded]) -> Vec<u8> {
        let records = records
            .iter()
            .zip(1..)
            .map(|(record, tenths)| record.encode(100_000 * tenths));
        [opening(), records.flatten().collect()].concat()
    }

    /// The drive of a pack in these bytes.
    fn drive_of(bytes: &[u8], pack: Pack) -> Result<Drive, String> {
        Drive::read(|| Ok(Box::new(dataflash::binary(bytes))), pack)
    }

    fn drive_in(records: &[Recorded], pack: Pack) -> Drive {
        drive_of(&log(records), pack).expect("a drive")
    }

    /// The sample that is read of records of a pack in this state. It is the second one: a record without a pack is the first one's.
    fn sample_of(state: &BatteryState) -> Sample {
        let records: Vec<Recorded> = Recorded::of_pack(Pack::Second, state, Extremes::default()).collect();
        drive_in(&records, Pack::Second).trace.samples[0]
    }

    fn healthy() -> BatteryState {
        BatteryState {
            status: PackStatus::Healthy,
            readings: Readings {
                voltage_v: Some(48.5),
                current_a: Some(-2.5),
                remaining_pct: Some(66.25),
                ..Readings::NONE
            },
            temperature_c: Some(21.5),
            consumed: Some(Amount::Mah(125.0)),
            charge_state: ChargeState::Low,
            cells: CellVoltages::from_millivolts(&[3700; 13]),
            ..BatteryState::UNKNOWN
        }
    }

    #[test]
    fn a_reading_is_what_was_recorded_of_it() {
        let state = healthy();
        let extremes = Extremes {
            lowest_voltage_v: Some(47.25),
            highest_current_a: None,
        };
        let records: Vec<Recorded> = Recorded::of_pack(Pack::Second, &state, extremes).collect();
        let drive = drive_in(&records, Pack::Second);
        let expected = Sample {
            time_s: 0.1,
            voltage_v: Some(48.5),
            current_a: Some(-2.5),
            healthy: true,
            armed: false,
            temperature_c: Some(21.5),
            cells: state.cells,
            reported: Some(Reported {
                consumed_mah: Some(125.0),
                remaining_pct: Some(66.25),
                charge_state: Some(2),
                faults: Some(0),
                extremes: Some(extremes),
                ..Reported::default()
            }),
        };
        assert_eq!(drive.trace.samples, [expected]);
    }

    #[test]
    fn the_cells_of_a_log_are_all_or_none() {
        for (count, read) in [(13, 13), (14, 14), (16, 16), (22, 0)] {
            let mut state = healthy();
            state.readings.voltage_v = Some(count as f32 * 3.3);
            state.cells = CellVoltages::from_millivolts(&vec![3300; count]);
            assert_eq!(sample_of(&state).cells.count(), read, "{count} cells");
        }
    }

    #[test]
    fn the_date_is_that_of_the_first_reading() {
        let state = healthy();
        let reading = Recorded::Battery(Pack::First, &state);
        // At 0.3 and 0.4 s; the first reading is at 0.1 s.
        let times = [1_795_639_396_450_000, 1_800_000_000_000_000].map(Utc::from_micros);
        let [time, later] = times.map(Recorded::Time);
        let drive = drive_in(&[reading, reading, time, later], Pack::First);
        let began_utc_s = drive.began_utc_s().expect("a date");
        assert!((began_utc_s - 1_795_639_396.25).abs() < 0.001, "{began_utc_s}");
        assert_eq!(drive_in(&[reading], Pack::First).began_utc_s(), None);
    }

    #[test]
    fn what_was_unknown_is_unknown() {
        let unknown = BatteryState::UNKNOWN;
        let reading = Recorded::Battery(Pack::First, &unknown);
        let expected = Sample {
            time_s: 0.1,
            healthy: false,
            reported: Some(Reported::default()),
            ..Sample::NONE
        };
        assert_eq!(drive_in(&[reading], Pack::First).trace.samples, [expected]);
    }

    #[test]
    fn only_a_failed_sensor_is_not_healthy() {
        for (status, healthy) in [
            (PackStatus::Healthy, true),
            (PackStatus::NotConnected, true),
            (PackStatus::Unhealthy, false),
        ] {
            let state = BatteryState {
                status,
                ..BatteryState::UNKNOWN
            };
            assert_eq!(sample_of(&state).healthy, healthy, "{status:?}");
        }
    }

    #[test]
    fn readings_know_whether_the_rover_was_armed() {
        let state = healthy();
        let reading = Recorded::Battery(Pack::First, &state);
        let records = [
            reading,
            arming(ArmState::Armed),
            reading,
            arming(ArmState::Disarmed),
            reading,
        ];
        let drive = drive_in(&records, Pack::First);
        let armed: Vec<bool> = drive.trace.samples.iter().map(|sample| sample.armed).collect();
        assert_eq!(armed, [false, true, false]);
    }

    #[test]
    fn parameters_are_the_first_of_each_and_later_ones_hold_from_then_on() {
        let state = healthy();
        let records = [
            parameter("BATT2_CAPACITY", 1000.0),
            parameter("BATT2_CAPACITY", 5200.0),
            parameter("BATT2_ARM_VOLT", f32::NAN),
            parameter("EK3_ENABLE", 1.0),
            Recorded::Battery(Pack::Second, &state),
            // A start-up value between readings, the same once more, and another one.
            parameter("BATT2_LOW_VOLT", 10.5),
            parameter("BATT2_LOW_VOLT", 10.5),
            Recorded::Battery(Pack::Second, &state),
            // Of another pack.
            parameter("BATT_LOW_VOLT", 9.0),
            parameter("BATT_LOW_VOLT", 9.5),
            parameter("BATT2_LOW_VOLT", 9.5),
            Recorded::Battery(Pack::Second, &state),
        ];
        let drive = drive_in(&records, Pack::Second);
        let parameters = drive.survey.parameters.expect("the log has some");
        let value = |parameter: BatteryParameter| parameters.get(parameter.of(Pack::Second));
        assert_eq!(value(BatteryParameter::Capacity), 1000.0);
        assert_eq!(value(BatteryParameter::LowVolt), 10.5);
        assert_eq!(
            value(BatteryParameter::ArmVolt),
            BatteryParameter::ArmVolt.of(Pack::Second).default_value()
        );
        let change = |readings, parameter: BatteryParameter, value| Change {
            readings,
            assignment: Assignment {
                id: parameter.of(Pack::Second),
                value,
            },
        };
        assert_eq!(
            drive.trace.changes,
            [
                change(0, BatteryParameter::Capacity, 5200.0),
                change(2, BatteryParameter::LowVolt, 9.5)
            ]
        );
    }

    #[test]
    fn packs_that_are_there_are_named() {
        let state = healthy();
        let records = [
            Recorded::Battery(Pack::First, &state),
            Recorded::Battery(Pack::Third, &state),
        ];
        let error = |log: &[u8]| drive_of(log, Pack::Second).expect_err("no drive");
        assert_eq!(error(&log(&records)), "no reading of pack 2, but of 1, 3");
        assert_eq!(error(&log(&[])), "no reading of a pack");
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_drive_or_none(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            let state = healthy();
            let reading = Recorded::Battery(Pack::First, &state).encode(0);
            let _ = drive_of(&[opening(), reading.to_vec(), bytes].concat(), Pack::First);
        }
    }
}
