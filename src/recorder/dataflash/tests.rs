//! The bytes of records, against what Python's `struct.pack` makes of the same values.

use proptest::prelude::*;

use super::format::{FORMATS, Format, MULTIPLIERS, UNITS};
use super::*;
use crate::battery::{
    Amount, BatteryState, CellVoltages, ChargeState, Chemistry, Extremes, FailsafeLevel, FailsafeTimer,
    Faults, GaugeReport, LearntPack, MAX_CELLS, Modes, PackStatus, Readings, Reported,
};
use crate::crash::{CrashCause, CrashRecord, FaultSite, STACK_WORDS, TaskName};
use crate::memory::identity::BoardId;
use crate::pack::Pack;
use crate::time::Utc;
use crate::vehicle::ArmState;
use crate::vehicle::Mode;

const TIME_US: u64 = 0x0102_0304_0506_0708;

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn encoded(record: Record) -> String {
    hex(&record.encode(TIME_US))
}

fn opening() -> impl Iterator<Item = RecordBytes> {
    (0..).map_while(|index| opening_record(index, TIME_US))
}

fn known() -> BatteryState {
    BatteryState {
        status: PackStatus::Healthy,
        readings: Readings {
            voltage_v: Some(11.5),
            resting_voltage_v: Some(11.75),
            current_a: Some(-2.5),
            remaining_pct: Some(66.5),
            remaining_sigma_pct: Some(1.0),
            usable_pct: Some(60.25),
            faults: Faults::OVER_TEMPERATURE | Faults::CELL_FAIL,
            ..Readings::NONE
        },
        resistance_ohm: Some(0.0625),
        consumed: Some(Amount::Mah(1250.0)),
        consumed_wh: Some(14.5),
        temperature_c: Some(-12.34),
        charge_state: ChargeState::Low,
        failsafe: FailsafeLevel::Low,
        learnt_capacity_mah: Some(4750.0),
        state_of_health_pct: Some(93),
        ..BatteryState::UNKNOWN
    }
}

fn fault() -> CrashRecord {
    CrashRecord {
        task: TaskName::new("battery"),
        cause: CrashCause::Fault(FaultSite {
            pc: 0x1000_1234,
            lr: 0x1000_5679,
            xpsr: 0x6100_0000,
            stack: [0; STACK_WORDS],
        }),
        firmware: None,
    }
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

const BOARD_ID: BoardId = BoardId([0xe6, 0x60, 0x58, 0x38, 0x83, 0x45, 0x0a, 0x2c]);

const COMMAND: CommandRecord = CommandRecord {
    target: [1, 0],
    sender: [255, 190],
    frame: 3,
    number: 400,
    fields: *b"0123456789abcdefghijklmnopqr",
    result: 4,
    was_long: true,
};

/// A record of every format that is not of the opening.
fn one_of_each<'a>(
    state: &'a BatteryState,
    learnt: &'a LearntPack,
    crash: &'a CrashRecord,
) -> Vec<Record<'a>> {
    vec![
        Record::Parameter {
            name: "BATT_CAPACITY",
            value: 5200.0,
            default: 2200.0,
        },
        Record::Message("Rover"),
        Record::Event(ArmState::Armed),
        Record::Arm {
            state: ArmState::Armed,
            enabled_checks: 1,
            forced: false,
            method: ArmingMethod::Command,
        },
        Record::Mode {
            mode: Mode::Manual,
            reason: ModeReason::Command,
        },
        Record::Error(Subsystem::BatteryFailsafe),
        Record::Battery(Pack::First, state),
        Record::Cells(Pack::First, state),
        Record::MoreCells(Pack::First, state),
        Record::Estimate(Pack::First, state, Extremes::default()),
        Record::Health {
            load_permille: 0,
            dropped_records: 0,
        },
        Record::Crash(crash),
        Record::Time(Utc::from_micros(1_800_000_000_000_000)),
        Record::Board(BOARD_ID),
        Record::Pack(Pack::First, state, Some(learnt)),
        Record::Curve(Pack::First, learnt),
        Record::FailsafeTimer(Pack::First, FailsafeLevel::Low, FailsafeTimer::Running),
        Record::Report(Pack::First, &state.readings.reported),
        Record::Command(&COMMAND),
    ]
}

#[test]
// Requirement: AP-21
fn battery_has_each_field_in_its_place() {
    let state = known();
    let expected = "a3958a0807060504030201010000384100003c41000020c000409c44000068412efb0000803d43015d";
    assert_eq!(encoded(Record::Battery(Pack::Second, &state)), expected);
}

#[test]
fn unknown_values_are_ardupilots() {
    let expected = "a3958a0807060504030201000000c07f0000c07f0000c07f0000c07f0000c07f00000000c07fff0000";
    let unknown = Record::Battery(Pack::First, &BatteryState::UNKNOWN);
    assert_eq!(encoded(unknown), expected);
}

#[test]
fn estimate_has_its_bounds_and_the_extremes() {
    let state = known();
    let fields = "a3958d08070605040302010800008542000081420000894200007142007094450214000203";
    for (extremes, expected) in [
        (Extremes::default(), "0000c07f0000c07f"),
        (
            Extremes {
                lowest_voltage_v: Some(9.5),
                highest_current_a: Some(30.25),
            },
            "000018410000f241",
        ),
    ] {
        let record = encoded(Record::Estimate(Pack::Ninth, &state, extremes));
        assert_eq!(record, format!("{fields}{expected}"));
    }
}

#[test]
fn cells_beyond_the_twelfth_have_a_record_of_their_own() {
    let mut cells = [3750; 13];
    (cells[11], cells[12]) = (0, 3751);
    let state = BatteryState {
        readings: Readings {
            voltage_v: Some(52.5),
            ..Readings::NONE
        },
        cells: CellVoltages::from_millivolts(&cells),
        ..BatteryState::UNKNOWN
    };
    let twelve = "a3958b08070605040302010200005242a60ea60ea60ea60ea60ea60ea60ea60ea60ea60ea60e0100";
    assert_eq!(encoded(Record::Cells(Pack::Third, &state)), twelve);
    let thirteenth = "a3958c080706050403020102a70e000000000000";
    assert_eq!(encoded(Record::MoreCells(Pack::Third, &state)), thirteenth);
    let all = BatteryState {
        cells: CellVoltages::from_millivolts(&[3750; 16]),
        ..state
    };
    let four = "a3958c080706050403020102a60ea60ea60ea60e";
    assert_eq!(encoded(Record::MoreCells(Pack::Third, &all)), four);
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
fn a_board_is_known_by_its_serial_number() {
    let expected = "a39591080706050403020145363630353833383833343530413243";
    assert_eq!(encoded(Record::Board(BOARD_ID)), expected);
}

#[test]
fn a_pack_has_its_serial_number_and_what_was_learnt_of_it() {
    let state = BatteryState {
        serial_number: Some(-559_038_737),
        cell_count: Some(4),
        chemistry: Chemistry::LiIon,
        ..BatteryState::UNKNOWN
    };
    let pack =
        "a39592080706050403020101efbeadde03040201006038450000803c0000003d0000803c0000203f0000803d00007040";
    assert_eq!(encoded(Record::Pack(Pack::Second, &state, Some(&learnt()))), pack);
    let curve = "a3959308070605040302010170fe38ff000064005e0150005100520053005400";
    assert_eq!(encoded(Record::Curve(Pack::Second, &learnt())), curve);
}

#[test]
fn what_is_unknown_of_a_pack_is_no_number_it_could_have() {
    let nothing = "0000c07f".repeat(7);
    for learnt in [None, Some(&LearntPack::UNKNOWN)] {
        assert_eq!(
            encoded(Record::Pack(Pack::First, &BatteryState::UNKNOWN, learnt)),
            format!("a39592080706050403020100ffffffff01000000{nothing}")
        );
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
fn records_of_the_vehicle_have_each_field_in_its_place() {
    for (record, expected) in [
        (
            Record::Parameter {
                name: "BATT_CAPACITY",
                value: 5200.0,
                default: 2200.0,
            },
            "a395840807060504030201424154545f43415041434954590000000080a24500800945",
        ),
        (
            Record::Arm {
                state: ArmState::Armed,
                enabled_checks: 0x0001_0301,
                forced: true,
                method: ArmingMethod::Command,
            },
            "a39587080706050403020101010301000101",
        ),
        (
            Record::Mode {
                mode: Mode::Hold,
                reason: ModeReason::Command,
            },
            "a395880807060504030201040402",
        ),
        (
            Record::Error(Subsystem::BatteryFailsafe),
            "a3958908070605040302010601",
        ),
        (Record::Event(ArmState::Disarmed), "a3958608070605040302010b"),
        (
            Record::FailsafeTimer(Pack::Second, FailsafeLevel::Critical, FailsafeTimer::Expired),
            "a395940807060504030201010302",
        ),
        (
            Record::Report(
                Pack::Second,
                &Reported {
                    modes: Modes::BALANCING | Modes::PROTECTED,
                    gauge: GaugeReport {
                        error_pct: Some(3),
                        over_discharges: Some(4),
                        energies_wh: Some([40.0, 50.0]),
                    },
                    ..Reported::NONE
                },
            ),
            "a3959508070605040302010103040000002042000048420a",
        ),
        (
            Record::Report(Pack::First, &Reported::NONE),
            "a39595080706050403020100ffffff0000c07f0000c07f00",
        ),
        (
            Record::Health {
                load_permille: 345,
                dropped_records: 70_000,
            },
            "a3958e0807060504030201590170110100",
        ),
        (
            Record::Crash(&fault()),
            "a3958f08070605040302010134120010795600100000006162617474657279000000000000000000",
        ),
    ] {
        assert_eq!(encoded(record), expected, "{record:?}");
    }
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
fn opening_states_a_format_as_ardupilot_does() {
    let battery = opening()
        .find(|record| record[2] == 128 && record[3] == 138)
        .unwrap();
    assert_eq!(
        hex(&battery),
        "a395808a29424154005142666666666663664242420000000054696d6555532c496e73742c566f6c742c566f\
         6c74522c437572722c43757272546f742c456e7267546f742c54656d702c5265732c52656d5063742c482c53\
         48"
    );
}

/// 2026-01-01 00:00:00.123456 is week 2399 of GPS time, 345618123 ms: 18 leap seconds later.
#[test]
fn time_is_in_gps_weeks_and_neither_a_fix_nor_a_position() {
    let time = Utc::from_micros(1_767_225_600_123_456);
    assert_eq!(
        encoded(Record::Time(time)),
        "a39590080706050403020100ffcbb699145f09000f270000000000000000000000000000c07f0000c07f0000c07f0000c07f00"
    );
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
fn a_command_has_each_field_in_its_place() {
    let expected = "a395960807060504030201 0100 ffbe 03 9001 \
                    303132333435363738396162636465666768696a6b6c6d6e6f707172 04 01";
    assert_eq!(encoded(Record::Command(&COMMAND)), expected.replace(' ', ""));
}

#[test]
fn each_record_is_as_long_as_its_format_says() {
    let (state, learnt, crash) = (known(), learnt(), fault());
    let records = one_of_each(&state, &learnt, &crash);
    let records = opening().chain(records.iter().map(|record| record.encode(0)));
    let mut seen = std::collections::HashSet::new();
    for record in records {
        let format = FORMATS
            .iter()
            .find(|format| format.kind as u8 == record[2])
            .unwrap();
        assert_eq!(record.len(), format.record_bytes(), "{}", format.name);
        seen.insert(format.name);
    }
    assert_eq!(seen.len(), FORMATS.len());
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
