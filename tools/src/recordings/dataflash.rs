//! Records of ArduPilot's logs, from version 3.2 on, and of this board's, as entries.

use std::collections::{HashMap, VecDeque};
use std::io::Read;

use rover_battmon::battery::{CellVoltages, Extremes, FailsafeLevel, FailsafeTimer, LEARNT_WORDS};
use rover_battmon::pack::Pack;
use rover_battmon::recorder::dataflash::MESSAGE_BYTES;
use rover_battmon::vehicle::ArmState;

use super::binlog::{BinaryRecords, Record, Records, TextRecords};
use super::entry::{CURVE_WORDS, Content, Entry, Estimate, Part, Reported, Sample};
use super::log::{Log, Messages};

/// GPS time began with 1980-01-06, in seconds since 1970; since 2017 it is 18 leap seconds ahead of UTC.
const GPS_EPOCH_S: f64 = 315_964_800.0 - 18.0;
const WEEK_S: f64 = 7.0 * 86_400.0;
/// The week in GPS of versions up to 3.2.
const GPS_WEEK: &str = "Week";

/// BAT: a remaining charge and a state of health that are unknown.
const REMAINING_UNKNOWN_PCT: f32 = 255.0;
const HEALTH_UNKNOWN_PCT: f32 = 0.0;

/// BATX: `Stat` of a pack whose sensor has failed.
const UNHEALTHY: f64 = 4.0;

/// Cells in BCL; BCL2 has those that follow.
const FIRST_CELLS: usize = 12;
const FURTHER_CELLS: usize = 4;

/// EV: `Id` of arming, of disarming, and of events in flight: armed automatically, and not landed.
const ARMED: f64 = 10.0;
const DISARMED: f64 = 11.0;
const AIRBORNE: [f64; 2] = [15.0, 28.0];

/// ERR: numbers of the failsafes that are of no pack, with their names.
const FAILSAFES: [(f64, &str); 2] = [(5.0, "sticks"), (8.0, "ground station")];
/// ERR: number of a pack's.
const PACK_FAILSAFE: f64 = 6.0;
/// MODE: `Rsn` of a change by a pack's failsafe.
const BATTERY_FAILSAFE: f64 = 4.0;

/// ERR: a failsafe begins.
const OCCURRED: f64 = 1.0;

/// Scale of integers in CURR of versions whose logs do not state it.
const HUNDREDTHS: f64 = 0.01;

/// The records of a log.
#[derive(Default)]
pub struct DataFlash<F> {
    records: F,
    scales: Scales,
    /// A text that fills its record: it goes on in one of the same time.
    text: Option<Entry>,
}

/// Factors of integers, as far as the log states them.
#[derive(Default)]
struct Scales {
    /// MULT: factors by their letters.
    factors: HashMap<u8, f64>,
    /// FMTU: the letters of each column, by the number of the format.
    letters: HashMap<u8, Vec<u8>>,
}

/// The entries of a binary log that `source` delivers.
pub fn binary<R: Read>(source: R) -> Log<R, DataFlash<BinaryRecords>> {
    Log::of(source, DataFlash::default())
}

/// The entries of a text log that `source` delivers.
pub fn text<R: Read>(source: R) -> Log<R, DataFlash<TextRecords>> {
    Log::of(source, DataFlash::default())
}

impl<F: Records> Messages for DataFlash<F> {
    const MOST_NEEDED_BYTES: usize = F::MOST_NEEDED_BYTES;

    fn take(&mut self, bytes: &[u8], _: u64, found: &mut VecDeque<Entry>) -> Option<usize> {
        let (length, record) = self.records.first(bytes)?;
        if let Some(record) = record {
            self.scales.take(&record);
            if let Some(content) = content(&record, &self.scales) {
                let time_s = time_s(&record);
                self.push(Entry { time_s, content }, found);
            }
        }
        Some(length)
    }

    fn is_cut(&self, bytes: &[u8]) -> bool {
        self.records.is_cut(bytes)
    }

    fn finish(&mut self, found: &mut VecDeque<Entry>) {
        found.extend(self.text.take());
    }
}

impl<F> DataFlash<F> {
    fn push(&mut self, mut entry: Entry, found: &mut VecDeque<Entry>) {
        let mut is_full = false;
        if let Content::Text(part) = &mut entry.content {
            is_full = part.len() >= MESSAGE_BYTES;
            let begun = self.text.take_if(|begun| begun.time_s == entry.time_s);
            if let Some(Content::Text(begun)) = begun.map(|begun| begun.content) {
                part.insert_str(0, &begun);
            }
        }
        found.extend(self.text.take());
        match is_full {
            true => self.text = Some(entry),
            false => found.push_back(entry),
        }
    }
}

impl Scales {
    fn take(&mut self, record: &Record) {
        let of_mult = || Some((record.number("Id")? as u8, record.number("Mult")?));
        let of_format = || Some((record.number("FmtType")? as u8, record.text("MultIds")?));
        match record.name() {
            "MULT" => self.factors.extend(of_mult()),
            "FMTU" => self
                .letters
                .extend(of_format().map(|(format, letters)| (format, letters.into_bytes()))),
            _ => {}
        }
    }

    /// A voltage or a current in volts or amperes: an integer without a scale of its own is in hundredths, unless the log
    /// states another factor.
    fn scaled(&self, record: &Record, column: &str) -> Option<f64> {
        let number = record.number(column)?;
        if !record.is_unscaled_integer(column) {
            return Some(number);
        }
        let letters = self.letters.get(&record.format_number());
        let letter = letters.and_then(|letters| letters.get(record.place(column)?));
        let factor = letter.and_then(|letter| self.factors.get(letter));
        Some(number * factor.filter(|factor| **factor > 0.0).unwrap_or(&HUNDREDTHS))
    }
}

/// Seconds since the recorder started.
fn time_s(record: &Record) -> Option<f64> {
    // GPS of versions up to 3.2: its `TimeMS` is the time of the week.
    if record.place(GPS_WEEK).is_some() {
        return record.number("T").map(|time_ms| time_ms / 1e3);
    }
    let time_us = record.number("TimeUS").map(|time_us| time_us / 1e6);
    time_us.or_else(|| record.number("TimeMS").map(|time_ms| time_ms / 1e3))
}

fn content(record: &Record, scales: &Scales) -> Option<Content> {
    match record.name() {
        "PARM" => Some(Content::Parameter(record.text("Name")?, record.number("Value")?)),
        "ARM" => Some(Content::Arming(arm_state(record.number("ArmState") == Some(1.0)))),
        "EV" => event(record.number("Id")?),
        "ERR" => failsafe(record),
        "MODE" => (record.number("Rsn") == Some(BATTERY_FAILSAFE)).then_some(Content::FailsafeMode),
        "MSG" => Some(Content::Text(record.text("Message")?)),
        "BRD" => record.text("Id").filter(|id| !id.is_empty()).map(Content::Board),
        "GPS" => started_utc_s(record).map(Content::StartUtc),
        "BATX" => Some(Content::Estimate(pack_of(record)?, estimate(record))),
        "PACK" => Some(Content::Learnt(
            pack_of(record)?,
            serial_number(record),
            Box::new(learnt_words(record)),
        )),
        "FSTM" => Some(Content::FailsafeTimer(pack_of(record)?, timer(record)?)),
        "PCKO" => Some(Content::Curve(pack_of(record)?, curve(record))),
        "CURR" => reading(record, Pack::First, scales),
        "CUR2" => reading(record, Pack::Second, scales),
        "BCL" => Some(cells(record, pack_of(record).unwrap_or(Pack::First), Part::First)),
        "BCL2" if pack_of(record).is_some() => Some(cells(record, pack_of(record)?, Part::Further)),
        name => match pack_of(record) {
            Some(pack) => (name == "BAT").then(|| reading(record, pack, scales))?,
            None => without_instance(record, scales),
        },
    }
}

/// Of versions whose packs have names of records of their own: the first has no number.
fn without_instance(record: &Record, scales: &Scales) -> Option<Content> {
    let name = record.name();
    let pack = |number: &str| {
        let number = if number.is_empty() { "1" } else { number };
        let mut packs = Pack::ALL.into_iter();
        packs.find(|pack| pack.number().to_string() == number)
    };
    match name.strip_prefix("BCL") {
        Some(number) => Some(cells(record, pack(number)?, Part::First)),
        None => reading(record, pack(name.strip_prefix("BAT")?)?, scales),
    }
}

/// The pack that a record is of, by its instance.
fn pack_of(record: &Record) -> Option<Pack> {
    let instance = record.number("Inst").or(record.number("Instance"))?;
    Pack::ALL
        .into_iter()
        .find(|pack| f64::from(pack.instance()) == instance)
}

fn arm_state(is_armed: bool) -> ArmState {
    match is_armed {
        true => ArmState::Armed,
        false => ArmState::Disarmed,
    }
}

fn event(id: f64) -> Option<Content> {
    match id {
        ARMED | DISARMED => Some(Content::Arming(arm_state(id == ARMED))),
        _ => AIRBORNE.contains(&id).then_some(Content::Airborne),
    }
}

fn failsafe(record: &Record) -> Option<Content> {
    if record.number("ECode") != Some(OCCURRED) {
        return None;
    }
    let number = record.number("Subsys")?;
    if number == PACK_FAILSAFE {
        return Some(Content::PackFailsafe);
    }
    let (_, name) = FAILSAFES.iter().find(|(failsafe, _)| number == *failsafe)?;
    Some(Content::Failsafe(name))
}

/// Of a FSTM record.
fn timer(record: &Record) -> Option<(FailsafeLevel, FailsafeTimer)> {
    let levels = [FailsafeLevel::Low, FailsafeLevel::Critical];
    let timers = [
        FailsafeTimer::Stopped,
        FailsafeTimer::Running,
        FailsafeTimer::Expired,
    ];
    let [level, timer] = [record.number("FS")?, record.number("Tmr")?];
    let level = levels
        .into_iter()
        .find(|known| f64::from(*known as u8) == level)?;
    let timer = timers
        .into_iter()
        .find(|known| f64::from(*known as u8) == timer)?;
    Some((level, timer))
}

fn reading(record: &Record, pack: Pack, scales: &Scales) -> Option<Content> {
    let scaled = |column: &str| scales.scaled(record, column).map(|number| number as f32);
    let number = |column: &str| record.number(column).map(|number| number as f32);
    let sample = Sample {
        time_s: time_s(record)?,
        voltage_v: scaled("Volt"),
        current_a: scaled("Curr"),
        // Logs of ArduPilot before 4.6 do not have it.
        healthy: record.number("H") != Some(0.0),
        armed: false,
        // 0 is unknown.
        temperature_c: number("Temp").filter(|celsius| *celsius != 0.0),
        cells: CellVoltages::NONE,
        reported: Some(Reported {
            consumed_mah: number("CurrTot"),
            consumed_wh: number("EnrgTot"),
            remaining_pct: number("RemPct").filter(|pct| *pct != REMAINING_UNKNOWN_PCT),
            health_pct: number("SH").filter(|pct| *pct != HEALTH_UNKNOWN_PCT),
            charge_state: None,
            faults: None,
            extremes: None,
        }),
    };
    Some(Content::Reading(pack, Box::new(sample)))
}

fn estimate(record: &Record) -> Estimate {
    Estimate {
        // A pack that is not connected is not healthy, and its sensor works.
        is_healthy: record.number("Stat") != Some(UNHEALTHY),
        remaining_pct: record.number("SoC").map(|pct| pct as f32),
        charge_state: record.number("State").map(|state| state as u8),
        faults: record.number("Flt").map(|faults| faults as u16),
        extremes: extremes(record),
    }
}

/// `None` without their columns. A value is unknown where the board's converter did not measure.
fn extremes(record: &Record) -> Option<Extremes> {
    record.place("VMin").map(|_| Extremes {
        lowest_voltage_v: record.number("VMin").map(|volts| volts as f32),
        highest_current_a: record.number("IMax").map(|amperes| amperes as f32),
    })
}

/// A cell that does not exist is 0.
fn cells(record: &Record, pack: Pack, part: Part) -> Content {
    let places = match part {
        Part::First => 1..=FIRST_CELLS,
        Part::Further => FIRST_CELLS + 1..=FIRST_CELLS + FURTHER_CELLS,
    };
    let millivolts = places.map_while(|place| record.number(&format!("V{place}")));
    let millivolts = millivolts.take_while(|mv| *mv > 0.0).map(|mv| mv as u16);
    Content::Cells(pack, part, millivolts.collect())
}

/// What a PACK record has of it, as flash holds it; NaN is what is not learnt.
fn learnt_words(record: &Record) -> [u32; LEARNT_WORDS] {
    let whole = |name| record.number(name).unwrap_or(0.0);
    let bits = |name| {
        record
            .number(name)
            .map_or(f32::NAN, |number| number as f32)
            .to_bits()
    };
    let [drives_low, drives_high] = (whole("Drv") as u16).to_le_bytes();
    let mut words = [0; LEARNT_WORDS];
    words[0] = u32::from_le_bytes([whole("Chem") as u8, whole("Cells") as u8, drives_low, drives_high]);
    words[1] = serial_number(record).unwrap_or(-1) as u32;
    let names = ["Cap", "CapD", "Res", "Res1", "SoC", "SoCD", "RstV"];
    for (word, name) in words[2..].iter_mut().zip(names) {
        *word = bits(name);
    }
    words
}

/// Of a PACK record; negative is unknown.
fn serial_number(record: &Record) -> Option<i32> {
    Some(record.number("SN")? as i32).filter(|number| *number >= 0)
}

fn curve(record: &Record) -> [u32; CURVE_WORDS] {
    let mut words = [0; CURVE_WORDS];
    for (word, place) in words.iter_mut().zip(1..) {
        let half = |name: &str| {
            let number = record.number(&format!("{name}{place}")).unwrap_or(0.0);
            u32::from(number as i16 as u16)
        };
        *word = half("O") | half("D") << 16;
    }
    words
}

/// When the recorder started, by a GPS record. Week 0 is unknown.
fn started_utc_s(record: &Record) -> Option<f64> {
    let either = |name, older| record.number(name).or_else(|| record.number(older));
    let weeks = either("GWk", GPS_WEEK).filter(|weeks| *weeks > 0.0)?;
    let of_week_s = either("GMS", "TimeMS")? / 1e3;
    Some(GPS_EPOCH_S + weeks * WEEK_S + of_week_s - time_s(record)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recordings::binlog::field_bytes;

    /// A record of format 100 on, by its place.
    struct Recorded<'a>(&'a str, &'a [u8]);

    /// A log with these formats (name, types, columns) and records of them.
    fn log(formats: &[(&str, &str, &str)], records: &[Recorded]) -> Vec<u8> {
        let padded = |text: &str, length: usize| {
            let mut bytes = text.as_bytes().to_vec();
            bytes.resize(length, 0);
            bytes
        };
        let mut bytes = vec![];
        for ((name, types, columns), number) in formats.iter().zip(100..) {
            let content: usize = types.bytes().map(field_bytes).sum();
            bytes.extend([0xa3, 0x95, 128, number, 3 + content as u8]);
            bytes.extend([padded(name, 4), padded(types, 16), padded(columns, 64)].concat());
        }
        for Recorded(name, content) in records {
            let place = formats.iter().position(|(format, ..)| format == name);
            bytes.extend([0xa3, 0x95, 100 + place.expect("a format") as u8]);
            bytes.extend(*content);
        }
        bytes
    }

    fn entries(bytes: &[u8]) -> Vec<Content> {
        let entries = binary(bytes).map(|entry| entry.expect("it is readable"));
        entries.map(|entry| entry.content).collect()
    }

    const EVENT: (&str, &str, &str) = ("EV", "QB", "TimeUS,Id");
    const TIME: [u8; 8] = 2_000_000_u64.to_le_bytes();

    #[test]
    fn integers_are_hundredths_unless_the_log_states_another_factor() {
        let current = ("CURR", "Ihh", "TimeMS,Volt,Curr");
        let units = ("FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds");
        let factor = ("MULT", "Qbd", "TimeUS,Id,Mult");
        let letters = |text: &[u8]| {
            let mut letters = [0; 16];
            letters[..text.len()].copy_from_slice(text);
            letters
        };
        let reading = [
            &2000_u32.to_le_bytes()[..],
            &1234_i16.to_le_bytes(),
            &(-50_i16).to_le_bytes(),
        ]
        .concat();
        let unit = [&TIME[..], &[100], &letters(b"svA"), &letters(b"CBA")].concat();
        let milli = [&TIME[..], b"B", &0.001_f64.to_le_bytes()].concat();
        let tenths = [&TIME[..], b"A", &0.1_f64.to_le_bytes()].concat();
        for (records, expected) in [
            (vec![Recorded("CURR", &reading)], (12.34, -0.5)),
            (
                vec![
                    Recorded("FMTU", &unit),
                    Recorded("MULT", &milli),
                    Recorded("MULT", &tenths),
                    Recorded("CURR", &reading),
                ],
                (1.234, -5.0),
            ),
        ] {
            let bytes = log(&[current, units, factor], &records);
            let [Content::Reading(Pack::First, sample)] = &entries(&bytes)[..] else {
                panic!("{:?}", entries(&bytes));
            };
            assert_eq!(sample.time_s, 2.0);
            assert_eq!(sample.voltage_v.zip(sample.current_a), Some(expected));
        }
    }

    #[test]
    fn a_record_without_an_instance_is_of_the_pack_that_its_name_ends_with() {
        let reading = [&TIME[..], &11.5_f32.to_le_bytes()].concat();
        for (name, pack) in [
            ("BAT", Some(Pack::First)),
            ("BAT2", Some(Pack::Second)),
            ("CUR2", Some(Pack::Second)),
            ("BATT", None),
        ] {
            let bytes = log(&[(name, "Qf", "TimeUS,Volt")], &[Recorded(name, &reading)]);
            let found = entries(&bytes);
            assert_eq!(found.len(), usize::from(pack.is_some()), "{name}");
            if let Some(Content::Reading(found, sample)) = found.first() {
                assert_eq!(Some(*found), pack);
                assert_eq!((sample.voltage_v, sample.current_a), (Some(11.5), None));
            }
        }
    }

    #[test]
    fn a_text_that_fills_its_record_goes_on_in_the_next_of_the_same_time() {
        let long = "Battery 1 reports: bad battery, needs service, switched off by its protection";
        let (first, second) = long.split_at(64);
        let full = "x".repeat(64);
        let later: [u8; 8] = 2_000_001_u64.to_le_bytes();
        let message = |time: [u8; 8], text: &str| {
            let mut text = text.as_bytes().to_vec();
            text.resize(64, 0);
            [&time[..], &text].concat()
        };
        let event = [&TIME[..], &[10]].concat();
        for (records, expected) in [
            (
                vec![message(TIME, first), message(TIME, second)],
                vec![long.into()],
            ),
            (
                vec![message(TIME, "one"), message(TIME, "two")],
                vec!["one".into(), "two".into()],
            ),
            // One that ends with its record has an empty one behind it.
            (
                vec![message(TIME, &full), message(TIME, ""), message(TIME, "two")],
                vec![full.clone(), "two".into()],
            ),
            (
                vec![message(TIME, &full), message(TIME, &full), message(TIME, "y")],
                vec![format!("{full}{full}y")],
            ),
            (
                vec![message(TIME, &full), message(later, "two")],
                vec![full.clone(), "two".into()],
            ),
            (vec![message(TIME, &full)], vec![full.clone()]),
            (
                vec![message(TIME, &full), event.clone()],
                vec![full.clone(), "armed".into()],
            ),
        ] {
            let of_record = |bytes: &Vec<u8>| if bytes.len() > 9 { "MSG" } else { "EV" };
            let records: Vec<_> = records
                .iter()
                .map(|bytes| Recorded(of_record(bytes), bytes))
                .collect();
            let bytes = log(&[EVENT, ("MSG", "QZ", "TimeUS,Message")], &records);
            let found = entries(&bytes).into_iter().map(|content| match content {
                Content::Text(text) => text,
                Content::Arming(_) => "armed".to_string(),
                other => panic!("{other:?}"),
            });
            let expected: Vec<String> = expected;
            assert_eq!(found.collect::<Vec<_>>(), expected);
        }
    }

    #[test]
    fn events_of_arming_and_of_a_flight_are_known_by_their_numbers() {
        let found = |id: u8| entries(&log(&[EVENT], &[Recorded("EV", &[&TIME[..], &[id]].concat())])).pop();
        assert_eq!(found(10), Some(Content::Arming(ArmState::Armed)));
        assert_eq!(found(11), Some(Content::Arming(ArmState::Disarmed)));
        assert_eq!([15, 28].map(found), [const { Some(Content::Airborne) }; 2]);
        assert_eq!(found(18), None);
    }
}
