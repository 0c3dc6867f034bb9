//! The rows of one log: a log of any length takes the same memory.

use std::io;

use rover_battmon::pack::Pack;
use rover_battmon::vehicle::ArmState;
use rover_battmon_tools::recordings::entry::{Content, Entries, Entry, Sample};

use super::pack_drives::{End, PackDrives};
use super::row::Row;
use crate::assignments::{Assignment, LogParameters};
use crate::failsafes::announced;
use crate::readings::Readings;
use crate::survey::{ArmedBefore, Survey};

/// Drives of a pack in a log. The board's log has some hundred at most: each takes the seconds in which it is recorded.
const MOST_DRIVES: usize = 10_000;

/// The drives in a log.
pub struct Drives {
    /// A row for each of a pack.
    pub rows: Vec<Row>,
    /// Readings that are earlier than the one before of the same pack, or were skipped for that.
    pub backward_steps: usize,
    /// A line about steps of the recorder's clock, if there are any.
    pub clock_text: Option<String>,
}

impl Drives {
    /// The drives in a log that can be opened twice.
    ///
    /// # Errors
    /// Why there is none, in words.
    pub fn read<'a>(
        path: &str,
        open: impl Fn() -> io::Result<Box<dyn Entries + 'a>>,
        what_if: &[Assignment],
    ) -> Result<Self, String> {
        let in_words = |error: io::Error| error.to_string();
        let survey = open().and_then(Survey::of).map_err(in_words)?;
        if let Some(obstacle) = survey.obstacle() {
            return Err(obstacle.into());
        }
        let packs = Pack::ALL
            .into_iter()
            .filter_map(|pack| PackDrives::new(path, &survey, pack, what_if));
        let mut log = Log {
            packs: packs.collect::<Result<_, _>>()?,
            readings: Readings::beginning(survey.initial_arm_state()),
            parameters: LogParameters::default(),
            arm_state: survey.initial_arm_state(),
            armed_before: survey.armed_before(),
            latest_s: 0.0,
        };
        let mut entries = open().map_err(in_words)?;
        while let Some(entry) = entries.next() {
            let entry = entry.map_err(in_words)?;
            log.add(&entry, entries.bytes().skipped);
            if log.packs.iter().any(|pack| pack.count() > MOST_DRIVES) {
                return Err(format!("more than {MOST_DRIVES} drives"));
            }
        }
        let drives = log.finish(entries.bytes().skipped);
        Ok(Self {
            backward_steps: drives.backward_steps + survey.stepped_back as usize,
            clock_text: survey.clock_text(),
            ..drives
        })
    }
}

struct Log {
    packs: Vec<PackDrives>,
    readings: Readings,
    parameters: LogParameters,
    arm_state: ArmState,
    /// Why it is armed at the beginning; `None` from the first reading on.
    armed_before: Option<ArmedBefore>,
    latest_s: f64,
}

impl Log {
    /// Takes an entry, before which this much of the file was damaged.
    fn add(&mut self, entry: &Entry, skipped_bytes: u64) {
        self.latest_s = entry.time_s.unwrap_or(self.latest_s);
        if matches!(entry.content, Content::Reading(..)) {
            self.begin();
        }
        let packs = &mut self.packs;
        self.readings
            .add(entry, |pack, sample| give(packs, pack, &sample));
        match &entry.content {
            Content::Arming(state) | Content::ArmState(state) if *state == self.arm_state => {}
            Content::Arming(ArmState::Armed) | Content::ArmState(ArmState::Armed) => {
                self.arm_state = ArmState::Armed;
                self.each(|drives, time_s| drives.arm(time_s));
            }
            Content::Arming(ArmState::Disarmed) | Content::ArmState(ArmState::Disarmed) => {
                self.arm_state = ArmState::Disarmed;
                let end = self.end(skipped_bytes);
                self.each(|drives, time_s| drives.disarm(time_s, end));
            }
            Content::Parameter(name, value) => self.parameter(name, *value),
            Content::Learnt(pack, Some(number), _) => {
                if let Some(drives) = find(packs, *pack) {
                    drives.identify(*number);
                }
            }
            Content::Failsafe(name) => self.each(|drives, time_s| drives.failsafe(name, time_s)),
            Content::FailsafeTimer(pack, change) => {
                if let Some(drives) = find(packs, *pack) {
                    drives.timer(self.latest_s, *change);
                }
            }
            Content::PackFailsafe => self.each(PackDrives::unnamed_failsafe),
            Content::Text(text) => self.text(text),
            _ => {}
        }
    }

    /// A log that begins armed begins a drive with its first reading.
    fn begin(&mut self) {
        if self.armed_before.take().is_some() {
            self.each(|drives, time_s| drives.arm(time_s));
        }
    }

    fn parameter(&mut self, name: &str, value: f64) {
        let Some((id, value)) = self.parameters.changed_value(name, value) else {
            return;
        };
        let packs = &mut self.packs;
        self.readings.finish(|pack, sample| give(packs, pack, &sample));
        for drives in packs {
            drives.set(Assignment { id, value });
        }
    }

    /// Whether nothing was lost so far, and time has gone on.
    fn end(&self, skipped_bytes: u64) -> End {
        match (skipped_bytes, self.readings.backward_steps()) {
            (0, 0) => End::Whole,
            _ => End::Damaged,
        }
    }

    fn each(&mut self, mut act: impl FnMut(&mut PackDrives, f64)) {
        let time_s = self.latest_s;
        for drives in &mut self.packs {
            act(drives, time_s);
        }
    }

    fn text(&mut self, text: &str) {
        let refusal = text.strip_prefix("PreArm: ").or(text.strip_prefix("Arm: "));
        self.each(|drives, time_s| {
            let prefix = format!("Battery {} ", drives.number());
            if let Some(reason) = refusal {
                // One of another pack is in the rows of that pack.
                if !reason.starts_with("Battery ") || reason.starts_with(&prefix) {
                    drives.refusal(reason);
                }
            } else if let Some((_, level)) =
                announced(text).filter(|(pack, _)| pack.number() == drives.number())
            {
                drives.reach(level, time_s);
            }
        });
    }

    fn finish(mut self, skipped_bytes: u64) -> Drives {
        let end = self.end(skipped_bytes);
        let backward_steps = self.readings.backward_steps();
        let Self { packs, readings, .. } = &mut self;
        readings.finish(|pack, sample| give(packs, pack, &sample));
        let rows = self
            .packs
            .into_iter()
            .flat_map(|drives| drives.finish(self.latest_s, end));
        let mut rows: Vec<Row> = rows.collect();
        // Room for more would be a multiple of the one row that most logs have.
        rows.shrink_to_fit();
        Drives {
            rows,
            backward_steps,
            clock_text: None,
        }
    }
}

fn give(packs: &mut [PackDrives], pack: Pack, sample: &Sample) {
    if let Some(drives) = find(packs, pack) {
        drives.add(sample);
    }
}

fn find(packs: &mut [PackDrives], pack: Pack) -> Option<&mut PackDrives> {
    packs.iter_mut().find(|drives| drives.number() == pack.number())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::tests::{arming, opening, parameter};
    use crate::table::row::Remaining;
    use proptest::prelude::*;
    use rover_battmon::battery::{
        BatteryState, Extremes, FailsafeLevel, FailsafeTimer, Faults, PackStatus, Readings,
    };
    use rover_battmon::recorder::dataflash::{Record as Recorded, Subsystem};
    use rover_battmon::vehicle::ArmState;
    use rover_battmon_tools::recordings::dataflash;

    fn state(voltage_v: f32) -> BatteryState {
        BatteryState {
            status: PackStatus::Healthy,
            readings: Readings {
                voltage_v: Some(voltage_v),
                current_a: Some(5.0),
                ..Readings::NONE
            },
            ..BatteryState::UNKNOWN
        }
    }

    /// A file with a record a second.
    fn file(records: &[Recorded]) -> Vec<u8> {
        let records = records.iter().zip(1..);
        let records = records.flat_map(|(record, second)| record.encode(1_000_000 * second));
        opening().into_iter().chain(records).collect()
    }

    fn drives_in(bytes: &[u8], what_if: &[Assignment]) -> Result<Drives, String> {
        Drives::read("log", || Ok(Box::new(dataflash::binary(bytes))), what_if)
    }

    fn rows_of(records: &[Recorded]) -> Vec<Row> {
        drives_in(&file(records), &[]).expect("drives").rows
    }

    fn rows_if(what_if: &str, records: &[Recorded]) -> Vec<Row> {
        let what_if: [Assignment; 1] = [what_if.parse().expect("an assignment")];
        drives_in(&file(records), &what_if).expect("drives").rows
    }

    fn reading(state: &BatteryState) -> Recorded<'_> {
        Recorded::Battery(Pack::First, state)
    }

    /// The rover is armed with a threshold of the low voltage.
    fn armed() -> Vec<Recorded<'static>> {
        vec![parameter("BATT_LOW_VOLT", 10.5), arming(ArmState::Armed)]
    }

    #[test]
    fn each_drive_is_a_row_from_arming_to_disarming() {
        let state = state(11.0);
        let reading = reading(&state);
        let rows = rows_of(&[
            Recorded::Message("PreArm: Battery 1 below minimum arming voltage"),
            Recorded::Message("PreArm: Battery 1 below minimum arming voltage"),
            Recorded::Message("PreArm: Battery 2 unhealthy"),
            Recorded::Message("Arm: Throttle (RC3) is not neutral"),
            arming(ArmState::Armed),
            reading,
            Recorded::Message("Battery 1 is low 10.40V used 300 mAh"),
            Recorded::Error(Subsystem::BatteryFailsafe),
            Recorded::Error(Subsystem::GroundStationFailsafe),
            Recorded::Message("Battery 2 is critical 6.40V used 300 mAh"),
            arming(ArmState::Disarmed),
            reading,
            arming(ArmState::Armed),
            reading,
            reading,
        ]);
        let seen: Vec<_> = rows
            .iter()
            .map(|row| (row.start_s, row.duration_s, row.complete))
            .collect();
        assert_eq!(seen, [(5.0, 6.0, true), (13.0, 2.0, false)]);
        assert_eq!(
            rows[0].arming_refusals,
            [
                "Battery 1 below minimum arming voltage",
                "Throttle (RC3) is not neutral"
            ]
        );
        assert_eq!(rows[0].failsafes, ["low 2 s", "ground station 4 s"]);
        assert!(rows[1].arming_refusals.is_empty() && rows[1].failsafes.is_empty());
    }

    #[test]
    fn what_is_refused_after_the_last_drive_is_in_its_row() {
        let rows = rows_of(&[
            arming(ArmState::Armed),
            reading(&state(11.0)),
            arming(ArmState::Disarmed),
            Recorded::Message("Arm: Terminated: reset the battery or restart"),
        ]);
        assert_eq!(
            rows[0].arming_refusals,
            ["Terminated: reset the battery or restart"]
        );
        assert_eq!(rows.len(), 1);
    }

    #[test]
    fn a_log_without_a_drive_has_a_row_for_each_pack() {
        let state = state(11.0);
        let mut faulty = state;
        faulty.readings.faults = Faults::DEEP_DISCHARGE | Faults::OVER_CURRENT;
        let rows = rows_of(&[
            reading(&state),
            Recorded::Battery(Pack::Third, &state),
            Recorded::Estimate(Pack::Third, &faulty, Extremes::default()),
            reading(&state),
            Recorded::Message("PreArm: Logging failed"),
        ]);
        let seen: Vec<_> = rows
            .iter()
            .map(|row| (row.pack, row.duration_s, row.complete))
            .collect();
        assert_eq!(seen, [(1, 3.0, true), (3, 0.0, true)]);
        assert_eq!(rows[1].faults, Faults::DEEP_DISCHARGE | Faults::OVER_CURRENT);
        assert_eq!(rows[0].arming_refusals, ["Logging failed"]);
    }

    #[test]
    fn other_parameters_are_tried_beside_those_of_the_log() {
        let [before, after] = [state(11.0), state(10.6)];
        let mut records = armed();
        records.extend([reading(&before); 20]);
        records.extend([reading(&after); 20]);
        let own = rows_of(&records);
        assert_eq!((own[0].levels.low_s, &own[0].what_if), (None, &None));
        let changed = rows_if("BATT_LOW_VOLT=10.7", &records);
        let what_if = changed[0].what_if.as_ref().expect("it was asked for");
        assert_eq!(what_if.parameters, "BATT_LOW_VOLT=10.7");
        let low_s = what_if.levels.low_s.expect("it is low");
        // The voltage falls 21 s after arming, and has to be low for ten seconds.
        assert!((30.0..=32.0).contains(&low_s), "{low_s}");
        assert_eq!(changed[0].levels.low_s, None);
    }

    #[test]
    fn a_failsafe_of_the_log_at_another_time_than_replayed_is_named() {
        let state = state(10.4);
        let readings = |count| vec![reading(&state); count];
        let low = Recorded::Message("Battery 1 is low 10.40V used 300 mAh");
        let differences = |before: usize, after: usize| {
            let records = [armed(), readings(before), vec![low], readings(after)];
            rows_of(&records.concat()).remove(0).differences
        };
        // The default of ten seconds is over with the second reading behind it.
        assert!(differences(11, 10).is_empty());
        assert_eq!(differences(20, 1), ["low recorded 21 s, replayed 12 s"]);
        assert_eq!(differences(2, 1), ["low recorded 3 s, replayed never"]);
    }

    #[test]
    fn timers_and_levels_are_those_of_the_log_if_it_has_them() {
        let [low, high] = [state(10.4), state(11.0)];
        let timer = |timer| Recorded::FailsafeTimer(Pack::First, FailsafeLevel::Low, timer);
        let rows = |trip: &[Recorded]| {
            let records = [
                &armed()[..],
                &[timer(FailsafeTimer::Running)],
                &[reading(&low); 5],
                &[timer(FailsafeTimer::Stopped)],
                // By the few readings low for long enough.
                &[reading(&low); 15],
                trip,
                &[reading(&high); 5],
            ];
            rows_if("BATT_LOW_TIMER=8", &records.concat()).remove(0)
        };
        let row = rows(&[timer(FailsafeTimer::Expired)]);
        let timers = ["low started 1 s", "low reset 7 s", "low tripped 23 s"];
        assert_eq!(
            (&row.timers[..], &row.recorded_timers[..]),
            (&timers.map(String::from)[..], &row.timers[..])
        );
        assert_eq!((row.levels.low_s, row.differences.len()), (Some(23.0), 0));
        let what_if_low_s = row.what_if.expect("it was asked for").levels.low_s;
        assert_eq!(what_if_low_s, Some(11.0), "replayed");
        assert_eq!(rows(&[]).levels.low_s, None);
    }

    #[test]
    fn parameters_that_are_set_after_a_drive_do_not_rewrite_it() {
        let state = state(10.4);
        let reading = reading(&state);
        let mut records = vec![parameter("BATT_CELLS", 3.0)];
        records.extend(armed());
        records.extend([reading; 20]);
        records.push(arming(ArmState::Disarmed));
        let whole = rows_if("BATT_CRT_VOLT=10.45", &records);
        records.extend([
            parameter("BATT_LOW_VOLT", 0.0),
            parameter("BATT_CELLS", 6.0),
            reading,
        ]);
        let rows = rows_if("BATT_CRT_VOLT=10.45", &records);
        assert!(rows[0].levels.low_s.is_some());
        assert_eq!(rows, whole);
    }

    #[test]
    fn a_log_that_begins_armed_begins_a_drive_with_its_first_reading() {
        let state = state(11.0);
        let reading = reading(&state);
        let rows = rows_of(&[
            parameter("BATT_LOW_VOLT", 10.5),
            reading,
            reading,
            arming(ArmState::Disarmed),
            reading,
            arming(ArmState::Armed),
            reading,
        ]);
        let seen: Vec<_> = rows
            .iter()
            .map(|row| (row.start_s, row.duration_s, row.complete, row.armed_before))
            .collect();
        let inferred = Some(ArmedBefore::FirstIsDisarming);
        assert_eq!(seen, [(2.0, 2.0, true, inferred), (6.0, 1.0, false, None)]);
    }

    #[test]
    fn a_failsafe_without_a_text_has_no_level() {
        let rows = rows_of(&[
            arming(ArmState::Armed),
            reading(&state(11.0)),
            Recorded::Error(Subsystem::BatteryFailsafe),
        ]);
        assert_eq!(rows[0].failsafes, ["battery 2 s"]);
    }

    #[test]
    fn remaining_charge_is_that_of_the_moment() {
        let [before, after] = [(11.0, 60.0), (10.4, 20.0)].map(|(voltage_v, remaining_pct)| {
            let mut state = state(voltage_v);
            state.readings.remaining_pct = Some(remaining_pct);
            state
        });
        let mut records = armed();
        records.extend([reading(&before); 5]);
        records.extend([reading(&after); 30]);
        let row = rows_of(&records).remove(0);
        assert_eq!(row.remaining.recorded_pct, Some(20.0));
        assert_eq!(row.remaining_low.recorded_pct, Some(20.0));
        assert_eq!(row.remaining_critical, Remaining::default());
    }

    /// Two drives of two packs, with all that a board records of them.
    fn drives() -> Vec<u8> {
        let state = state(11.0);
        let mut records = vec![parameter("BATT_LOW_VOLT", 10.5)];
        for _ in 0..2 {
            records.push(arming(ArmState::Armed));
            for _ in 0..10 {
                records.extend([Pack::First, Pack::Second].map(|pack| Recorded::Battery(pack, &state)));
                records.push(Recorded::Estimate(Pack::First, &state, Extremes::default()));
            }
            records.push(Recorded::Message("Battery 1 is low 10.40V used 300 mAh"));
            records.push(arming(ArmState::Disarmed));
            records.push(reading(&state));
        }
        file(&records)
    }

    #[test]
    fn damage_makes_the_drives_behind_it_incomplete() {
        let one = drives();
        let damaged = [&one, &[0xff; 5][..], &one[opening().len()..]].concat();
        let rows = drives_in(&damaged, &[]).expect("drives").rows;
        let complete: Vec<bool> = rows.iter().map(|row| row.complete).collect();
        // Of each of two packs.
        assert_eq!(complete, [true, true, false, false].repeat(2));
    }

    proptest! {
        #[test]
        fn any_bytes_have_rows_or_a_reason(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            let _ = drives_in(&bytes, &[]);
            let after = [drives(), bytes].concat();
            prop_assert!(drives_in(&after, &[]).is_ok());
        }

        #[test]
        fn what_is_complete_in_a_cut_log_is_as_in_the_whole_one(cut in 1usize..4000) {
            let whole = drives();
            let all = drives_in(&whole, &[]).expect("drives").rows;
            let cut = &whole[..whole.len().saturating_sub(cut)];
            let Ok(Drives { rows, .. }) = drives_in(cut, &[]) else {
                return Ok(());
            };
            for row in rows.iter().filter(|row| row.complete) {
                prop_assert!(all.contains(row), "{:?}", row);
            }
            let incomplete = rows.iter().filter(|row| !row.complete);
            prop_assert!(incomplete.count() <= 2, "{:?}", rows);
        }
    }
}
