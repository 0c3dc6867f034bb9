//! A drive in a log of the board: the readings of a pack, the parameters and when the rover was armed.

use rover_battmon::battery::{CellVoltages, MAX_CELLS};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{ParameterId, Parameters};

use crate::binlog::{Log, Record};
use crate::trace::{Reported, Sample, Trace};

/// BAT: a remaining charge that is unknown.
const REMAINING_UNKNOWN_PCT: f32 = 255.0;

/// BATX: `Stat` of a pack whose sensor has failed.
const UNHEALTHY: f64 = 4.0;

/// Cells in BCL; BCL2 has those that follow.
const FIRST_CELLS: usize = 12;

/// GPS time began with 1980-01-06, in seconds since 1970; since 2017 it is 18 leap seconds ahead of UTC.
const GPS_EPOCH_S: f64 = 315_964_800.0 - 18.0;

const WEEK_S: f64 = 7.0 * 86_400.0;

/// A drive.
#[derive(Debug)]
pub struct Drive {
    /// The readings of the pack.
    pub trace: Trace,
    /// The last value of each parameter in the log, defaults beside; `None` if it has none.
    pub parameters: Option<Parameters>,
    /// When the recorder started, in seconds since 1970 (UTC), if the log has it.
    pub started_utc_s: Option<f64>,
}

impl Drive {
    /// The drive of `pack`, or why there is none.
    pub fn of_pack(log: &Log, pack: Pack) -> Result<Self, String> {
        let mut drive = Self {
            trace: Trace { samples: vec![] },
            parameters: None,
            started_utc_s: None,
        };
        let mut armed = false;
        for record in log.records.iter().filter(|record| !is_of_another(record, pack)) {
            match record.name() {
                "PARM" => drive.parameter(record),
                "ARM" => armed = record.number("ArmState") == Some(1.0),
                "BAT" => drive.reading(record, armed),
                "BATX" => drive.estimate(record),
                "BCL" => drive.cells(record, 0..FIRST_CELLS),
                "BCL2" => drive.cells(record, FIRST_CELLS..MAX_CELLS),
                "GPS" => drive.started_utc_s = drive.started_utc_s.or(started_utc_s(record)),
                _ => {}
            }
        }
        if drive.trace.samples.is_empty() {
            return Err(no_reading(log, pack));
        }
        Ok(drive)
    }

    /// When its first reading was, in seconds since 1970 (UTC), if the log has it.
    pub fn began_utc_s(&self) -> Option<f64> {
        Some(self.started_utc_s? + self.trace.samples.first()?.time_s)
    }

    /// What another version has set does not matter here: a parameter that is not known, or a value out of range.
    fn parameter(&mut self, record: &Record) {
        let id = record
            .text("Name")
            .and_then(|name| ParameterId::from_name(name.as_bytes()));
        if let Some((id, value)) = id.zip(number(record, "Value")) {
            let parameters = self.parameters.get_or_insert_with(Parameters::defaults);
            let _ = parameters.set(id, value);
        }
    }

    fn reading(&mut self, record: &Record, armed: bool) {
        let Some(time_us) = record.number("TimeUS") else {
            return;
        };
        self.trace.samples.push(Sample {
            time_s: time_us / 1e6,
            voltage_v: number(record, "Volt"),
            current_a: number(record, "Curr"),
            // Logs of ArduPilot before 4.6 do not say.
            healthy: record.number("H") != Some(0.0),
            armed,
            // 0 is unknown.
            temperature_c: number(record, "Temp").filter(|celsius| *celsius != 0.0),
            cells: CellVoltages::NONE,
            reported: Some(Reported {
                consumed_mah: number(record, "CurrTot"),
                remaining_pct: number(record, "RemPct").filter(|pct| *pct != REMAINING_UNKNOWN_PCT),
                charge_state: None,
            }),
        });
    }

    /// It follows the reading that it belongs to.
    fn estimate(&mut self, record: &Record) {
        let Some(sample) = self.trace.samples.last_mut() else {
            return;
        };
        // A pack that is not connected is not healthy, and its sensor works.
        sample.healthy = record.number("Stat") != Some(UNHEALTHY);
        if let Some(reported) = &mut sample.reported {
            reported.remaining_pct = number(record, "SoC").or(reported.remaining_pct);
            reported.charge_state = record.number("State").map(|state| state as u8);
        }
    }

    /// They follow the reading that they belong to. A cell that does not exist is 0.
    fn cells(&mut self, record: &Record, places: std::ops::Range<usize>) {
        let Some(sample) = self.trace.samples.last_mut() else {
            return;
        };
        let mut millivolts = sample.cells.millivolts().to_vec();
        let cells = places.map_while(|place| record.number(&format!("V{}", place + 1)));
        millivolts.extend(cells.take_while(|mv| *mv > 0.0).map(|mv| mv as u16));
        sample.cells = CellVoltages::from_millivolts(&millivolts);
    }
}

/// When the recorder started, by a GPS record. Week 0 is unknown.
fn started_utc_s(record: &Record) -> Option<f64> {
    let weeks = record.number("GWk").filter(|weeks| *weeks > 0.0)?;
    let of_week_s = record.number("GMS")? / 1e3;
    Some(GPS_EPOCH_S + weeks * WEEK_S + of_week_s - record.number("TimeUS")? / 1e6)
}

fn no_reading(log: &Log, pack: Pack) -> String {
    let has_reading = |pack: &Pack| log.records.iter().any(|record| is_of(record, "BAT", *pack));
    let numbers: Vec<String> = Pack::ALL
        .iter()
        .filter(|pack| has_reading(pack))
        .map(|pack| pack.number().to_string())
        .collect();
    match numbers.as_slice() {
        [] => "no reading of a pack (BAT)".into(),
        _ => format!(
            "no reading of pack {}, but of {}",
            pack.number(),
            numbers.join(", ")
        ),
    }
}

fn is_of(record: &Record, name: &str, pack: Pack) -> bool {
    record.name() == name && record.number("Inst") == Some(f64::from(pack.instance()))
}

/// Whether a record names another pack.
fn is_of_another(record: &Record, pack: Pack) -> bool {
    let instance = record.number("Inst").or(record.number("Instance"));
    instance.is_some_and(|instance| instance != f64::from(pack.instance()))
}

fn number(record: &Record, column: &str) -> Option<f32> {
    record.number(column).map(|number| number as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::binlog::tests::opening;
    use proptest::prelude::*;
    use rover_battmon::battery::{Amount, BatteryState, ChargeState, PackStatus};
    use rover_battmon::parameter::BatteryParameter;
    use rover_battmon::recorder::dataflash::{ArmingMethod, Record as Recorded};
    use rover_battmon::time::Utc;
    use rover_battmon::vehicle::ArmState;

    fn log(records: &[Recorded]) -> Log {
        let records = records
            .iter()
            .zip(1..)
            .map(|(record, tenths)| record.encode(100_000 * tenths));
        Log::parse(&[opening(), records.flatten().collect()].concat())
    }

    fn healthy() -> BatteryState {
        BatteryState {
            status: PackStatus::Healthy,
            voltage_v: Some(48.5),
            current_a: Some(-2.5),
            temperature_c: Some(21.5),
            consumed: Some(Amount::Mah(125.0)),
            remaining_pct: Some(66.25),
            charge_state: ChargeState::Low,
            cells: CellVoltages::from_millivolts(&[3700; 13]),
            ..BatteryState::UNKNOWN
        }
    }

    fn arming(state: ArmState) -> Recorded<'static> {
        Recorded::Arm {
            state,
            enabled_checks: 1,
            forced: false,
            method: ArmingMethod::Command,
        }
    }

    #[test]
    fn a_reading_is_what_was_recorded_of_it() {
        let state = healthy();
        let records: Vec<Recorded> = Recorded::of_pack(Pack::Second, &state).collect();
        let drive = Drive::of_pack(&log(&records), Pack::Second).expect("a drive");
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
            }),
        };
        assert_eq!(drive.trace.samples, [expected]);
    }

    #[test]
    fn the_date_is_that_of_the_first_reading() {
        let state = healthy();
        let reading = Recorded::Battery(Pack::First, &state);
        // At 0.3 and 0.4 s; the first reading is at 0.1 s.
        let times = [1_795_639_396_450_000, 1_800_000_000_000_000].map(Utc::from_micros);
        let [time, later] = times.map(Recorded::Time);
        let drive = Drive::of_pack(&log(&[reading, reading, time, later]), Pack::First).expect("a drive");
        let began_utc_s = drive.began_utc_s().expect("a date");
        assert!((began_utc_s - 1_795_639_396.25).abs() < 0.001, "{began_utc_s}");
        let drive = Drive::of_pack(&log(&[reading]), Pack::First).expect("a drive");
        assert_eq!(drive.began_utc_s(), None);
    }

    #[test]
    fn what_was_unknown_is_unknown() {
        let drive = Drive::of_pack(
            &log(&[Recorded::Battery(Pack::First, &BatteryState::UNKNOWN)]),
            Pack::First,
        );
        let expected = Sample {
            time_s: 0.1,
            healthy: false,
            reported: Some(Reported::default()),
            ..Sample::NONE
        };
        assert_eq!(drive.expect("a drive").trace.samples, [expected]);
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
            let records: Vec<Recorded> = Recorded::of_pack(Pack::First, &state).collect();
            let drive = Drive::of_pack(&log(&records), Pack::First).expect("a drive");
            assert_eq!(drive.trace.samples[0].healthy, healthy, "{status:?}");
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
        let drive = Drive::of_pack(&log(&records), Pack::First).expect("a drive");
        let armed: Vec<bool> = drive.trace.samples.iter().map(|sample| sample.armed).collect();
        assert_eq!(armed, [false, true, false]);
    }

    #[test]
    fn parameters_are_the_last_of_each_and_others_are_ignored() {
        let parameter = |name, value| Recorded::Parameter {
            name,
            value,
            default: 0.0,
        };
        let state = healthy();
        let records = [
            parameter("BATT2_CAPACITY", 1000.0),
            parameter("BATT2_CAPACITY", 5200.0),
            parameter("BATT2_ARM_VOLT", f32::NAN),
            parameter("EK3_ENABLE", 1.0),
            Recorded::Battery(Pack::Second, &state),
        ];
        let drive = Drive::of_pack(&log(&records), Pack::Second).expect("a drive");
        let parameters = drive.parameters.expect("the log has some");
        let value = |parameter: BatteryParameter| parameters.get(parameter.of(Pack::Second));
        assert_eq!(value(BatteryParameter::Capacity), 5200.0);
        assert_eq!(
            value(BatteryParameter::ArmVolt),
            BatteryParameter::ArmVolt.of(Pack::Second).default_value()
        );
    }

    #[test]
    fn packs_that_are_there_are_named() {
        let state = healthy();
        let records = [
            Recorded::Battery(Pack::First, &state),
            Recorded::Battery(Pack::Third, &state),
        ];
        let error = |log: &Log| Drive::of_pack(log, Pack::Second).expect_err("no drive");
        assert_eq!(error(&log(&records)), "no reading of pack 2, but of 1, 3");
        assert_eq!(error(&log(&[])), "no reading of a pack (BAT)");
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_drive_or_none(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            let state = healthy();
            let reading = Recorded::Battery(Pack::First, &state).encode(0);
            let _ = Drive::of_pack(&Log::parse(&[opening(), reading.to_vec(), bytes].concat()), Pack::First);
        }
    }
}
