//! A log file, read by a parser that is not of this project.

use std::path::Path;

use ardupilot_binlog::{Entry, Reader};
use rover_battmon::battery::{
    Amount, BatteryState, CellVoltages, ChargeState, Extremes, FailsafeLevel, FailsafeTimer, Faults,
    LearntPack, PackStatus, Readings,
};
use rover_battmon::crash::{CrashCause, CrashRecord, FaultSite, STACK_WORDS, TaskName};
use rover_battmon::memory::identity::BoardId;
use rover_battmon::pack::Pack;
use rover_battmon::recorder::dataflash::{ArmingMethod, ModeReason, Record, Subsystem, opening_record};
use rover_battmon::time::Utc;
use rover_battmon::vehicle::ArmState;
use rover_battmon::vehicle::Mode;

const START_US: u64 = 1_500_000;

/// A file with a record of every format, all but the opening a millisecond apart.
fn file() -> Vec<u8> {
    let state = BatteryState {
        status: PackStatus::Healthy,
        readings: Readings {
            voltage_v: Some(48.25),
            current_a: Some(3.5),
            remaining_pct: Some(66.5),
            remaining_sigma_pct: Some(1.0),
            faults: Faults::OVER_CURRENT,
            ..Readings::NONE
        },
        consumed: Some(Amount::Mah(1250.0)),
        consumed_wh: Some(14.5),
        temperature_c: Some(-12.34),
        charge_state: ChargeState::Low,
        cells: CellVoltages::from_millivolts(&[3711; 13]),
        learnt_capacity_mah: Some(4750.0),
        serial_number: Some(4711),
        cell_count: Some(13),
        ..BatteryState::UNKNOWN
    };
    let learnt: LearntPack = "chemistry 1\ncells 13\ndrives 7\n\
        capacity_mah_sigma 4750 0.25\nresistance_ohm_now_first 0.5 0.25\n\
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
            enabled_checks: 1,
            forced: true,
            method: ArmingMethod::Command,
        },
        Record::Event(ArmState::Armed),
        Record::Error(Subsystem::BatteryFailsafe),
        Record::Health {
            load_permille: 345,
            dropped_records: 2,
        },
        Record::Time(Utc::from_micros(1_767_225_600_123_456)),
        Record::Board(BoardId([0xe6, 0x60, 0x58, 0x38, 0x83, 0x45, 0x0a, 0x2c])),
        Record::Pack(Pack::Second, &state, Some(&learnt)),
        Record::Curve(Pack::Second, &learnt),
    ];
    let timer = Record::FailsafeTimer(Pack::Second, FailsafeLevel::Low, FailsafeTimer::Expired);
    let extremes = Extremes {
        lowest_voltage_v: Some(44.5),
        highest_current_a: None,
    };
    let of_pack = Record::of_pack(Pack::Second, &state, extremes);
    let records = vehicle
        .into_iter()
        .chain(of_pack)
        .chain([timer])
        .zip(1..)
        .map(|(record, ms)| record.encode(START_US + 1000 * ms));
    let opening = (0..).map_while(|index| opening_record(index, START_US));
    opening.chain(records).flatten().collect()
}

fn entries() -> Vec<Entry> {
    let reader = Reader::new(std::io::Cursor::new(file()));
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

/// The file stays, for `mavlogdump.py` and others to be tried on it.
#[test]
fn every_record_is_read_and_its_fields_are_found_by_name() {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("one_of_each.BIN");
    std::fs::write(path, file()).expect("a file");
    let entries = entries();
    for (name, expected) in [
        (
            "BAT",
            "TimeUS 1513000, Inst 1, Volt 48.25, Curr 3.5, CurrTot 1250, EnrgTot 14.5, Temp -12.34, \
             RemPct 67, H 1, SH 0, Res NaN",
        ),
        (
            "BATX",
            "SoC 66.5, SoCLo 64.5, SoCHi 68.5, Cap 4750, State 2, Flt 8, VMin 44.5, IMax NaN",
        ),
        ("BCL", "Volt 48.25, V1 3711, V12 3711"),
        ("BCL2", "V13 3711, V14 0"),
        ("PARM", "Name BATT_CAPACITY, Value 5200, Default 2200"),
        ("MSG", "Message Rover 0.1.0"),
        ("MODE", "Mode 0, ModeNum 0, Rsn 2"),
        ("ARM", "ArmState 1, Forced 1, Method 1"),
        ("EV", "Id 10"),
        ("ERR", "Subsys 6, ECode 1"),
        ("FSTM", "Inst 1, FS 2, Tmr 2"),
        ("PM", "Load 345, LogDrop 2"),
        // 0x1000_1234.
        ("CRSH", "PC 268440116, Task battery"),
        (
            "GPS",
            "TimeUS 1509000, Status -1, GWk 2399, GMS 345618123, Lat 0, Lng 0",
        ),
        ("BRD", "Id E660583883450A2C"),
        (
            "PACK",
            "Inst 1, SN 4711, Chem 1, Cells 13, Drv 7, Cap 4750, CapD 0.25, Res 0.5, Res1 0.25, SoC NaN",
        ),
        ("PCKO", "Inst 1, O1 -400, O5 350, D1 80, D5 84"),
    ] {
        assert_eq!(fields(only(&entries, name), expected), expected, "{name}");
    }
}

#[test]
fn the_opening_says_length_and_units_of_every_format() {
    let mut reader = Reader::new(std::io::Cursor::new(file()));
    let entries: Vec<Entry> = reader.by_ref().map(|entry| entry.expect("no error")).collect();
    for format in reader.formats().values() {
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
