//! Records at their ends; `tests/host/dataflash.rs` has their fields read by a parser.

use proptest::prelude::*;

use super::format::{FORMATS, Format, MULTIPLIERS, UNITS};
use super::*;
use crate::battery::{Amount, BatteryState, CellVoltages, Extremes, LearntPack, MAX_CELLS, Readings};
use crate::crash::{CrashCause, CrashRecord};
use crate::pack::Pack;
use crate::time::Utc;

const TIME_US: u64 = 0x0102_0304_0506_0708;

fn opening() -> impl Iterator<Item = RecordBytes> {
    (0..).map_while(|index| opening_record(index, TIME_US))
}

/// What is learnt of a pack, but for the curve of its cells.
const WITHOUT_CURVE: &str = "\
chemistry 3
cells 3
drives 258
capacity_mah_sigma 2950 0.015625
resistance_ohm_now_first 0.03125 0.015625
charge_sigma_resting_v 0.625 0.0625 3.75
";

fn learnt() -> LearntPack {
    let curve = "offsets_100uv_sigma -400 80 -200 81 0 82 100 83 350 84";
    format!("{WITHOUT_CURVE}{curve}").parse().unwrap()
}

#[test]
fn cells_are_recorded_where_they_are_measured() {
    for (cells, records) in [(0, 2), (1, 3), (12, 3), (13, 4), (16, 4), (22, 4)] {
        let state = BatteryState {
            cells: CellVoltages::from_millivolts(&vec![3750; cells]),
            ..BatteryState::UNKNOWN
        };
        let count = Record::of_pack(Pack::First, &state, Extremes::default()).count();
        assert_eq!(count, records, "{cells} cells");
    }
}

#[test]
fn cells_that_are_not_detected_yet_are_those_of_what_was_learnt() {
    let bytes = Record::Pack(Pack::First, &BatteryState::UNKNOWN, Some(&learnt())).encode(0);
    assert_eq!(bytes[17], 3);
}

#[test]
fn a_curve_is_learnt_if_one_of_its_deviations_is_known() {
    let without: LearntPack = WITHOUT_CURVE.parse().unwrap();
    assert_eq!((without.has_curve(), learnt().has_curve()), (false, true));
}

#[test]
fn a_crash_without_a_fault_has_no_registers() {
    for (cause, number) in [(CrashCause::Overdue, 2), (CrashCause::Hung, 3)] {
        let crash = CrashRecord {
            task: None,
            cause,
            firmware: None,
        };
        let bytes = Record::Crash(&crash).encode(TIME_US);
        assert_eq!(bytes[11], number);
        assert!(bytes[12..].iter().all(|byte| *byte == 0));
    }
}

#[test]
fn a_long_text_is_cut() {
    let text = "x".repeat(65);
    let bytes = Record::Message(&text).encode(TIME_US);
    assert_eq!(bytes.len(), 3 + 8 + 64);
    assert!(bytes[11..].iter().all(|byte| *byte == b'x'));
}

#[test]
fn any_time_has_a_record() {
    for time_us in [0, 315_964_800_000_000, u64::MAX] {
        assert_eq!(Record::Time(Utc::from_micros(time_us)).encode(0).len(), 51);
    }
}

#[test]
fn a_file_says_everything_about_its_formats_once() {
    let kinds: Vec<u8> = opening().map(|record| record[2]).collect();
    let expected = [
        (128, FORMATS.len()),
        (129, UNITS.len()),
        (130, MULTIPLIERS.len()),
        (131, FORMATS.len()),
    ];
    let expected: Vec<u8> = expected
        .iter()
        .flat_map(|(kind, count)| vec![*kind; *count])
        .collect();
    assert_eq!(kinds, expected);
    assert_eq!(opening_record(usize::MAX, 0), None);
}

#[test]
fn rows_of_the_table_are_consistent() {
    let mut numbers = std::collections::HashSet::new();
    let mut names = std::collections::HashSet::new();
    for Format {
        kind,
        name,
        types,
        columns,
        units,
        multipliers,
    } in FORMATS
    {
        assert!(numbers.insert(kind as u8), "{name}: number twice");
        assert!(names.insert(name), "{name} twice");
        // A field of a FMT record that is full has no 0 at its end.
        assert!(
            name.len() <= 4 && types.len() <= 16 && columns.len() <= 64,
            "{name}"
        );
        assert_eq!(columns.split(',').count(), types.len(), "{name}");
        assert_eq!(
            (units.len(), multipliers.len()),
            (types.len(), types.len()),
            "{name}"
        );
    }
}

#[test]
fn units_and_multipliers_are_those_in_use() {
    let used = |characters: fn(&Format) -> &'static str| -> std::collections::BTreeSet<u8> {
        FORMATS
            .iter()
            .flat_map(|format| characters(format).bytes())
            .collect()
    };
    let units = UNITS.iter().map(|(unit, _)| *unit).collect();
    let multipliers = MULTIPLIERS.iter().map(|(multiplier, _)| *multiplier).collect();
    assert_eq!(used(|format| format.units), units);
    assert_eq!(used(|format| format.multipliers), multipliers);
}

/// Temperature and remaining charge in a BAT record.
fn temperature_and_remaining(temperature_c: f32, remaining_pct: f32) -> (i16, u8) {
    let state = BatteryState {
        temperature_c: Some(temperature_c),
        readings: Readings {
            remaining_pct: Some(remaining_pct),
            ..Readings::NONE
        },
        ..BatteryState::UNKNOWN
    };
    let bytes = Record::Battery(Pack::First, &state).encode(0);
    (i16::from_le_bytes([bytes[32], bytes[33]]), bytes[38])
}

#[test]
fn whole_numbers_saturate_and_never_read_as_unknown() {
    assert_eq!(temperature_and_remaining(0.004, -3.0), (1, 0));
    assert_eq!(temperature_and_remaining(1e9, 1e9), (i16::MAX, 100));
    assert_eq!(temperature_and_remaining(-1e9, 99.6), (-i16::MAX, 100));
    assert_eq!(temperature_and_remaining(f32::NAN, f32::NAN), (0, 255));
}

proptest! {
    #[test]
    fn any_state_of_a_pack_has_records(
        numbers in prop::array::uniform10(any::<u32>()),
        cells in prop::collection::vec(any::<u16>(), 0..=MAX_CELLS),
        instance in 0u8..9,
    ) {
        let [a, b, c, d, e, f, g, h, i, j] = numbers.map(|bits| Some(f32::from_bits(bits)));
        let mut state = BatteryState::UNKNOWN;
        state.readings.voltage_v = a;
        state.readings.resting_voltage_v = b;
        state.readings.current_a = c;
        state.consumed = d.map(Amount::Mah);
        state.consumed_wh = e;
        state.temperature_c = f;
        state.resistance_ohm = g;
        state.readings.remaining_pct = h;
        state.readings.remaining_sigma_pct = i;
        state.readings.usable_pct = j;
        state.cells = CellVoltages::from_millivolts(&cells);
        let pack = Pack::from_instance(instance).unwrap();
        for record in Record::of_pack(pack, &state, Extremes::default()) {
            let bytes = record.encode(0);
            let format = FORMATS.iter().find(|format| format.kind as u8 == bytes[2]).unwrap();
            prop_assert_eq!(bytes.len(), format.record_bytes());
            prop_assert_eq!(bytes[11], instance);
            // Infinity fits on no axis: what is not a number is NaN.
            let first_number = f32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]);
            prop_assert!(format.name == "BCL2" || !first_number.is_infinite());
        }
    }

    #[test]
    fn whatever_flash_may_hold_of_a_pack_has_records(
        words in prop::array::uniform::<_, { crate::battery::LEARNT_WORDS }>(any::<u32>()),
        chemistry in 1u32..=4,
        serial_number: Option<i32>,
    ) {
        let mut words = words;
        words[0] = words[0] & !0xff | chemistry;
        let learnt = LearntPack::from_words(&words).expect("a chemistry");
        let state = BatteryState { serial_number, ..BatteryState::UNKNOWN };
        let pack = Record::Pack(Pack::First, &state, Some(&learnt)).encode(0);
        let curve = Record::Curve(Pack::First, &learnt).encode(0);
        // They leave together.
        prop_assert!(pack.len() + curve.len() <= MAX_RECORD_BYTES);
        prop_assert_eq!(pack[12..16].to_vec(), serial_number.unwrap_or(-1).to_le_bytes());
        prop_assert_eq!(pack[18..20].to_vec(), words[0].to_le_bytes()[2..].to_vec());
        prop_assert_eq!(learnt.has_curve(), curve[22..].iter().any(|byte| *byte != 0));
    }

    #[test]
    fn any_text_has_a_record(text: String) {
        let parameter = Record::Parameter { name: &text, value: 0.0, default: 0.0 };
        prop_assert_eq!(parameter.encode(0).len(), 35);
        prop_assert_eq!(Record::Message(&text).encode(0).len(), 75);
    }
}
