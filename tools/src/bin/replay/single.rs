//! The replay of one recording.

use std::fs;
use std::io::{self, ErrorKind, Write};
use std::path::Path;

use rover_battmon::battery::LearntPack;
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, ParameterId, Parameters};
use rover_battmon_tools::recordings::Format;
use rover_battmon_tools::recordings::entry::Bytes;

use crate::arguments::Arguments;
use crate::assignments::Assignment;
use crate::comparison::comparison;
use crate::drive::{Change, Drive};
use crate::failsafes::Timers;
use crate::report::Row;
use crate::run::{Outcome, Replay};
use crate::summary::Summary;
use crate::survey::Survey;
use crate::vehicle::Vehicle;
use crate::words::{about, clock, counted, shown, utc};
use crate::{curve, outputs, plot, report, run};

/// Settings without which the charge is not known.
const NEEDED: [BatteryParameter; 2] = [BatteryParameter::Cells, BatteryParameter::Capacity];

/// Low and critical.
const LEVELS: usize = 2;

/// This many changes of timers are listed.
const LISTED_TIMERS: usize = 20;

/// Replays one recording.
///
/// # Errors
/// An error of the recording, an argument or a file, in words.
pub fn replay(path: &Path, arguments: &Arguments) -> Result<(), String> {
    outputs::check(arguments, &arguments.paths)?;
    let pack = arguments.pack;
    run::check_packs(&arguments.assignments, &[pack])?;
    let mut drive = read(path, arguments)?;
    if arguments.armed {
        drive.trace.arm_throughout();
    }
    let own = drive.survey.parameters.clone();
    let own = own.unwrap_or_else(Parameters::defaults);
    let parameters = run::assign(own, &arguments.assignments, pack, drive.trace.measured())?;
    let known = match &arguments.learned {
        Some(path) => read_learnt(path)?,
        None => drive.survey.known(pack).unwrap_or(LearntPack::UNKNOWN),
    };
    let replay = Replay::new(pack, &parameters, &arguments.assignments, known)?;
    let mut outcome = run::run(&drive.trace, replay);
    if arguments.curve {
        let cells = outcome.rows.last().and_then(|row| row.state.cell_count);
        let lines =
            curve::lines(&drive.trace, &parameters, pack, cells).map_err(|error| about(path, &error))?;
        return print(&lines).map_err(|error| format!("standard output: {error}"));
    }
    if !arguments.armed {
        follow(&mut outcome, &drive, pack, &parameters, &arguments.assignments)?;
    }
    let written = write_files(path, arguments, &outcome)?;
    let summary = Summary {
        trace: &drive.trace,
        outcome: &outcome,
        pack,
        assignments: &arguments.assignments,
        known: &known,
        armed_before: drive.survey.armed_before().filter(|_| !arguments.armed),
        in_log: drive.survey.recorded_levels(pack),
        recorded: recorded(&drive, arguments, &outcome),
    };
    let compared = compared(arguments, &drive, &parameters, &outcome.rows, known)?;
    let explained = match arguments.explain {
        Some(at_s) => {
            let replay = Replay::new(pack, &parameters, &arguments.assignments, known)?;
            run::explain(&drive.trace, replay, at_s).map_err(|error| about(path, &error))?
        }
        None => String::new(),
    };
    let origin = origin(&drive, arguments);
    show(&format!("{origin}{summary}{compared}{explained}{written}"));
    Ok(())
}

/// Has the levels follow the log whose thresholds are its own.
fn follow(
    outcome: &mut Outcome,
    drive: &Drive,
    pack: Pack,
    parameters: &Parameters,
    assignments: &[Assignment],
) -> Result<(), String> {
    let Drive { trace, survey } = drive;
    let is_assigned = |change: &Change| {
        let mut assigned = assignments.iter();
        assigned.any(|assignment| assignment.id == change.assignment.id)
    };
    if !survey.records_failsafe(pack) || trace.changes.iter().any(is_assigned) {
        return Ok(());
    }
    let own = survey.parameters.clone().unwrap_or_else(Parameters::defaults);
    let own = run::assign(own, &[], pack, trace.measured())?;
    let levels = run::unchanged_levels(&run::settings(&own, pack), &run::settings(parameters, pack));
    outcome.follow(levels, survey.reached(pack), survey.recorded_timers(pack));
    Ok(())
}

/// Origin of a log, and what it lacks; of a trace nothing.
fn origin(drive: &Drive, arguments: &Arguments) -> String {
    let survey = &drive.survey;
    let mut text = String::new();
    if survey.vehicle != Vehicle::default() {
        text += &format!("Recorded by {}\n", survey.vehicle);
    }
    if let Some(utc_s) = drive.began_utc_s() {
        text += &format!("Recorded from {} on\n", utc(utc_s));
    }
    if let Some(end) = &survey.run_before {
        text += &format!("Before: {end}\n");
    }
    if let Some(id) = survey.system_id.filter(|_| !survey.other_systems.is_empty()) {
        let others = survey.other_systems.iter();
        let others = others.map(|(id, readings)| format!("{id} ({})", counted(*readings, "reading")));
        let others: Vec<String> = others.collect();
        text += &format!(
            "Replayed vehicle {id}; the log also has {} (--system)\n",
            others.join(", ")
        );
    }
    if survey.is_from_sys_status {
        text += "Readings are of SYS_STATUS: the log has no BATTERY_STATUS of pack 1\n";
    }
    if let Some(steps) = survey.clock_text() {
        text += &format!("The {steps}\n");
    }
    if survey.is_of_moments(arguments.pack) {
        text += "Voltage and current are of a moment each, not means: an older version recorded them\n";
    }
    if survey.stepped_back > 0 {
        let count = survey.stepped_back;
        text += &format!("Skipped: {} whose times step back\n", counted(count, "reading"));
    }
    let missing = missing(survey, arguments);
    if !missing.is_empty() {
        let names: Vec<String> = missing.iter().map(|id| id.name().to_string()).collect();
        text += &format!("Not in the log: {} (--param)\n", names.join(", "));
    }
    text
}

/// The failsafes of a log, and, if nothing was assigned, whether the replay differs.
fn recorded(drive: &Drive, arguments: &Arguments, outcome: &Outcome) -> String {
    let survey = &drive.survey;
    let levels = survey.recorded_levels(arguments.pack);
    let events = [
        ("low", levels.low_s),
        ("critical", levels.critical_s),
        ("a pack's failsafe", survey.unnamed_failsafe_s()),
        ("another mode for it", survey.failsafe_mode_s()),
    ];
    let events = events.into_iter().filter_map(|(name, time_s)| {
        let time_s = time_s?;
        Some(format!("{name} at {}", clock(time_s)))
    });
    let events: Vec<String> = events.collect();
    let mut text = match events.as_slice() {
        [] => String::new(),
        events => format!("The log has: {}\n", events.join(", ")),
    };
    let timers = survey.recorded_timers(arguments.pack);
    if *timers != Timers::default() {
        text += &format!("Timers in the log: {}\n", listed(&timers.texts(clock)));
        if outcome.recorded.len() < LEVELS {
            text += &format!("Timers in the replay: {}\n", listed(&outcome.timers.texts(clock)));
        }
    }
    let is_of_others = !survey.records_failsafe(arguments.pack) && survey.announces_failsafes();
    if is_of_others && arguments.assignments.is_empty() && !arguments.armed {
        let differences = levels.differences(&outcome.levels);
        if !differences.is_empty() {
            let differences: Vec<String> = differences.iter().map(ToString::to_string).collect();
            text += &format!("The replay differs: {}\n", differences.join("; "));
        }
    }
    text
}

/// The first of them, and how many follow.
fn listed(texts: &[String]) -> String {
    let (first, more) = texts.split_at(texts.len().min(LISTED_TIMERS));
    match (first, more) {
        ([], _) => "none".into(),
        (first, []) => first.join(", "),
        (first, more) => format!("{}, {} more", first.join(", "), more.len()),
    }
}

/// Settings that the estimate needs, and that neither the log nor the user has; none of a trace.
fn missing(survey: &Survey, arguments: &Arguments) -> Vec<ParameterId> {
    let is_log = survey.measured(arguments.pack).is_some();
    let is_missing = |id: &ParameterId| {
        let is_assigned = arguments
            .assignments
            .iter()
            .any(|assignment| assignment.id == *id);
        is_log && !is_assigned && !survey.has_parameter(*id)
    };
    NEEDED
        .map(|parameter| parameter.of(arguments.pack))
        .into_iter()
        .filter(is_missing)
        .collect()
}

/// Writes what was asked for, and returns a line for each file.
fn write_files(recording: &Path, arguments: &Arguments, outcome: &Outcome) -> Result<String, String> {
    let files = [
        arguments
            .learned
            .as_deref()
            .map(|path| (path, outcome.learnt.to_string())),
        arguments
            .plot
            .as_deref()
            .map(|path| (path, picture(recording, arguments, outcome))),
        arguments
            .csv_file()
            .map(|path| (path, report::csv(&outcome.rows))),
    ];
    let mut written = String::new();
    for (path, text) in files.into_iter().flatten() {
        fs::write(path, text).map_err(|error| about(path, &error))?;
        written += &format!("wrote {}\n", shown(path));
    }
    if arguments.prints_rows() {
        print(&report::csv(&outcome.rows)).map_err(|error| format!("standard output: {error}"))?;
    }
    Ok(written)
}

/// Changes of a log's own parameters by the arguments, and their effect; empty if there are none.
fn compared(
    arguments: &Arguments,
    drive: &Drive,
    parameters: &Parameters,
    rows: &[Row],
    known: LearntPack,
) -> Result<String, String> {
    let Some(own) = drive.survey.parameters.clone() else {
        return Ok(String::new());
    };
    let pack = arguments.pack;
    let own = run::assign(own, &[], pack, drive.trace.measured())?;
    let changes = run::changes(&own, parameters, &arguments.assignments);
    if changes.is_empty() {
        return Ok(String::new());
    }
    let replay = Replay::new(pack, &own, &[], known)?;
    let mut by_own = run::run(&drive.trace, replay);
    if !arguments.armed {
        follow(&mut by_own, drive, pack, &own, &[])?;
    }
    Ok(comparison(&changes, &by_own.rows, rows))
}

/// Shows what a person reads, who may have closed the terminal.
fn show(text: &str) {
    let _ = io::stderr().write_all(text.as_bytes());
}

fn read(path: &Path, arguments: &Arguments) -> Result<Drive, String> {
    let in_words = |error: String| about(path, &error);
    let format = Format::of(path, arguments.system).map_err(in_words)?;
    if format == Format::Csv {
        // Neither of a vehicle nor of a certain pack.
        let drive = Drive::read(|| format.open(path), Pack::First).map_err(in_words)?;
        let survey = Survey::default();
        return Ok(Drive { survey, ..drive });
    }
    let drive = Drive::read(|| format.open(path), arguments.pack).map_err(in_words)?;
    let Bytes { read, skipped, cut } = drive.survey.bytes;
    if skipped > 0 {
        eprintln!(
            "{}: skipped {skipped} of {read} bytes that are not whole records",
            shown(path)
        );
    }
    if cut > 0 {
        eprintln!(
            "{}: the last record is cut: {}",
            shown(path),
            counted(cut, "byte")
        );
    }
    Ok(drive)
}

/// Learnt data of earlier drives; none before the first, and in a pipe.
fn read_learnt(path: &Path) -> Result<LearntPack, String> {
    if !path.is_file() {
        return Ok(LearntPack::UNKNOWN);
    }
    let text = fs::read_to_string(path).map_err(|error| about(path, &error))?;
    text.parse().map_err(|error| about(path, &error))
}

/// The rows as a picture that says what it shows.
fn picture(recording: &Path, arguments: &Arguments, outcome: &Outcome) -> String {
    let trace = shown(recording.file_name().unwrap_or_default());
    let assignments: Vec<String> = arguments.assignments.iter().map(ToString::to_string).collect();
    let title = format!("{trace} through the battery monitor");
    plot::plot(
        &outcome.rows,
        &title,
        &assignments.join("  "),
        &outcome.settings.failsafe,
    )
}

fn print(text: &str) -> io::Result<()> {
    match io::stdout().write_all(text.as_bytes()) {
        // Its reader has closed the pipe.
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        result => result,
    }
}
