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
svg { width: 100%; height: auto }
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
    for life in &lives {
        let class = match life.attention() {
            Attention::Needed => " class=\"attention\"",
            Attention::NotNeeded => "",
        };
        let (name, sentence) = (escaped(&life.name), escaped(&life.sentence()));
        let chart = chart::chart(life);
        let _ = writeln!(
            page,
            "<section{class}>\n<h2>{name}</h2>\n<p>{sentence}</p>\n{chart}</section>"
        );
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

    #[test]
    fn the_headline_counts() {
        assert_eq!(headline(0, 0), "No pack");
        assert_eq!(headline(0, 3), "None of 3 packs needs attention");
        assert_eq!(headline(1, 3), "1 of 3 packs needs attention");
        assert_eq!(headline(2, 14), "2 of 14 packs need attention");
    }

    #[test]
    fn what_a_log_names_is_text_on_the_page() {
        let row = Row {
            path: "<b>/x.BIN".into(),
            pack: 1,
            ..Row::default()
        };
        let page = page(&[row]);
        assert!(page.contains("&lt;b&gt;") && !page.contains("<b>"), "{page}");
        // Nothing has to be fetched.
        assert!(
            !page.replace("http://www.w3.org/2000/svg", "").contains("http"),
            "{page}"
        );
    }
}
