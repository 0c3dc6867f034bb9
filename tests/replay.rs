//! `replay`, run as its user runs it.

use std::collections::HashMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use ::mavlink::{MAVLinkV2MessageRaw, MavHeader};
use rover_battmon::battery::{BatteryMonitor, BatteryState, Extremes, LearntPack, Measurement, Tick};
use rover_battmon::mavlink::dialect::{BATTERY_STATUS_DATA, HEARTBEAT_DATA, MavMessage, MavType};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, Parameters};
use rover_battmon::recorder::dataflash::{ArmingMethod, Record, opening_record};
use rover_battmon::time::Instant;
use rover_battmon::vehicle::ArmState;

const TRACE: &str = "tests/data/traces/trace_discharge_3s_10min.csv";
const PICTURE: &str = "docs/pictures/discharge.svg";

const ASSIGNMENTS: [&str; 5] = [
    "BATT_CELLS=3",
    "BATT_CAPACITY=2200",
    "BATT_FS_VOLTSRC=1",
    "BATT_LOW_VOLT=11.4",
    "BATT_CRT_VOLT=11.1",
];

/// Shows commands, what they print and the picture they draw.
const PAGE: &str = "docs/failsafes.md";

/// A column of the rows that `replay` writes.
const REMAINING_PCT: usize = 7;
const EVENTS: usize = 13;

/// `replay ARGUMENTS`, from the repository's root.
fn replay(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_replay"))
        .current_dir(root())
        .args(arguments)
        .output()
        .expect("it is built")
}

fn printed(output: Output) -> String {
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    String::from_utf8(output.stdout).expect("text")
}

/// The remarks on a recording.
fn said_of(arguments: &[&str]) -> String {
    let output = replay(arguments);
    let text = String::from_utf8(output.stderr).expect("text");
    assert!(output.status.success(), "{text}");
    text
}

/// The complaint about arguments for which nothing is printed.
fn refused(arguments: &[&str]) -> String {
    let output = replay(arguments);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    assert!(output.stdout.is_empty(), "{arguments:?}");
    String::from_utf8(output.stderr).expect("text")
}

/// The header and the rows of CSV.
fn table(text: &str) -> (Vec<&str>, Vec<Vec<&str>>) {
    let mut rows = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    (rows.next().expect("a header"), rows.collect())
}

#[test]
fn reports_the_estimates_for_each_reading() {
    let assigned = ASSIGNMENTS.map(|assignment| ["--param", assignment]);
    let text = printed(replay(&[assigned.as_flattened(), &[TRACE]].concat()));
    let (header, rows) = table(&text);
    assert_eq!(
        (header[REMAINING_PCT], header[EVENTS]),
        ("remaining_pct", "events")
    );
    let trace = fs::read_to_string(root().join(TRACE)).expect("the trace");
    assert_eq!(rows.len(), trace.lines().count() - 1);
    // The traces' README states the remaining charge.
    let left_pct: f64 = rows[rows.len() - 1][REMAINING_PCT].parse().expect("a number");
    assert!((left_pct - 33.5).abs() < 1.0, "{left_pct} %");
    let events = rows.iter().map(|row| row[EVENTS]);
    let events: Vec<_> = events.filter(|event| !event.is_empty()).collect();
    assert!(
        events.len() == 2 && events[0].starts_with("is low 11.") && events[1].starts_with("is critical 10."),
        "{events:?}"
    );
}

#[test]
// Requirement: PX-6
fn what_the_estimator_assumes_is_explained_at_any_moment() {
    let assigned = ASSIGNMENTS.map(|assignment| ["--param", assignment]);
    let at = |time: &str| {
        let explain = ["--explain", time, TRACE];
        replay(&[assigned.as_flattened(), &explain].concat())
    };
    let output = at("5:00");
    let (rows, explained) = [output.stdout, output.stderr]
        .map(|text| String::from_utf8(text).expect("text"))
        .into();
    let (_, rows) = table(&rows);
    let row = rows.iter().find(|row| row[0] == "300").expect("a reading");
    let (pct, sigma_pct): (f64, f64) = (
        row[REMAINING_PCT].parse().expect("known"),
        row[REMAINING_PCT + 1].parse().expect("known"),
    );
    let line = format!("  state of charge, %: {pct:.1} ± {sigma_pct:.1}, -");
    assert!(explained.contains(&line), "{line}\n{explained}");
    assert!(
        explained.contains("At 5:00 the current is counted from a charge that is certain:\n"),
        "{explained}"
    );
    for quantity in [
        "usable charge, %",
        "capacity, mAh: 2200.0 ± 88.0",
        "resistance of a cell, mΩ",
    ] {
        assert!(explained.contains(quantity), "{explained}");
    }
    // Before the load there is nothing to compare with.
    let first = String::from_utf8(at("0").stderr).expect("text");
    assert!(first.contains("At 0:00 no charge is known yet:\n"), "{first}");
    for (time, error) in [
        ("11:00", "no reading at 11:00: it has 0:00 to 10:00"),
        ("a", "90, 1:30 or 1:02:30"),
    ] {
        let output = at(time);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && errors.contains(error), "{errors}");
    }
}

/// The blocks of a page that run `replay`, and what it shows below each.
fn documented(page: &str) -> Vec<(String, Option<String>)> {
    let text = fs::read_to_string(root().join(page)).expect("the page");
    let blocks = text
        .split("```sh\n")
        .skip(1)
        .filter_map(|behind| behind.split_once("```\n"));
    let blocks = blocks.filter(|(commands, _)| commands.contains("--bin replay -- "));
    let shown = |rest: &str| {
        let text = rest.trim_start().strip_prefix("```text\n")?;
        Some(text.split_once("```")?.0.into())
    };
    blocks
        .map(|(commands, rest)| (commands.into(), shown(rest)))
        .collect()
}

/// What the commands of a page show in a terminal, run in `folder`.
fn shown_by(commands: &str, folder: &Path) -> String {
    let data = root().join("tests/data");
    let commands = commands
        .replace("--quiet ", "")
        .replace("cargo run --bin replay --", env!("CARGO_BIN_EXE_replay"))
        .replace("tests/data", data.to_str().expect("a path"));
    let output = Command::new("bash")
        .current_dir(folder)
        .args(["-ec", &commands])
        .output()
        .expect("bash can be started");
    assert!(output.status.success(), "{commands}: {output:?}");
    // Rows go to a pipe, and to no terminal.
    let shown = if output.stderr.is_empty() {
        output.stdout
    } else {
        output.stderr
    };
    String::from_utf8(shown).expect("text")
}

#[test]
fn documented_commands_show_what_the_page_has_and_draw_its_picture() {
    let committed = fs::read_to_string(root().join(PICTURE)).expect("the picture");
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("documented_replays");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(folder.join("target")).expect("a folder");
    let mut compared = 0;
    for (commands, expected) in documented(PAGE) {
        let shown = shown_by(&commands, &folder);
        if let Some(expected) = expected {
            assert_eq!(shown, expected, "{commands}");
            compared += 1;
        }
    }
    assert!(compared > 0, "nothing is shown");
    let drawn = fs::read_to_string(folder.join("target/drive.svg")).expect("the picture");
    assert!(
        drawn == committed,
        "{PICTURE} is not what the command of {PAGE} draws"
    );
}

#[test]
fn rows_go_to_a_file_if_one_is_named() {
    let rows = no_file("rows.csv");
    let output = replay(&["--csv", &rows, TRACE]);
    assert!(output.stdout.is_empty());
    let written = format!("wrote {rows}\n");
    assert!(String::from_utf8_lossy(&output.stderr).ends_with(&written));
    let text = fs::read_to_string(&rows).expect("it is written");
    assert_eq!(text, printed(replay(&[TRACE])));
}

#[test]
fn help_begins_with_what_it_is_and_ends_with_examples() {
    let help = printed(replay(&["--help"]));
    assert!(
        help.starts_with("Runs a recorded drive through the battery monitor"),
        "{help}"
    );
    let (_, examples) = help.split_once("Examples:\n").expect("examples");
    assert_eq!(examples.lines().count(), 4, "{help}");
}

#[test]
fn one_recording_is_replayed_at_a_time_unless_there_is_a_table() {
    let errors = refused(&[TRACE, TRACE]);
    assert!(
        errors.contains("one recording at a time, or --table or --history"),
        "{errors}"
    );
    for of_one in [
        "--armed",
        "--plot=x.svg",
        "--csv=x.csv",
        "--learned=x.txt",
        "--pack=2",
    ] {
        refused(&["--table", "x.parquet", of_one, TRACE]);
    }
}

/// A file in a folder for this test run, which does not exist yet.
fn no_file(name: &str) -> String {
    let path = format!("{}/{name}", env!("CARGO_TARGET_TMPDIR"));
    let _ = fs::remove_file(&path);
    path
}

/// A file in a folder for this test run, with this content.
fn file_of(name: &str, content: impl AsRef<[u8]>) -> String {
    let path = no_file(name);
    fs::write(&path, content).expect("a file");
    path
}

/// A drive of a 3S pack of 2.0 Ah, labelled 2.2 Ah: a rest when full, twelve minutes under load, and a rest.
fn drive_with_rests() -> String {
    let mut text = String::from("t_s,voltage_v,current_a,armed\n");
    let mut drawn_ah = 0.0;
    let mut slow_a = 0.0;
    for sample in 0..14_000 {
        let t_s = f64::from(sample) * 0.1;
        let current_a = match t_s {
            60.0..790.0 if (t_s % 20.0) < 12.0 => 12.0,
            60.0..790.0 => 4.0,
            _ => 0.1,
        };
        drawn_ah += current_a * 0.1 / 3600.0;
        slow_a += (current_a - slow_a) * 0.01;
        let share: f64 = 1.0 - drawn_ah / 2.0;
        let resting_v = 3.0 * (3.68 + 0.19 * share + 0.33 * share.powi(4) - 0.5 * (-25.0 * share).exp());
        let voltage_v = resting_v - 0.036 * current_a - 0.018 * slow_a;
        let armed = u8::from((60.0..790.0).contains(&t_s));
        text += &format!("{t_s:.1},{voltage_v:.4},{current_a},{armed}\n");
    }
    text
}

#[test]
fn continues_with_what_earlier_drives_taught() {
    let trace = file_of("drive_with_rests.csv", drive_with_rests());
    let learned = no_file("learned.txt");
    let arguments = [
        "--param",
        "BATT_CELLS=3",
        "--param",
        "BATT_CAPACITY=2200",
        "--learned",
        learned.as_str(),
        trace.as_str(),
    ];
    let left_pct = || -> f64 {
        let text = printed(replay(&arguments));
        // While the load still lasts.
        let (_, rows) = table(&text);
        rows[6_899][REMAINING_PCT].parse().expect("a number")
    };
    let first_pct = left_pct();
    let text = fs::read_to_string(&learned).expect("it is created");
    assert!(text.lines().any(|line| line == "drives 1"), "{text}");
    // One drive of this much leaves the capacity less certain than the label.
    left_pct();
    let third_pct = left_pct();
    println!("{first_pct} %, then {third_pct} %\n{text}");
    assert!((first_pct - third_pct) > 2.0, "{first_pct} %, then {third_pct} %");
}

#[test]
fn leaves_a_bad_file_of_what_was_learnt_alone() {
    let bad = "drives 1\ncapacity_mah_sigma much\n";
    let learned = file_of("bad.txt", bad);
    assert_eq!(
        refused(&["--learned", &learned, TRACE]),
        format!("error: {learned}: line 2 is not a property of a pack\n")
    );
    assert_eq!(fs::read_to_string(&learned).expect("a file"), bad);
}

fn root() -> &'static Path {
    let tools = Path::new(env!("CARGO_MANIFEST_DIR"));
    tools.parent().expect("it is in the repository")
}

/// ArduPilot's from 3.2 on: readings without an instance, in other units, and in a log that begins while armed.
#[test]
fn logs_of_other_autopilots_are_replayed() {
    for name in ["old_bat.BIN", "curr.BIN", "armed_before.BIN"] {
        let text = said_of(&[&format!("tests/data/logs/{name}")]);
        let lines = [
            "1 min 0 s, from 0:01 to 1:00, 600 readings; armed for 1 min 0 s\n",
            "Voltage: 12.00 V at the start, 10.00 V at the end; weakest at 1:00: 10.00 V at 5.0 A\n",
            "Drawn: 83 mAh, 0.9 Wh\n",
            "Failsafe: BATT_LOW_VOLT 11 would have acted at 0:34\n",
        ];
        for line in lines {
            assert!(text.contains(line), "{name}: {text}");
        }
        let inferred = "\nTaken for armed from the beginning: the log has the disarming only\n";
        assert_eq!(text.contains(inferred), name == "armed_before.BIN", "{text}");
    }
}

#[test]
fn a_log_of_a_ground_station_is_armed_by_any_vehicle() {
    let text = said_of(&[
        "--param",
        "BATT_LOW_VOLT=11.5",
        "--param",
        "BATT_LOW_TIMER=3",
        "tests/data/logs/boat.tlog",
    ]);
    for line in [
        "Recorded by ArduPilot, boat\n",
        "Not in the log: BATT_CELLS, BATT_CAPACITY (--param)\n",
        "1 min 40 s, from 0:00 to 1:39, 200 readings; armed for 1 min 29 s\n",
        "Failsafe: BATT_LOW_VOLT 11.5 would have acted at 0:29\n",
    ] {
        assert!(text.contains(line), "{text}");
    }
}

/// Inputs that were misread once, each with what it should give.
#[test]
fn logs_that_others_have_are_read_right() {
    for (name, assignment, lines) in [
        (
            "clock_back.tlog",
            "BATT_LOW_VOLT=11.5",
            &[
                "The clock stepped back by 2 h at 0:10 (once)\n",
                "10 min 10 s, from 0:00 to 10:09, 1220 readings; armed for 10 min 10 s\n",
                "Drawn: 339 mAh, ",
                "Failsafe: BATT_LOW_VOLT 11.5 would have acted at 0:20\n",
            ][..],
        ),
        (
            "cells.ulg",
            "BATT_CAPACITY=5200",
            &["Failsafe: none is set; usual are BATT_LOW_VOLT 21.0 and BATT_CRT_VOLT "],
        ),
        (
            "arming.ulg",
            "BATT_LOW_VOLT=21",
            &[
                "; armed for 45 s\n",
                "Failsafe: BATT_LOW_VOLT 21 would have acted at 1:55\n",
            ],
        ),
        (
            "sys_status.tlog",
            "BATT_LOW_VOLT=11.5",
            &[
                "Readings are of SYS_STATUS: the log has no BATTERY_STATUS of pack 1\n",
                ", 240 readings; ",
                "; the log has 50 %\n",
            ],
        ),
        (
            "camera_first.tlog",
            "BATT_LOW_VOLT=11.5",
            &[
                "Recorded by ArduPilot, rover\n",
                ", 120 readings; armed for 1 min 0 s\n",
            ],
        ),
        (
            "torn.tlog",
            "BATT_LOW_VOLT=11.5",
            &[
                "torn.tlog: skipped 26 of 8457 bytes that are not whole records\n",
                ", 120 readings; ",
            ],
        ),
        (
            "slow.csv",
            "BATT_LOW_VOLT=11.5",
            &[
                "  Battery 1 not measured for 10s: 6mAh assumed (120 times)\n",
                "  Battery 1 is low 11.49V ",
            ],
        ),
        (
            "gps_3_1.BIN",
            "BATT_LOW_VOLT=11.5",
            &[
                "Recorded from 2014-10-19 01:04 UTC on\n",
                ", from 5:13 to 6:12, 60 readings; ",
            ],
        ),
    ] {
        let text = said_of(&["--param", assignment, &format!("tests/data/logs/{name}")]);
        for line in lines {
            assert!(text.contains(line), "{name}: {line}: {text}");
        }
        assert!(!text.contains("Set during the recording"), "{name}: {text}");
        assert_eq!(
            text.matches("not measured").count(),
            usize::from(name == "slow.csv"),
            "{text}"
        );
    }
}

#[test]
fn a_log_may_begin_with_zeros_and_end_in_a_record() {
    let log = |name: &str| fs::read(root().join("tests/data/logs").join(name)).expect("a log");
    let with_zeros =
        |name: &str, bytes: &[u8]| file_of(&format!("zeros-{name}"), [&[0; 70_000], bytes].concat());
    for (name, readings) in [
        ("old_bat.BIN", 600),
        ("camera_first.tlog", 120),
        ("cells.ulg", 120),
        ("slow.csv", 360),
    ] {
        let text = said_of(&[&with_zeros(name, &log(name))]);
        assert!(text.contains(&format!(", {readings} readings; ")), "{text}");
        let said = text.contains("skipped 70000 of ");
        // A table has no bytes that belong to no line.
        assert_eq!(said, name != "slow.csv", "{text}");
        if said {
            let log = log(name);
            let text = said_of(&[&file_of(&format!("cut-{name}"), &log[..log.len() - 10])]);
            let is_no_damage = text.contains(": the last record is cut: ") && !text.contains("skipped");
            assert!(is_no_damage, "{text}");
        }
    }
    let header = refused(&[&file_of("torn.ulg", &log("cells.ulg")[3..])]);
    assert!(header.contains(": neither a log of "), "{header}");
}

#[test]
fn the_vehicle_of_a_ground_stations_log_can_be_chosen() {
    // Of camera_first.tlog, and of another vehicle with fewer readings.
    let mut log = fs::read(root().join("tests/data/logs/camera_first.tlog")).expect("a log");
    let (time, vehicle) = (
        1_700_000_100_000_000_u64.to_be_bytes(),
        MavHeader {
            system_id: 9,
            component_id: 1,
            sequence: 0,
        },
    );
    for message in [
        MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            mavtype: MavType::MAV_TYPE_SURFACE_BOAT,
            ..HEARTBEAT_DATA::DEFAULT
        }),
        MavMessage::BATTERY_STATUS(BATTERY_STATUS_DATA::DEFAULT),
    ] {
        let mut raw = MAVLinkV2MessageRaw::new();
        raw.serialize_message(vehicle, &message);
        log.extend([&time[..], raw.raw_bytes()].concat());
    }
    let name = file_of("two.tlog", &log);
    let text = said_of(&[&name]);
    let said = "Replayed vehicle 1; the log also has 9 (1 reading) (--system)\n";
    assert!(text.contains(said) && text.contains(", 120 readings"), "{text}");
    let text = said_of(&["--system", "9", &name]);
    let said = "Replayed vehicle 9; the log also has 1 (120 readings) (--system)\n";
    assert!(text.contains(said) && text.contains(", 1 readings"), "{text}");
    assert!(refused(&["--system", "2", &name]).ends_with(": no vehicle 2, but 1, 9\n"));
    let errors = refused(&["--system", "2", "tests/data/logs/old_bat.BIN"]);
    assert!(
        errors.ends_with(": --system is for logs of ground stations (.tlog)\n"),
        "{errors}"
    );
    // What MAVProxy writes beside its log.
    let frames = log.chunks(50).flat_map(|bytes| bytes.iter().skip(8)).copied();
    let raw = file_of("mav.tlog.raw", frames.collect::<Vec<u8>>());
    assert_eq!(
        refused(&[&raw]),
        format!("error: {raw}: without times: mav.tlog has them\n")
    );
}

/// A file of parameters that is loaded after a drive does not rewrite it.
#[test]
fn parameters_hold_from_when_they_were_set() {
    let mut bytes = log_of_drive();
    let last_us = 1_399_900_000;
    for (parameter, value) in [(BatteryParameter::Cells, 6.0), (BatteryParameter::LowVolt, 21.0)] {
        let id = parameter.of(Pack::Second);
        let name = id.name();
        let record = Record::Parameter {
            name: name.as_str(),
            value,
            default: 0.0,
        };
        bytes.extend(record.encode(last_us));
    }
    let unread = BatteryState::default();
    bytes.extend(Record::Battery(Pack::Second, &unread).encode(last_us + 100_000));
    let log = file_of("set-later.BIN", bytes);
    let text = said_of(&["--pack", "2", "--param", "BATT2_CELLS=3", &log]);
    let expected = "Set during the recording: BATT2_LOW_VOLT=21 at 23:20\n";
    assert!(text.contains(expected), "{text}");
    let text = said_of(&["--pack", "2", &log]);
    let expected = "Set during the recording: BATT2_CELLS=6 at 23:20, BATT2_LOW_VOLT=21 at 23:20\n";
    assert!(text.contains(expected), "{text}");
    assert!(
        text.contains("\nFailsafe: BATT2_LOW_VOLT 10.8 acted at 8:11, 52 % left (recorded)\n"),
        "{text}"
    );
    assert!(!text.contains("does not fit"), "{text}");
}

#[test]
fn a_file_that_is_no_recording_gets_one_line() {
    let name = file_of("program.BIN", b"\x7fELF\0\x01\x02");
    let errors = refused(&[&name]);
    assert!(
        errors.starts_with(&format!("error: {name}: neither a log of ArduPilot")),
        "{errors}"
    );
    assert_eq!(errors.lines().count(), 1);
    let errors = refused(&["nowhere.csv"]);
    assert!(errors.starts_with("error: nowhere.csv: "), "{errors}");
    // A name says nothing.
    let renamed = no_file("log.csv");
    fs::copy(root().join("tests/data/logs/old_bat.BIN"), &renamed).expect("a file");
    assert!(said_of(&[&renamed]).contains("600 readings"));
}

/// The log of that drive, of pack 2: at each reading what the monitor makes of it.
fn log_of_drive() -> Vec<u8> {
    let mut parameters = Parameters::defaults();
    let mut bytes: Vec<u8> = (0..)
        .map_while(|index| opening_record(index, 0))
        .flatten()
        .collect();
    for (parameter, value) in [
        (BatteryParameter::Monitor, 4.0),
        (BatteryParameter::Cells, 3.0),
        (BatteryParameter::Capacity, 2200.0),
        (BatteryParameter::LowVolt, 10.8),
    ] {
        let id = parameter.of(Pack::Second);
        parameters.set(id, value).expect("in range");
        let (name, default) = (id.name(), id.default_value());
        let name = name.as_str();
        bytes.extend(Record::Parameter { name, value, default }.encode(0));
    }
    let settings = parameters.pack(Pack::Second).settings();
    let (mut monitor, mut battery) = (BatteryMonitor::new(), BatteryState::default());
    monitor.restore_learnt(LearntPack::of(None));
    let mut arm_state = ArmState::Disarmed;
    for line in drive_with_rests().lines().skip(1) {
        let numbers: Vec<f64> = line
            .split(',')
            .map(|field| field.parse().expect("a number"))
            .collect();
        let time_us = (numbers[0] * 1e6).round() as u64;
        let state = if numbers[3] == 1.0 {
            ArmState::Armed
        } else {
            ArmState::Disarmed
        };
        if state != arm_state {
            arm_state = state;
            let record = Record::Arm {
                state,
                enabled_checks: 1,
                forced: false,
                method: ArmingMethod::Command,
            };
            bytes.extend(record.encode(time_us));
        }
        let reading = Measurement {
            voltage_v: Some(numbers[1] as f32),
            current_a: Some(numbers[2] as f32),
            ..Measurement::default()
        };
        let now = Instant::from_micros(time_us);
        let timers = battery.failsafe_timers;
        let _ = monitor.update(
            &mut battery,
            Tick {
                now,
                load_state: arm_state.into(),
            },
            Ok(reading),
            &settings,
        );
        let changes = battery.failsafe_timers.changes(timers);
        let timers = changes.map(|(level, timer)| Record::FailsafeTimer(Pack::Second, level, timer));
        let records = timers.chain(Record::of_pack(Pack::Second, &battery, Extremes::default()));
        bytes.extend(records.flat_map(|record| record.encode(time_us)));
    }
    bytes
}

#[test]
fn a_log_replayed_agrees_with_what_the_board_reported() {
    let mut bytes = log_of_drive();
    // Power went while the last record was written.
    bytes.truncate(bytes.len() - 10);
    let output = replay(&["--pack", "2", &file_of("drive.BIN", bytes)]);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        errors
            .lines()
            .next()
            .is_some_and(|line| line.contains("drive.BIN: the last record is cut: ")),
        "{errors}"
    );
    let text = printed(output);
    let (header, rows) = table(&text);
    let place = |name: &str| header.iter().position(|column| *column == name).expect(name);
    assert_eq!(rows.len(), 14_000);
    let number = |row: &[&str], name: &str| row[place(name)].parse::<f64>().expect(name);
    // The last reading lacks its estimate, which was cut off.
    for row in rows[..rows.len() - 1].iter().step_by(100) {
        for (now, then) in [
            ("remaining_pct", "reported_remaining_pct"),
            ("consumed_mah", "reported_consumed_mah"),
            ("charge_state", "reported_charge_state"),
        ] {
            if now == "remaining_pct" && row[place(then)].is_empty() {
                assert_eq!(number(row, now), -1.0, "{row:?}");
                continue;
            }
            let difference = number(row, now) - number(row, then);
            assert!(difference.abs() < 0.01, "{now} at {} s: {difference}", row[0]);
        }
    }
    let armed_remaining_pct = number(&rows[6_900], "remaining_pct");
    assert!(
        (10.0..30.0).contains(&armed_remaining_pct),
        "{armed_remaining_pct} %"
    );
}

#[test]
fn what_a_log_says_of_its_failsafe_is_not_denied() {
    let timer = |timer| [[0xA3, 0x95, 148].as_slice(), &[0; 8], &[1, 2, timer]].concat();
    let tripped = timer(2);
    let mut bytes = log_of_drive();
    let is_trip = |record: &[u8]| record[..3] == tripped[..3] && record[11..] == tripped[11..];
    let place = bytes.windows(tripped.len()).position(is_trip).expect("one");
    let time = &mut bytes[place + 3..place + 11];
    // A minute after the readings have it, as if these were few.
    let time_us = u64::from_le_bytes((&*time).try_into().expect("its length"));
    time.copy_from_slice(&(time_us + 60_000_000).to_le_bytes());
    let log = file_of("timers.BIN", bytes);
    let said = |parameters: &[&str]| said_of(&[&["--pack", "2"], parameters, &[log.as_str()]].concat());
    let timers = "Timers in the log: low started 7:28, low reset 7:32, low started 7:44, low reset 7:52, \
                  low started 8:01, low tripped 9:11, low reset 13:10\n";
    for (parameters, failsafe) in [
        (&[][..], "BATT2_LOW_VOLT 10.8 acted at 9:11"),
        (
            &["--param", "BATT2_LOW_VOLT=10.8"],
            "BATT2_LOW_VOLT 10.8 acted at 9:11",
        ),
        (
            &["--param", "BATT2_CRT_VOLT=5"],
            "BATT2_LOW_VOLT 10.8 acted at 9:11",
        ),
        (
            &["--param", "BATT2_LOW_VOLT=11.1"],
            "BATT2_LOW_VOLT 11.1 would have acted at 5:30",
        ),
        (
            &["--param", "BATT2_LOW_VOLT=9"],
            "BATT2_LOW_VOLT 9 is not reached by these readings; in the log low acted at 9:11\n",
        ),
    ] {
        let text = said(parameters);
        assert!(text.contains(timers), "{text}");
        assert!(text.contains(&format!("\nFailsafe: {failsafe}")), "{text}");
        assert!(
            !text.contains("LOW_VOLT 10.8 would") && !text.contains("The replay differs"),
            "{text}"
        );
    }
    let rows = printed(replay(&["--pack", "2", &log]));
    let (_, rows) = table(&rows);
    let low = rows.iter().filter(|row| row[row.len() - 1].contains("is low"));
    let times: Vec<&str> = low.map(|row| row[0]).collect();
    assert_eq!(times.len(), 1);
    assert!(times[0].starts_with("551."), "{times:?}");
}

/// This log by a version whose BATX has no extremes.
fn without_extremes(log: &[u8]) -> Vec<u8> {
    const FORMAT: u8 = 128;
    const ESTIMATE: u8 = 141;
    const EXTREMES_BYTES: usize = 8;
    let mut lengths = HashMap::from([(FORMAT, 89)]);
    let (mut rest, mut older) = (log, vec![]);
    while let [_, _, kind, ..] = *rest {
        let (record, behind) = rest.split_at(lengths[&kind]);
        rest = behind;
        match (kind, record[3]) {
            (FORMAT, ESTIMATE) => {
                let mut format = record.to_vec();
                format[4] -= EXTREMES_BYTES as u8;
                for (text, unused) in [("QBfffffBHBB", "ff"), (",FS,Stat", ",VMin,IMax")] {
                    let place = format
                        .windows(text.len())
                        .position(|bytes| bytes == text.as_bytes());
                    let end = place.expect("it has this text") + text.len();
                    assert!(format[end..].starts_with(unused.as_bytes()));
                    format[end..][..unused.len()].fill(0);
                }
                older.extend(format);
            }
            (ESTIMATE, _) => older.extend(&record[..record.len() - EXTREMES_BYTES]),
            _ => older.extend(record),
        }
        if kind == FORMAT {
            lengths.insert(record[3], record[4].into());
        }
    }
    older
}

#[test]
fn a_log_from_before_the_means_is_read_and_said_to_be_of_moments() {
    let remark = "\nVoltage and current are of a moment each, not means: an older version recorded them\n";
    let log = log_of_drive();
    let older = without_extremes(&log);
    let name_and_kind = |kind: f32| [b"BATT2_MONITOR\0\0\0".as_slice(), &kind.to_le_bytes()].concat();
    let mut of_part = older.clone();
    let analog = name_and_kind(4.0);
    let place = older.windows(analog.len()).position(|bytes| bytes == analog);
    let place = place.expect("the log has it");
    of_part[place..][..analog.len()].copy_from_slice(&name_and_kind(21.0));
    let mut rows = vec![];
    for (bytes, is_said) in [(log, false), (older, true), (of_part, false)] {
        let output = replay(&["--pack", "2", &file_of("moments.BIN", bytes)]);
        let said = format!("\n{}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(said.contains(remark), is_said, "{said}");
        rows.push(printed(output));
    }
    assert!(rows[0] == rows[1] && rows[0] == rows[2]);
}

#[test]
fn thresholds_are_compared_with_those_of_the_log() {
    let log = file_of("own.BIN", log_of_drive());
    let said = |arguments: &[&str]| said_of(&[&["--pack", "2", log.as_str()], arguments].concat());
    assert!(!said(&[]).contains("With "));
    let text = said(&["--param", "BATT2_LOW_VOLT=11.1"]);
    let (_, compared) = text.split_once("With ").expect("a comparison");
    assert_eq!(
        compared,
        "BATT2_LOW_VOLT 11.1 instead of 10.8:\n  low would have come 2 min 41 s earlier, at 5:30 instead of 8:11\n"
    );
}

#[test]
fn a_recording_without_arming_is_taken_for_armed_on_request() {
    let rows: String = (0..400)
        .map(|tenth| format!("{},10.4\n", f64::from(tenth) / 10.0))
        .collect();
    let path = file_of("replay-without-arming.csv", format!("t_s,voltage_v\n{rows}"));
    let parameters = ["--param", "BATT_CELLS=3", "--param", "BATT_LOW_VOLT=10.5"];
    let said = said_of(&[&parameters[..], &["--armed", path.as_str()]].concat());
    assert!(
        said.contains("BATT_LOW_VOLT 10.5 would have acted at 0:1"),
        "{said}"
    );
}

#[test]
fn a_parameter_that_is_not_of_the_pack_is_refused() {
    for (pack, assignment, said) in [
        (
            "1",
            "BATT2_LOW_VOLT=10",
            "error: BATT2_LOW_VOLT is not of pack 1\n",
        ),
        ("2", "BATT_LOW_VOLT=10", "error: BATT_LOW_VOLT is not of pack 2\n"),
        ("1", "SR0_EXTRA1=4", "error: SR0_EXTRA1 is not of pack 1\n"),
        // The recording is in volts, and has no actions.
        (
            "1",
            "BATT_VOLT_MULT=4",
            "error: BATT_VOLT_MULT is not of pack 1 in a replay\n",
        ),
        (
            "1",
            "BATT_FS_LOW_ACT=2",
            "error: BATT_FS_LOW_ACT is not of pack 1 in a replay\n",
        ),
    ] {
        assert_eq!(refused(&["--pack", pack, "--param", assignment, TRACE]), said);
    }
    let table = no_file("not-of-a-pack.parquet");
    let errors = refused(&["--table", &table, "--param", "SR0_EXTRA1=4", "tests/data/logs"]);
    assert_eq!(errors, "error: SR0_EXTRA1 is not of a pack\n");
    assert!(!Path::new(&table).exists());
}

#[test]
fn every_parameter_that_a_replay_reads_is_taken() {
    for name in [
        "MONITOR",
        "CHEM",
        "CELLS",
        "CAPACITY",
        "WATT_MAX",
        "LOW_PCT",
        "CRT_PCT",
        "EMR_PCT",
        "FS_PCT_EN",
        "LOW_TIMER",
        "FS_VOLTSRC",
        "LOW_VOLT",
        "LOW_MAH",
        "CRT_VOLT",
        "CRT_MAH",
    ] {
        let value = if name == "MONITOR" { "4" } else { "1" };
        said_of(&["--param", &format!("BATT_{name}={value}"), TRACE]);
    }
}

/// A recording of a pack of two cells with 2 Ah and 0.1 Ω, which rest 0.9 V lower when empty than when full, and the load in amperes.
fn discharge(name: &str, full_v: f64, load_a: f64) -> String {
    let mut text = "t_s,voltage_v,current_a\n".to_owned();
    for seconds in (0..).step_by(10) {
        let current_a = if seconds < 120 { 0.0 } else { load_a };
        let left = 1.0 - load_a * f64::from(seconds - 120).max(0.0) / 3600.0 / 2.0;
        if left < 0.0 {
            break;
        }
        let voltage_v = 2.0 * (full_v - 0.9 * (1.0 - left)) - 0.1 * current_a;
        text += &format!("{seconds},{voltage_v:.4},{current_a}\n");
    }
    let path = root().join("target/tmp").join(name);
    fs::create_dir_all(path.parent().expect("a folder")).expect("created");
    fs::write(&path, text).expect("written");
    path.to_str().expect("text").into()
}

#[test]
fn a_curve_is_read_from_a_slow_discharge_and_makes_the_charge_right() {
    let path = discharge("curve.csv", 4.3, 0.2);
    let of_pack = ["--param", "BATT_CHEM=3", "--param", "BATT_CELLS=2"];
    let lines = printed(replay(&[&of_pack[..], &["--curve", &path]].concat()));
    let lines: Vec<_> = lines.lines().filter(|line| !line.starts_with('#')).collect();
    let values = [(10, 3.49), (30, 3.67), (50, 3.85), (70, 4.03), (90, 4.21)];
    let expected = values.map(|(percent, volts)| format!("BATT_CURVE_{percent},{volts}"));
    assert_eq!(lines[0], "BATT_CHEM,3");
    assert_eq!(lines[1..], expected);
    // By the voltage alone, half of it is left after five hours.
    let assigned: Vec<_> = lines.iter().map(|line| line.replace(',', "=")).collect();
    let mut arguments = vec!["--param", "BATT_MONITOR=3", "--param", "BATT_CAPACITY=2000"];
    arguments.extend(of_pack);
    let left_pct = |arguments: &[&str]| {
        let text = printed(replay(&[arguments, &[&path]].concat()));
        let (_, rows) = table(&text);
        rows[(120 + 5 * 3600) / 10][REMAINING_PCT]
            .parse::<f64>()
            .expect("a percentage")
    };
    let by_chemistry = left_pct(&arguments);
    arguments.extend(assigned.iter().flat_map(|assignment| ["--param", assignment]));
    let by_curve = left_pct(&arguments);
    assert!((by_curve - 50.0).abs() < 3.0, "{by_curve} %");
    assert!((by_chemistry - 50.0).abs() > 8.0, "{by_chemistry} %");
}

#[test]
fn what_is_no_curve_is_refused_and_said() {
    let of_pack = ["--curve", "--param", "BATT_CHEM=3"];
    let with_cells = ["--param", "BATT_CELLS=2"];
    let fast = discharge("fast.csv", 4.2, 1.0);
    let high = discharge("high.csv", 4.6, 0.2);
    for (path, said) in [
        (fast.as_str(), "a discharge of 2.0 h is too fast: 5 h are needed"),
        (high.as_str(), "BATT_CURVE_90 can't be 4.51: 0, 0.8 to 4.35"),
        (TRACE, "a discharge of 0.1 h is too fast: 5 h are needed"),
    ] {
        let errors = refused(&[&of_pack[..], &with_cells, &[path]].concat());
        assert!(errors.ends_with(&format!("{said}\n")), "{errors}");
    }
    let point = ["--param", "BATT_CURVE_50=1.3", TRACE];
    let errors = refused(&[&of_pack[..], &point].concat());
    assert_eq!(errors, "error: BATT_CURVE_50 can't be 1.3 with this BATT_CHEM\n");
}

#[test]
fn rows_go_to_standard_output_also_by_name() {
    let text = printed(replay(&["--csv", "-", TRACE]));
    assert_eq!(text, printed(replay(&[TRACE])));
    assert!(!root().join("-").exists());
}
