//! The estimates for a trace, as a picture: voltages, current, and the remaining charge with its uncertainty, the
//! usable charge and the charge states.

pub mod axis;
pub mod panel;
pub mod svg;

use rover_battmon::battery::{ChargeState, Extremes, FailsafeSettings, Readings};

use self::axis::Axis;
use self::panel::{LEFT, PANEL_HEIGHT, Panel, Series};
use self::svg::{Anchor, Svg};
use crate::report::{self, Row};

/// Of the picture, and where its diagrams end, in pixels: names of limits are beside them.
const WIDTH: f64 = 1000.0;
const RIGHT: f64 = WIDTH - 115.0;

/// A background that is narrower, in pixels, can't be seen, and would only have a legend.
const LEAST_BAND: f64 = 1.0;

/// Above the diagrams, in pixels.
const HEAD_HEIGHT: f64 = 56.0;

const VOLTAGE: &str = "#1f5fa8";
const RESTING: &str = "#d1662c";
const CURRENT: &str = "#2c7a4b";
const REMAINING: &str = "#5b3a8c";
const USABLE: &str = "#b0407a";
const REPORTED: &str = "#888888";

/// The bands of single conversions, and their name.
const CONVERSIONS: &str = "single conversions";
const VOLTAGE_BAND: &str = "#a9c4e4";
const CURRENT_BAND: &str = "#a8d5b9";

/// The band around the remaining charge: standard deviations, and its name.
pub const BAND_SIGMAS: f32 = 2.0;
pub const BAND: &str = "± 2 sigma";
const BAND_COLOUR: &str = "#c9b8e0";

/// Texts of events are written in this many lines by turns, so that they do not cover each other.
const EVENT_LINES: usize = 6;

/// The rows as an SVG picture: `title` is what was replayed, `subtitle` what it was replayed with, and `failsafe` when the
/// pack counted as low. The same rows always make the same picture.
pub fn plot(rows: &[Row], title: &str, subtitle: &str, failsafe: &FailsafeSettings) -> String {
    let time = Axis::over_time(rows.iter().map(|row| row.time_s), 10);
    let mut svg = sheet();
    svg.headline((LEFT, 28.0), title);
    svg.text((LEFT, 48.0), Anchor::Start, subtitle);
    voltages(&mut svg, &time, rows, failsafe);
    currents(&mut svg, &time, rows);
    remaining(&mut svg, &time, rows);
    svg.finish()
}

fn sheet() -> Svg {
    Svg::new(WIDTH, HEAD_HEIGHT + 3.0 * PANEL_HEIGHT)
}

/// Whether this is the beginning of such a picture.
pub fn is_plot(head: &str) -> bool {
    head.lines().next() == sheet().finish().lines().next()
}

/// Right edge and top of a diagram.
fn place(number: u32) -> (f64, f64) {
    (RIGHT, HEAD_HEIGHT + f64::from(number) * PANEL_HEIGHT)
}

fn series<'a>(
    rows: &[Row],
    name: &'a str,
    colour: &'a str,
    value: impl Fn(&Readings) -> Option<f32>,
) -> Series<'a> {
    let point = |row: &Row| (row.time_s, value(&row.state.readings).map(f64::from));
    Series::new(name, colour, rows.iter().map(point).collect())
}

fn voltages(svg: &mut Svg, time: &Axis, rows: &[Row], failsafe: &FailsafeSettings) {
    let lines = [
        series(rows, "resting voltage", RESTING, |now| now.resting_voltage_v),
        series(rows, "terminal voltage", VOLTAGE, |now| now.voltage_v),
    ];
    let band = conversions(rows, VOLTAGE_BAND, |now, extremes| {
        Some((extremes.lowest_voltage_v?, now.voltage_v?))
    });
    let limits = [
        ("BATT_LOW_VOLT", failsafe.low.voltage_v),
        ("BATT_CRT_VOLT", failsafe.critical.voltage_v),
    ];
    let limits = limits
        .into_iter()
        .filter_map(|(name, limit_v)| Some((name, f64::from(limit_v?))));
    let limits_v = limits.clone().map(|(_, limit_v)| limit_v);
    let values = lines.iter().chain(&band).flat_map(Series::values);
    let panel = Panel::new(
        "Voltage (V)",
        place(0),
        time,
        Axis::over(values.chain(limits_v), 6),
    );
    draw_on_band(svg, &panel, &lines, &band);
    for (name, limit_v) in limits {
        panel.limit(svg, limit_v, name);
    }
    marks(svg, &panel, rows);
}

fn currents(svg: &mut Svg, time: &Axis, rows: &[Row]) {
    let lines = [series(rows, "current", CURRENT, |now| now.current_a)];
    let band = conversions(rows, CURRENT_BAND, |now, extremes| {
        Some((now.current_a?, extremes.highest_current_a?))
    });
    let values = lines.iter().chain(&band).flat_map(Series::values);
    let panel = Panel::new("Current (A)", place(1), time, Axis::over(values, 6));
    draw_on_band(svg, &panel, &lines, &band);
    marks(svg, &panel, rows);
}

/// Lower and upper limit of the band of single conversions, a mean and an extreme; unknown in a log without extremes.
fn conversions(
    rows: &[Row],
    colour: &'static str,
    limits: impl Fn(&Readings, &Extremes) -> Option<(f32, f32)>,
) -> [Series<'static>; 2] {
    let limits: Vec<_> = rows
        .iter()
        .zip(extremes(rows))
        .map(|(row, extremes)| (row.time_s, limits(&row.state.readings, &extremes).unzip()))
        .collect();
    let lower = limits
        .iter()
        .map(|(time_s, (low, _))| (*time_s, low.map(f64::from)));
    let upper = limits
        .iter()
        .map(|(time_s, (_, high))| (*time_s, high.map(f64::from)));
    [lower.collect(), upper.collect()].map(|points| Series::new(CONVERSIONS, colour, points))
}

/// Extremes at each row: those of the next report, as it has all since the one before.
fn extremes(rows: &[Row]) -> Vec<Extremes> {
    let mut next = Extremes::default();
    let mut extremes: Vec<_> = rows
        .iter()
        .rev()
        .map(|row| {
            next = row
                .reported
                .and_then(|reported| reported.extremes)
                .unwrap_or(next);
            next
        })
        .collect();
    extremes.reverse();
    extremes
}

fn draw_on_band(svg: &mut Svg, panel: &Panel, lines: &[Series], [lower, upper]: &[Series; 2]) {
    let legend = lower.is_known().then_some((CONVERSIONS, lower.colour));
    panel.between(svg, lower, upper);
    panel.draw(svg, lines, legend.as_slice());
}

fn remaining(svg: &mut Svg, time: &Axis, rows: &[Row]) {
    let mut lines = vec![
        series(rows, "remaining charge", REMAINING, |now| now.remaining_pct),
        series(rows, "usable charge", USABLE, |now| now.usable_pct),
    ];
    lines.extend(reported(rows));
    let panel = Panel::new(
        "Remaining charge (%)",
        place(2),
        time,
        Axis::over([0.0, 100.0], 5),
    );
    let mut shown = vec![];
    for (from_s, to_s, state) in bands(rows) {
        if panel.width(from_s, to_s) < LEAST_BAND {
            continue;
        }
        let (name, colour) = looks(state);
        panel.band(svg, from_s, to_s, colour);
        if !shown.contains(&(name, colour)) {
            shown.push((name, colour));
        }
    }
    let [lower, upper] = [-BAND_SIGMAS, BAND_SIGMAS].map(|sigmas| {
        series(rows, BAND, BAND_COLOUR, move |now| {
            let limit_pct = now.remaining_pct? + sigmas * now.remaining_sigma_pct?;
            Some(limit_pct.clamp(0.0, 100.0))
        })
    });
    panel.between(svg, &lower, &upper);
    if lower.is_known() {
        shown.insert(0, (BAND, BAND_COLOUR));
    }
    panel.draw(svg, &lines, &shown);
    marks(svg, &panel, rows);
    events(svg, &panel, rows);
}

/// The remaining charge that the board reported, in a log of its own.
fn reported(rows: &[Row]) -> Option<Series<'static>> {
    rows.iter().any(|row| row.reported.is_some()).then(|| {
        let remaining_pct = |row: &Row| row.reported?.remaining_pct.map(f64::from);
        let points = rows.iter().map(|row| (row.time_s, remaining_pct(row)));
        Series::new("reported", REPORTED, points.collect())
    })
}

/// From when to when each charge state lasted. A charge that is not known is not fine.
fn bands(rows: &[Row]) -> impl Iterator<Item = (f64, f64, ChargeState)> {
    let state = |row: &Row| match (row.state.charge_state, row.state.readings.remaining_pct) {
        (ChargeState::Ok, None) => ChargeState::Undefined,
        (state, _) => state,
    };
    let starts = move || {
        rows.chunk_by(move |a, b| state(a) == state(b))
            .filter_map(<[Row]>::first)
    };
    // Each lasts until the next begins.
    let ends = starts().skip(1).chain(rows.last());
    starts()
        .zip(ends)
        .map(move |(start, end)| (start.time_s, end.time_s, state(start)))
}

/// When something happened.
fn marks(svg: &mut Svg, panel: &Panel, rows: &[Row]) {
    for row in rows.iter().filter(|row| !row.events.is_empty()) {
        panel.mark(svg, row.time_s);
    }
}

/// The event.
fn events(svg: &mut Svg, panel: &Panel, rows: &[Row]) {
    for (number, (time_s, event)) in report::events(rows).enumerate() {
        panel.event(svg, time_s, number % EVENT_LINES, &event.to_string());
    }
}

/// The name and the colour of a charge state.
fn looks(state: ChargeState) -> (&'static str, &'static str) {
    match state {
        ChargeState::Undefined => ("unknown", "#f0f0f0"),
        ChargeState::Ok => ("ok", "#e3f4e3"),
        ChargeState::Low => ("low", "#fff3c4"),
        ChargeState::Critical => ("critical", "#ffdcc2"),
        ChargeState::Emergency => ("emergency", "#ffc9c9"),
        ChargeState::Failed => ("failed", "#e8c9e8"),
        ChargeState::Unhealthy => ("unhealthy", "#d9d9e8"),
        ChargeState::Charging => ("charging", "#d3e8fb"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rover_battmon::battery::{BatteryState, PackEvent, ReachedLevels, Thresholds};
    use rover_battmon::pack::Pack;
    use rover_battmon_tools::recordings::entry::Reported;

    fn rows() -> Vec<Row> {
        let row = |sample: u32| Row {
            pack: Pack::First,
            time_s: f64::from(sample) / 10.0,
            state: BatteryState {
                readings: Readings {
                    voltage_v: Some(12.0 - sample as f32 / 1e4),
                    current_a: (sample % 50 != 7).then_some(sample as f32 % 5.0),
                    remaining_pct: Some(100.0 - sample as f32 / 100.0),
                    remaining_sigma_pct: (sample % 3000 >= 100).then_some(1.0 + sample as f32 / 1e3),
                    usable_pct: Some(90.0 - sample as f32 / 80.0),
                    ..Readings::NONE
                },
                charge_state: if sample < 3000 {
                    ChargeState::Ok
                } else {
                    ChargeState::Low
                },
                ..BatteryState::default()
            },
            reached: ReachedLevels::new(),
            events: if sample == 3000 {
                vec![PackEvent::Charging]
            } else {
                vec![]
            },
            reported: None,
        };
        (0..6000).map(row).collect()
    }

    fn picture(rows: &[Row]) -> String {
        let failsafe = FailsafeSettings {
            low: Thresholds {
                voltage_v: Some(11.8),
                ..Thresholds::default()
            },
            ..FailsafeSettings::default()
        };
        plot(rows, "< & \"old\" trace", "A=1", &failsafe)
    }

    /// Goes through the tags of a document and returns how many it has; fails on one that is not closed.
    fn well_formed_tags(xml: &str) -> usize {
        let mut open = Vec::new();
        let mut count = 0;
        for part in xml.split('<').skip(1) {
            let (tag, text) = part.split_once('>').expect("a tag ends");
            assert!(!text.contains('>'), "{text:?}");
            let name = tag
                .split([' ', '/'])
                .find(|name| !name.is_empty())
                .expect("a name");
            count += 1;
            match (tag.starts_with('/'), tag.ends_with('/')) {
                (true, _) => assert_eq!(open.pop(), Some(name)),
                (false, false) => open.push(name),
                (false, true) => {}
            }
        }
        assert!(open.is_empty(), "not closed: {open:?}");
        count
    }

    #[test]
    fn every_tag_is_closed_and_every_panel_has_its_title() {
        let svg = picture(&rows());
        assert!(well_formed_tags(&svg) > 60);
        for text in [
            "&lt; &amp; &quot;old&quot; trace",
            "A=1",
            "Voltage (V)",
            "Current (A)",
            "Remaining charge (%)",
            "time (min:s)",
        ] {
            assert!(svg.contains(&format!(">{text}</text>")), "{text}");
        }
        assert!(svg.contains("Battery 1 charging"));
    }

    #[test]
    fn a_limit_is_drawn_that_is_set_and_an_event_in_every_panel() {
        let svg = picture(&rows());
        assert_eq!(svg.matches("stroke-dasharray").count(), 1);
        assert!(svg.contains(">BATT_LOW_VOLT</text>") && !svg.contains("BATT_CRT_VOLT"));
        // In the middle of the time.
        let mark = |line: &&str| line.starts_with("<line x1=\"472.5\"") && line.contains("#a01818");
        assert_eq!(svg.lines().filter(mark).count(), 3);
    }

    #[test]
    fn bands_are_drawn_for_the_states_there_were() {
        let svg = picture(&rows());
        for state in [ChargeState::Ok, ChargeState::Low] {
            assert!(svg.contains(looks(state).1), "{state:?}");
        }
        assert!(!svg.contains(looks(ChargeState::Critical).1));
    }

    #[test]
    fn what_is_not_known_has_no_colour_and_no_legend() {
        let mut rows = rows();
        for row in &mut rows {
            row.state.readings.usable_pct = None;
            row.state.readings.remaining_sigma_pct = None;
        }
        for row in &mut rows[..1000] {
            row.state.readings.remaining_pct = None;
        }
        let svg = picture(&rows);
        for absent in ["usable charge", BAND] {
            assert!(!svg.contains(&format!(">{absent}</text>")), "{absent}");
        }
        let band = |state| {
            let (_, colour) = looks(state);
            let is_band = |line: &&str| {
                line.starts_with("<rect") && line.contains(colour) && line.contains("y=\"616.0\"")
            };
            svg.lines().find(is_band).expect("a band")
        };
        // From 0 to 100 s, and from then on to 300 s, of 600.
        for (state, from, width) in [
            (ChargeState::Undefined, 60.0, 137.5),
            (ChargeState::Ok, 197.5, 275.0),
        ] {
            let place = format!("<rect x=\"{from:.1}\" y=\"616.0\" width=\"{width:.1}\"");
            assert!(band(state).starts_with(&place), "{}", band(state));
        }
    }

    #[test]
    fn the_uncertainty_is_a_band_around_the_remaining_charge_where_it_is_known() {
        let svg = picture(&rows());
        let bands: Vec<&str> = svg.lines().filter(|line| line.contains("<polygon")).collect();
        assert_eq!(bands.len(), 2);
        // Full at 10 s, ± 2.2 %, of which the upper part is cut off: the outline ends where it began.
        let (_, points) = bands[0].split_once("points=\"").expect("points");
        let ends = [
            points.split_once(' ').expect("two").0,
            points.rsplit_once(' ').expect("two").1,
        ];
        let y = ends.map(|point| {
            let (_, y) = point.trim_end_matches("\"/>").split_once(',').expect("a point");
            y.parse::<f64>().expect("a number")
        });
        let per_percent = 1.8;
        assert!((y[0] - 616.0).abs() < 0.2, "{y:?}");
        assert!((y[1] - y[0] - 3.2 * per_percent).abs() < 0.3, "{y:?}");
    }

    #[test]
    fn a_line_has_at_most_six_hundred_points() {
        for name in ["terminal voltage", "current", "remaining charge", "usable charge"] {
            let points: usize = picture(&rows())
                .lines()
                .filter(|line| line.contains("<polyline") && line.contains(name))
                .map(|line| line.matches(',').count())
                .sum();
            assert!((300..=600).contains(&points), "{name}: {points} points");
        }
    }

    #[test]
    fn names_in_the_legend_do_not_reach_the_next_colour() {
        let svg = picture(&rows());
        let in_last_legend = |line: &&str| line.starts_with("<text") && line.contains(" y=\"604.0\"");
        let names: Vec<(f64, usize)> = svg
            .lines()
            .filter(in_last_legend)
            .map(|line| {
                let x = line.split('"').nth(1).expect("its place");
                let (_, text) = line.trim_end_matches("</text>").split_once('>').expect("a text");
                (x.parse().expect("a number"), text.chars().count())
            })
            .collect();
        assert_eq!(names.len(), 6, "a title, two lines, their band, two states");
        let swatch = 17.0;
        for pair in names.windows(2) {
            let room = pair[1].0 - swatch - pair[0].0;
            assert!(room >= 6.5 * pair[0].1 as f64, "{names:?}");
        }
    }

    #[test]
    fn what_the_board_reported_is_a_line_of_its_own() {
        let mut rows = rows();
        assert!(!picture(&rows).contains(">reported</text>"));
        for row in &mut rows {
            row.reported = Some(Reported {
                remaining_pct: Some(50.0),
                ..Reported::default()
            });
        }
        let svg = picture(&rows);
        assert!(svg.contains(">reported</text>"));
        assert!(
            svg.lines()
                .any(|line| line.contains("<polyline") && line.contains(REPORTED))
        );
    }

    /// The bands of this colour, as points of their outlines.
    fn bands_of(svg: &str, colour: &str) -> Vec<Vec<(f64, f64)>> {
        let number = |text: &str| text.parse::<f64>().expect("a number");
        let point = |text: &str| {
            let (x, y) = text.split_once(',').expect("a point");
            (number(x), number(y))
        };
        let is_band = |line: &&str| line.contains("<polygon") && line.contains(colour);
        let outline = |line: &str| {
            let (_, points) = line.split_once("points=\"").expect("points");
            let points = points.trim_end_matches("\"/>").split(' ');
            points.map(point).collect()
        };
        svg.lines().filter(is_band).map(outline).collect()
    }

    #[test]
    fn extremes_are_a_band_from_the_report_before_to_their_own() {
        let mut rows = rows();
        assert!(!picture(&rows).contains(CONVERSIONS));
        // At 100, 300 and 500 s of 600 s.
        for (row, lowest_voltage_v, highest_current_a) in [
            (1000, Some(9.0), Some(20.0)),
            (3000, Some(11.0), None),
            (5000, None, None),
        ] {
            rows[row].reported = Some(Reported {
                extremes: Some(Extremes {
                    lowest_voltage_v,
                    highest_current_a,
                }),
                ..Reported::default()
            });
        }
        let svg = picture(&rows);
        assert_eq!(svg.matches(&format!(">{CONVERSIONS}</text>")).count(), 2);
        let x = |time_s: f64| 60.0 + time_s * 825.0 / 600.0;
        let [voltage] = &bands_of(&svg, VOLTAGE_BAND)[..] else {
            panic!("one band: {svg}");
        };
        let lowest_y = |from_s: f64, to_s: f64| {
            let within = voltage
                .iter()
                .filter(|point| (x(from_s)..x(to_s)).contains(&point.0));
            within.map(|point| point.1).fold(0.0, f64::max)
        };
        // 180 pixels are 9 to 12 V.
        let rise_v = (lowest_y(0.0, 100.0) - lowest_y(102.0, 300.0)) / 60.0;
        assert!((rise_v - 2.0).abs() < 0.01, "{rise_v} V");
        assert!(voltage.iter().all(|point| point.0 < x(302.0)));
        let [current] = &bands_of(&svg, CURRENT_BAND)[..] else {
            panic!("one band: {svg}");
        };
        // 20 A are at the top of the second diagram.
        let highest_y = current.iter().map(|point| point.1).fold(f64::INFINITY, f64::min);
        assert_eq!(highest_y, 356.0);
        assert!(current.iter().all(|point| point.0 < x(102.0)));
    }

    #[test]
    fn a_trace_without_anything_is_a_picture_too() {
        assert!(well_formed_tags(&picture(&[])) > 3);
    }
}
