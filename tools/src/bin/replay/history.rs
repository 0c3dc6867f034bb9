//! The life of each pack over its drives, as a page: those that need attention first.

mod chart;
mod life;

use std::fmt::Write;

use self::life::{Attention, Life};
use crate::plot::svg::escaped;
use crate::table::Row;
use crate::words::{counted, date};

/// Whole in itself; on paper each pack stays on one sheet.
const HEAD: &str = "<!DOCTYPE html>
<html lang=\"en\">
<meta charset=\"utf-8\">
<meta name=\"viewport\" content=\"width=device-width\">
<title>Packs</title>
<style>
body { font: 1rem/1.5 sans-serif; color: #222; background: #fff; max-width: 62rem; margin: 2rem auto; padding: 0 1rem }
h1 { line-height: 1.2 }
section { border-top: 1px solid #ccc; break-inside: avoid }
.attention h2 { color: #a01818 }
p { overflow-wrap: anywhere }
nav { columns: 8rem }
nav a { display: block }
svg { width: 30rem; max-width: 100%; height: auto }
@media screen and (prefers-color-scheme: dark) {
body, svg { color: #ddd; background: #1b1b1b; fill: #ddd }
a { color: #8ab4f8 }
.attention h2 { color: #ff8a80 }
section { border-color: #555 }
[fill=\"#ffffff\"] { fill: #1b1b1b }
[stroke=\"#cccccc\"] { stroke: #444 }
[stroke=\"#5b3a8c\"] { stroke: #b39ddb }
[fill=\"#5b3a8c\"] { fill: #b39ddb }
polygon { fill-opacity: 0.3 }
}
@media print { body { margin: 0; max-width: none; font-size: 10pt } }
</style>
";

/// The page with the packs of these drives.
pub fn page(rows: &[Row]) -> String {
    let lives = Life::all(rows);
    let needing = lives.iter().filter(|life| life.attention() == Attention::Needed);
    let mut page = HEAD.to_owned();
    // A String takes everything.
    let _ = writeln!(page, "<h1>{}</h1>", headline(needing.count(), lives.len()));
    let _ = writeln!(page, "<p>{}</p>", escaped(&extent(rows)));
    let (unknown, known): (Vec<&Life>, Vec<&Life>) = lives.iter().partition(|life| life.is_unknown());
    if !known.is_empty() {
        let _ = writeln!(page, "{}", contents(&known));
    }
    for (life, number) in known.iter().zip(1..) {
        let class = match life.attention() {
            Attention::Needed => " class=\"attention\"",
            Attention::NotNeeded => "",
        };
        let [name, sentence, last] =
            [&life.name, &life.sentence(), &life.last_drive()].map(|text| escaped(text));
        let charts = chart::charts(life);
        let _ = writeln!(
            page,
            "<section id=\"{number}\"{class}>\n<h2>{name}</h2>\n<p>{sentence}<br>{last}</p>\n{charts}</section>"
        );
    }
    if !unknown.is_empty() {
        let _ = writeln!(page, "<p>{}</p>", escaped(&not_known(&unknown)));
    }
    page + "</html>\n"
}

/// Whether this is the beginning of such a page.
pub fn is_page(head: &str) -> bool {
    let before_looks = HEAD.find("<style>").and_then(|end| HEAD.get(..end));
    before_looks.is_some_and(|before_looks| head.starts_with(before_looks))
}

fn headline(needing: usize, all: usize) -> String {
    match (needing, all) {
        (_, 0) => "No pack".into(),
        (0, all) => format!("None of {all} packs needs attention"),
        (1, all) => format!("1 of {all} packs needs attention"),
        (needing, all) => format!("{needing} of {all} packs need attention"),
    }
}

/// A link to each pack.
fn contents(lives: &[&Life]) -> String {
    let link = |(life, number): (&&Life, u32)| format!("<a href=\"#{number}\">{}</a>", escaped(&life.name));
    let links: Vec<String> = lives.iter().zip(1..).map(link).collect();
    format!("<nav>{}</nav>", links.join("\n"))
}

/// The packs of which there is nothing to show.
fn not_known(lives: &[&Life]) -> String {
    let names: Vec<&str> = lives.iter().map(|life| life.name.as_str()).collect();
    let packs = counted(lives.len() as u64, "pack");
    format!(
        "Nothing is known of the age of {packs}; that needs a current sensor, and drives that begin and end at rest: {}.",
        names.join(", ")
    )
}

fn extent(rows: &[Row]) -> String {
    let dates_s = || rows.iter().filter_map(|row| row.start_utc_s);
    let drives = counted(rows.len() as u64, "drive");
    match dates_s()
        .min_by(f64::total_cmp)
        .zip(dates_s().max_by(f64::total_cmp))
    {
        Some((first_s, last_s)) => format!("{drives}, {} to {}", date(first_s), date(last_s)),
        None => drives,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::Estimate;

    #[test]
    fn the_headline_counts() {
        assert_eq!(headline(0, 0), "No pack");
        assert_eq!(headline(0, 3), "None of 3 packs needs attention");
        assert_eq!(headline(1, 3), "1 of 3 packs needs attention");
        assert_eq!(headline(2, 14), "2 of 14 packs need attention");
    }

    /// A pack with a learnt capacity in a log that may name anything.
    fn known(number: i32) -> Row {
        Row {
            path: "<b>/x.BIN".into(),
            pack: 1,
            serial_number: Some(number),
            system_id: Some(7),
            start_utc_s: Some(1_777_800_000.0),
            capacity_mah: Estimate {
                value: Some(2200.0),
                sigma: Some(20.0),
            },
            ..Row::default()
        }
    }

    #[test]
    fn what_a_log_names_is_text_on_the_page() {
        let page = page(&[known(1)]);
        assert!(page.contains("&lt;b&gt;") && !page.contains("<b>"), "{page}");
        // Nothing has to be fetched.
        assert!(
            !page.replace("http://www.w3.org/2000/svg", "").contains("http"),
            "{page}"
        );
    }

    #[test]
    fn packs_of_which_nothing_is_known_are_one_line() {
        let unknown = (0..30).map(|number| Row {
            serial_number: Some(100 + number),
            ..Row::default()
        });
        let rows: Vec<Row> = unknown.chain([known(1), known(2)]).collect();
        let page = page(&rows);
        assert_eq!(
            (page.matches("<section").count(), page.matches("<svg").count()),
            (2, 2)
        );
        assert!(
            page.contains("<a href=\"#2\">Pack 2</a>") && page.contains("<section id=\"2\">"),
            "{page}"
        );
        let lines: Vec<&str> = page.lines().filter(|line| line.contains("Pack 129")).collect();
        assert!(
            lines.len() == 1 && lines[0].starts_with("<p>Nothing is known of the age of 30 packs;"),
            "{lines:?}"
        );
        assert!(
            page.contains("Last drive on 2026-05-03 09:20 UTC with rover 7: "),
            "{page}"
        );
        // The only drive's date is at its axis.
        assert!(page.contains(">2026-05-03</text>"), "{page}");
        // No band without a deviation, and no legend of it.
        assert_eq!(page.matches(">± 2 sigma</text>").count(), 2);
    }
}
