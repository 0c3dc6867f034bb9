//! Instructions that one thing takes, of a firmware that does nothing else.

use crate::figures::{Figure, Table};
use emulator::{Board, Firmware};
use workbench::elf::{Artifact, build};

/// High while something is measured.
const MEASURING_PIN: usize = 22;

/// The longest measurement is a second.
const PATIENCE_US: u64 = 10_000_000;

/// What the firmware logs at its end.
const DONE: &str = "done";

/// Instructions that the MAVLink C library takes at -O2: `mavlink_parse_char`, and `_send_struct` of each message.
const C_RECEIVE: f64 = 58.0;
const C_SERIALISE: [(&str, f64); 6] = [
    ("HEARTBEAT", 629.0),
    ("SYS_STATUS, all fields", 1359.0),
    ("SYS_STATUS, typical", 1196.0),
    ("BATTERY_STATUS, all fields", 1756.0),
    ("BATTERY_STATUS, typical", 1574.0),
    ("PARAM_VALUE", 1064.0),
];

/// Goals, as shares of the C library's counts.
const RECEIVE_GOAL: f64 = 0.6;
const SERIALISE_GOAL: f64 = 0.56;

/// Goal of a pack's tick, in instructions.
const TICK_GOAL: f64 = 6_000.0;

pub fn tables() -> Vec<Table> {
    let counts = count();
    let table = |title, verb: &str, figure: fn(&str, f64) -> Figure| {
        let of_verb = counts.iter().filter_map(|(what, instructions)| {
            let what = what.strip_prefix(verb)?.trim_start();
            Some(figure(what, *instructions))
        });
        Table::new(title, "instructions", of_verb.collect())
    };
    vec![
        table("receive", "receive", |what, instructions| {
            Figure::new(format!("{what}, in chunks of 64"), instructions)
                .with_digits(1)
                .beside_c_library(C_RECEIVE, RECEIVE_GOAL)
        }),
        table("serialise", "serialise ", serialised),
        table("build", "build", |what, instructions| {
            Figure::new(format!("{what}, from the state of the packs"), instructions)
        }),
        table("a tick of a pack", "update a pack by", |what, instructions| {
            Figure::new(format!("measured: {what}"), instructions).with_goal(TICK_GOAL)
        }),
    ]
}

fn serialised(what: &str, instructions: f64) -> Figure {
    let figure = Figure::new(what, instructions);
    match C_SERIALISE.iter().find(|(name, _)| *name == what) {
        Some((_, c_library)) => figure.beside_c_library(*c_library, SERIALISE_GOAL),
        None => figure,
    }
}

/// What was counted, and the instructions of one time.
fn count() -> Vec<(String, f64)> {
    let firmware = Firmware::load(build(Artifact::Example("instruction_counts")));
    let mut board = Board::power_up(&firmware, 1);
    let mut counts = Vec::new();
    loop {
        board.run_until(PATIENCE_US, |board| is_measuring(board) || is_done(board));
        if is_done(&board) {
            return counts;
        }
        // Behind the measurement another line may follow at once.
        let (what, times) = announced(&board);
        let start = board.instructions();
        assert!(board.run_until(PATIENCE_US, |board| !is_measuring(board)));
        let instructions = board.instructions() - start;
        counts.push((what, instructions as f64 / times));
    }
}

fn is_measuring(board: &mut Board) -> bool {
    board.pin_level(MEASURING_PIN) == Some(true)
}

fn is_done(board: &Board) -> bool {
    board.log_lines().last().is_some_and(|line| line.text == DONE)
}

/// What the firmware has said of the measurement: "serialise HEARTBEAT, 1000 times".
fn announced(board: &Board) -> (String, f64) {
    let line = board.log_lines().last().map(|line| line.text.as_str());
    let said = line.and_then(|line| line.strip_suffix(" times")?.rsplit_once(", "));
    let (what, times) = said.expect("the firmware says what it does");
    (what.to_owned(), times.parse().expect("and how often"))
}
