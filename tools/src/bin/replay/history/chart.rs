//! The capacity and the resistance of a pack over its drives, as pictures.

use super::life::Life;
use crate::plot::axis::Axis;
use crate::plot::panel::{PANEL_HEIGHT, Panel, Series};
use crate::plot::svg::Svg;
use crate::plot::{BAND, BAND_SIGMAS};
use crate::table::{Estimate, Row};

const CAPACITY: (&str, &str) = ("#5b3a8c", "#c9b8e0");
const RESISTANCE: (&str, &str) = ("#d1662c", "#f3cfb8");

/// Of a picture, and where its diagram ends, in pixels: a phone is not much narrower, and a page has two side by side.
const WIDTH: f64 = 480.0;
const RIGHT: f64 = WIDTH - 40.0;

/// Dates that there is room for.
const DATES: u32 = 4;

/// A value over the drives: its title, its colours (line and band), and how it is found.
struct Quantity {
    title: &'static str,
    name: &'static str,
    colours: (&'static str, &'static str),
    value: fn(&Row) -> Estimate,
}

const QUANTITIES: [Quantity; 2] = [
    Quantity {
        title: "Capacity (mAh)",
        name: "capacity",
        colours: CAPACITY,
        value: |row| row.capacity_mah,
    },
    Quantity {
        title: "Resistance (mΩ)",
        name: "resistance",
        colours: RESISTANCE,
        value: |row| row.resistance_mohm,
    },
];

/// A picture of each quantity that is known.
pub fn charts(life: &Life) -> String {
    QUANTITIES
        .iter()
        .filter_map(|quantity| chart(quantity, life))
        .collect()
}

fn chart(quantity: &Quantity, life: &Life) -> Option<String> {
    let (colour, band_colour) = quantity.colours;
    let series = |name, colour, of: &dyn Fn(Estimate) -> Option<f64>| {
        let points = life.drives.iter().zip(1u32..);
        let points = points.map(|(row, number)| (f64::from(number), of((quantity.value)(row))));
        Series::new(name, colour, points.collect())
    };
    let line = series(quantity.name, colour, &|estimate| estimate.value);
    let [lower, upper] = [-BAND_SIGMAS, BAND_SIGMAS].map(|sigmas| {
        series(BAND, band_colour, &|estimate| {
            Some(estimate.value? + f64::from(sigmas) * estimate.sigma?)
        })
    });
    if !line.is_known() {
        return None;
    }
    let all = [&line, &lower, &upper].into_iter().flat_map(Series::values);
    let drives = Axis::over_drives(life.drives.iter().map(|row| row.start_utc_s).collect(), DATES);
    let panel = Panel::new(quantity.title, (RIGHT, 0.0), &drives, Axis::over(all, 6));
    let mut svg = Svg::new(WIDTH, PANEL_HEIGHT);
    panel.between(&mut svg, &lower, &upper);
    let band = lower.is_known().then_some((BAND, band_colour));
    panel.draw(&mut svg, std::slice::from_ref(&line), band.as_slice());
    panel.dots(&mut svg, &line);
    Some(svg.finish())
}
