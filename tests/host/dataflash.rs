//! A log file, read by a parser that is not of this project.

use std::path::Path;

use ardupilot_binlog::{Entry, Reader};
use rover_battmon::battery::{
    Amount, BatteryState, CellVoltages, ChargeState, Extremes, FailsafeLevel, FailsafeTimer, Faults,
    GaugeReport, LearntPack, Modes, PackStatus, Readings, Reported,
};
use rover_battmon::crash::{CrashCause, CrashRecord, FaultSite, STACK_WORDS, TaskName};
use rover_battmon::memory::identity::BoardId;
use rover_battmon::pack::Pack;
use rover_battmon::recorder::dataflash::{
    ArmingMethod, CommandRecord, ModeReason, Record, Subsystem, opening_record,
};
use rover_battmon::time::Utc;
use rover_battmon::vehicle::ArmState;
use rover_battmon::vehicle::Mode;

const START_US: u64 = 1_500_000;

/// A file with a record of every format, all but the opening a millisecond apart.
fn file() -> Vec<u8> {
    let mut cells = [3711; 13];
    // 0 would be that there is no cell.
    cells[11] = 0;
    let state = BatteryState {
        status: PackStatus::Healthy,
        readings: Readings {
            voltage_v: Some(48.25),
            resting_voltage_v: Some(48.5),
            current_a: Some(3.5),
            remaining_pct: Some(66.5),
            remaining_sigma_pct: Some(1.0),
            usable_pct: Some(60.25),
            faults: Faults::OVER_CURRENT,
            ..Readings::NONE
        },
        resistance_ohm: Some(0.0625),
        consumed: Some(Amount::Mah(1250.0)),
        consumed_wh: Some(14.5),
        temperature_c: Some(-12.34),
        charge_state: ChargeState::Low,
        failsafe: FailsafeLevel::Low,
        state_of_health_pct: Some(93),
        cells: CellVoltages::from_millivolts(&cells),
        learnt_capacity_mah: Some(4750.0),
        serial_number: Some(4711),
        cell_count: Some(13),
        ..BatteryState::UNKNOWN
    };
    let learnt: LearntPack = "chemistry 1\ncells 13\ndrives 7\n\
        capacity_mah_sigma 4750 0.25\nresistance_ohm_now_first 0.5 0.25\n\
        charge_sigma_resting_v 0.625 0.0625 3.75\n\
        offsets_100uv_sigma -400 80 -200 81 0 82 100 83 350 84"
        .parse()
        .expect("a pack");
    let crash = CrashRecord {
        task: TaskName::new("battery"),
        cause: CrashCause::Fault(FaultSite {
            pc: 0x1000_1234,
            lr: 0x1000_5679,
            xpsr: 0x6100_0000,
            stack: [0; STACK_WORDS],
        }),
        firmware: None,
    };
    let reported = Reported {
        modes: Modes::BALANCING | Modes::PROTECTED,
        gauge: GaugeReport {
            error_pct: Some(3),
            over_discharges: Some(4),
            energies_wh: Some([40.0, 50.0]),
        },
        ..Reported::NONE
    };
    let command = command();
    let vehicle = [
        Record::Message("Rover 0.1.0"),
        Record::Parameter {
            name: "BATT_CAPACITY",
            value: 5200.0,
            default: 2200.0,
        },
        Record::Crash(&crash),
        Record::Mode {
            mode: Mode::Manual,
            reason: ModeReason::Command,
        },
        Record::Arm {
            state: ArmState::Armed,
            enabled_checks: 0x0001_0301,
            forced: true,
            method: ArmingMethod::Command,
        },
        Record::Event(ArmState::Armed),
        Record::Error(Subsystem::BatteryFailsafe),
        Record::Health {
            load_permille: 345,
            dropped_records: 70_000,
        },
        Record::Time(Utc::from_micros(1_767_225_600_123_456)),
        Record::Board(BoardId([0xe6, 0x60, 0x58, 0x38, 0x83, 0x45, 0x0a, 0x2c])),
        Record::Pack(Pack::Second, &state, Some(&learnt)),
        Record::Curve(Pack::Second, &learnt),
        Record::Report(Pack::Second, &reported),
        Record::Command(&command),
    ];
    let timer = Record::FailsafeTimer(Pack::Second, FailsafeLevel::Low, FailsafeTimer::Expired);
    let extremes = Extremes {
        lowest_voltage_v: Some(44.5),
        highest_current_a: None,
    };
    let of_pack = Record::of_pack(Pack::Second, &state, extremes);
    file_of(vehicle.into_iter().chain(of_pack).chain([timer]))
}

fn command() -> CommandRecord {
    let numbers = [1.5_f32, -2.0, 3.25, 4.0].map(f32::to_le_bytes);
    let places = [-47, 8].map(i32::to_le_bytes);
    let fields = [&numbers[..], &places, &[100.5_f32.to_le_bytes()]].concat();
    CommandRecord {
        target: [1, 0],
        sender: [255, 190],
        frame: 3,
        number: 400,
        fields: fields.concat().try_into().expect("seven numbers"),
        result: 4,
        was_long: true,
    }
}

/// A file with these records, a millisecond apart, behind its opening.
fn file_of<'a>(records: impl Iterator<Item = Record<'a>>) -> Vec<u8> {
    let opening = (0..).map_while(|index| opening_record(index, START_US));
    let records = records
        .zip(1..)
        .map(|(record, ms)| record.encode(START_US + 1000 * ms));
    opening.chain(records).flatten().collect()
}

fn entries(file: Vec<u8>) -> Vec<Entry> {
    let reader = Reader::new(std::io::Cursor::new(file));
    reader.map(|entry| entry.expect("no error")).collect()
}

fn only<'a>(entries: &'a [Entry], name: &str) -> &'a Entry {
    let mut found = entries.iter().filter(|entry| entry.name == name);
    let entry = found.next().unwrap_or_else(|| panic!("no {name}"));
    assert!(found.next().is_none(), "{name} twice");
    entry
}

/// The fields that `expected` names, with their values in a record.
fn fields(entry: &Entry, expected: &str) -> String {
    let value = |name: &str| match entry.get_f64(name) {
        Some(number) => number.to_string(),
        None => entry.get_str(name).unwrap_or("missing").into(),
    };
    let names = expected.split(", ").filter_map(|field| field.split_once(' '));
    let fields: Vec<String> = names.map(|(name, _)| format!("{name} {}", value(name))).collect();
    fields.join(", ")
}

#[test]
// Requirement: AP-21
fn every_record_is_read_and_its_fields_are_found_by_name() {
    // The file stays, for `mavlogdump.py` and others to be tried on it.
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("one_of_each.BIN");
    std::fs::write(path, file()).expect("a file");
    let entries = entries(file());
    for (name, expected) in [
        (
            "BAT",
            "TimeUS 1515000, Inst 1, Volt 48.25, VoltR 48.5, Curr 3.5, CurrTot 1250, EnrgTot 14.5, \
             Temp -12.34, Res 0.0625, RemPct 67, H 1, SH 93",
        ),
        (
            "BATX",
            "Inst 1, SoC 66.5, SoCLo 64.5, SoCHi 68.5, Use 60.25, Cap 4750, State 2, Flt 8, FS 2, Stat 3, \
             VMin 44.5, IMax NaN",
        ),
        ("BCL", "Instance 1, Volt 48.25, V1 3711, V11 3711, V12 1"),
        ("BCL2", "Instance 1, V13 3711, V14 0, V16 0"),
        ("PARM", "Name BATT_CAPACITY, Value 5200, Default 2200"),
        ("MSG", "Message Rover 0.1.0"),
        ("MODE", "Mode 0, ModeNum 0, Rsn 2"),
        ("ARM", "ArmState 1, ArmChecks 66305, Forced 1, Method 1"),
        ("EV", "Id 10"),
        ("ERR", "Subsys 6, ECode 1"),
        ("FSTM", "Inst 1, FS 2, Tmr 2"),
        ("PM", "Load 345, LogDrop 70000"),
        // 0x1000_1234, 0x1000_5679, 0x6100_0000.
        (
            "CRSH",
            "Cause 1, PC 268440116, LR 268457593, PSR 1627389952, Task battery",
        ),
        (
            "GPS",
            "TimeUS 1509000, Status -1, GWk 2399, GMS 345618123, Lat 0, Lng 0",
        ),
        ("BRD", "Id E660583883450A2C"),
        (
            "PACK",
            "Inst 1, SN 4711, Chem 1, Cells 13, Drv 7, Cap 4750, CapD 0.25, Res 0.5, Res1 0.25, SoC 0.625, \
             SoCD 0.0625, RstV 3.75",
        ),
        ("PCKO", "Inst 1, O1 -400, O5 350, D1 80, D5 84"),
        ("BATR", "Inst 1, Err 3, OvD 4, WhR 40, WhF 50, Mode 10"),
        (
            "MAVC",
            "TS 1, TC 0, SS 255, SC 190, Fr 3, Cmd 400, P1 1.5, P2 -2, P3 3.25, P4 4, X -47, Y 8, Z 100.5, \
             Res 4, WL 1",
        ),
    ] {
        assert_eq!(fields(only(&entries, name), expected), expected, "{name}");
    }
}

#[test]
fn what_is_unknown_of_a_pack_is_no_number_it_could_have() {
    let unknown = BatteryState::UNKNOWN;
    let sixteen = BatteryState {
        cells: CellVoltages::from_millivolts(&[3750; 16]),
        ..unknown
    };
    let records = [
        Record::Battery(Pack::First, &unknown),
        Record::Estimate(Pack::Ninth, &unknown, Extremes::default()),
        Record::Pack(Pack::First, &unknown, Some(&LearntPack::UNKNOWN)),
        Record::Report(Pack::First, &Reported::NONE),
        Record::MoreCells(Pack::Third, &sixteen),
    ];
    let entries = entries(file_of(records.into_iter()));
    for (name, expected) in [
        (
            "BAT",
            "Volt NaN, VoltR NaN, Curr NaN, CurrTot NaN, EnrgTot NaN, Temp 0, Res NaN, RemPct 255, H 0, SH 0",
        ),
        (
            "BATX",
            "Inst 8, SoC NaN, SoCLo NaN, SoCHi NaN, Use NaN, Cap NaN, VMin NaN, IMax NaN",
        ),
        (
            "PACK",
            "SN -1, Cells 0, Drv 0, Cap NaN, CapD NaN, Res NaN, Res1 NaN, SoC NaN, SoCD NaN, RstV NaN",
        ),
        ("BATR", "Err 255, OvD 65535, WhR NaN, WhF NaN, Mode 0"),
        ("BCL2", "V13 3750, V16 3750"),
    ] {
        assert_eq!(fields(only(&entries, name), expected), expected, "{name}");
    }
    let without = file_of([Record::Pack(Pack::First, &unknown, None)].into_iter());
    assert!(file_of([records[2]].into_iter()) == without, "nothing learnt");
}

#[test]
fn the_opening_says_length_and_units_of_every_format() {
    let mut reader = Reader::new(std::io::Cursor::new(file()));
    let entries: Vec<Entry> = reader.by_ref().map(|entry| entry.expect("no error")).collect();
    for format in reader.formats().values() {
        let is_used = entries.iter().any(|entry| entry.name == format.name);
        assert!(is_used || format.name == "FMT", "no {}", format.name);
        assert_eq!(
            format.payload_size() + 3,
            usize::from(format.msg_len),
            "{}",
            format.name
        );
        let of_format = |entry: &&Entry| entry.get_i64("FmtType") == Some(i64::from(format.msg_type));
        let units = entries
            .iter()
            .filter(|entry| entry.name == "FMTU")
            .find(of_format);
        let units = units.unwrap_or_else(|| panic!("no units of {}", format.name));
        for field in ["UnitIds", "MultIds"] {
            let characters = units.get_str(field).expect("a text").len();
            assert_eq!(characters, format.labels.len(), "{}: {field}", format.name);
        }
    }
}
