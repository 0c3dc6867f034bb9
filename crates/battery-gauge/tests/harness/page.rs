//! The documentation of the crate's accuracy: a table of its accuracy, and a picture of two drives.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use crate::drive::Drive;
use crate::estimator::{Estimator, Monitor, Report};
use crate::score::run;
use crate::table::{Figure, Goal, Row};

const BEGINS: &str = "<!-- accuracy begins -->\n";
const ENDS: &str = "<!-- accuracy ends -->";

/// Rows that show how the estimator is sound rather than how accurate.
const NOT_SHOWN: [&str; 3] = ["moved by", "bad input", "simulated weeks"];

fn document(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../docs")
        .join(name)
}

/// Writes the table into the page, and the picture beside it.
pub fn write(rows: &[Row], pictured: &Drive) {
    let path = document("battery-model.md");
    let text = fs::read_to_string(&path).expect("the page");
    let (before, rest) = text.split_once(BEGINS).expect("where the table begins");
    let (_, after) = rest.split_once(ENDS).expect("where it ends");
    let text = format!("{before}{BEGINS}{}{ENDS}{after}", table(rows));
    fs::write(path, text).expect("writable");
    fs::write(document("pictures/battery-model.svg"), picture(pictured)).expect("writable");
}

/// A line for the figures of one part that have a goal: those of several cells together.
fn table(rows: &[Row]) -> String {
    let mut text = "| figure | smallest to largest, median | goal |\n|---|---|---|\n".to_owned();
    let is_shown = |row: &&Row| !NOT_SHOWN.iter().any(|name| row.name.starts_with(name));
    for row in rows.iter().filter(is_shown) {
        writeln!(text, "| **{}** | | |", row.name).expect("memory");
        let groups = row
            .figures
            .chunk_by(|figure, next| figure.part == next.part && !figure.member.is_empty());
        for group in groups.filter(|group| !matches!(group[0].goal, Goal::None)) {
            if let Some(figures) = values(group) {
                let goal = group[0].goal.absolute();
                writeln!(text, "| {} | {figures} | {goal} |", group[0].part).expect("memory");
            }
        }
    }
    text
}

/// The values, as read; `None` where nothing was judged.
fn values(group: &[Figure]) -> Option<String> {
    let judged: Vec<f64> = group.iter().filter_map(|figure| figure.value).collect();
    let mut known: Vec<f64> = judged.iter().copied().filter(|value| !value.is_nan()).collect();
    known.sort_by(f64::total_cmp);
    let unknown = judged.len() - known.len();
    let text = match known[..] {
        [] if unknown == 0 => return None,
        [] => "unknown".into(),
        [value] => format!("{value:.2}"),
        [first, .., last] => format!("{first:.2} to {last:.2}, {:.2}", known[known.len() / 2]),
    };
    let more = if known.is_empty() || unknown == 0 {
        String::new()
    } else {
        format!("; unknown: {unknown}")
    };
    Some(text + &more)
}

/// Size of the picture and of a drive in it, and the place of its axes.
const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 330.0;
const PANEL: f64 = 330.0;
const TOP: f64 = 50.0;
const FOOT: f64 = 270.0;

/// Two equal drives of a pack whose label is a fifth too high, estimated and true.
fn picture(drive: &Drive) -> String {
    let settings = drive.cell.settings(1.2 * drive.capacity_ah);
    let mut estimator = Monitor::default();
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" \
         font-size=\"13\">\n<rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#fff\"/>\n"
    );
    for (number, left) in [(1, 50.0), (2, 410.0)] {
        let reports = run(&mut estimator, &settings, &drive.samples);
        let learnt_ah = estimator.capacity_ah().expect("a drive that teaches");
        let under = if number == 1 {
            format!(
                "label {:.2} Ah, true {:.2} Ah",
                1.2 * drive.capacity_ah,
                drive.capacity_ah
            )
        } else {
            format!("learnt by now: {learnt_ah:.2} Ah")
        };
        text += &panel(drive, &reports, left, &format!("Drive {number}"), &under);
    }
    text + "<text x=\"50\" y=\"20\"><tspan fill=\"#06c\">estimated state of charge, ± two deviations</tspan>\
            <tspan dx=\"20\" fill=\"#c30\">true (dashed)</tspan></text>\n</svg>\n"
}

fn panel(drive: &Drive, reports: &[Report], left: f64, title: &str, under: &str) -> String {
    let end_s = drive.seconds(reports.len() - 1);
    let x = |at: usize| left + PANEL * drive.seconds(at) / end_s;
    let y = |pct: f64| FOOT - (FOOT - TOP) * pct.clamp(0.0, 100.0) / 100.0;
    let (mut estimate, mut upper, mut lower, mut truth) = (String::new(), vec![], vec![], String::new());
    for at in (0..reports.len()).step_by(100) {
        let true_pct = drive.truth_pct[at];
        write!(truth, "{:.1},{:.1} ", x(at), y(true_pct)).expect("memory");
        let Some((pct, sigma_pct)) = reports[at].remaining_pct.zip(reports[at].sigma_pct) else {
            continue;
        };
        let (pct, sigma_pct) = (f64::from(pct), f64::from(sigma_pct));
        write!(estimate, "{:.1},{:.1} ", x(at), y(pct)).expect("memory");
        upper.push(format!("{:.1},{:.1}", x(at), y(pct + 2.0 * sigma_pct)));
        lower.push(format!("{:.1},{:.1}", x(at), y(pct - 2.0 * sigma_pct)));
    }
    lower.reverse();
    let mut text = String::new();
    for pct in [0, 25, 50, 75, 100] {
        let level = y(f64::from(pct));
        writeln!(
            text,
            "<path d=\"M{left} {level}h{PANEL}\" stroke=\"#ddd\"/>\
             <text x=\"{}\" y=\"{}\" text-anchor=\"end\" fill=\"#555\">{pct} %</text>",
            left - 4.0,
            level + 4.0
        )
        .expect("memory");
    }
    let minutes = end_s / 60.0;
    writeln!(
        text,
        "<polygon points=\"{} {}\" fill=\"#06c\" fill-opacity=\"0.15\"/>\n\
         <polyline points=\"{estimate}\" fill=\"none\" stroke=\"#06c\" stroke-width=\"2\"/>\n\
         <polyline points=\"{truth}\" fill=\"none\" stroke=\"#c30\" stroke-width=\"1.5\" stroke-dasharray=\"5 4\"/>\n\
         <text x=\"{left}\" y=\"{}\" font-weight=\"bold\">{title}</text>\n\
         <text x=\"{left}\" y=\"{}\" fill=\"#555\">0</text>\
         <text x=\"{}\" y=\"{}\" text-anchor=\"end\" fill=\"#555\">{minutes:.0} min</text>\n\
         <text x=\"{left}\" y=\"{}\">{under}</text>",
        upper.join(" "),
        lower.join(" "),
        TOP - 8.0,
        FOOT + 16.0,
        left + PANEL,
        FOOT + 16.0,
        FOOT + 38.0,
    )
    .expect("memory");
    text
}
