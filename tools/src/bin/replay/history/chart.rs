//! The capacity and the resistance of a pack over its drives, as a picture.

use super::life::Life;
use crate::plot::axis::Axis;
use crate::plot::panel::{PANEL_HEIGHT, Panel, Series, WIDTH};
use crate::plot::svg::Svg;
use crate::plot::{BAND, BAND_SIGMAS};
use crate::table::{Estimate, Row};

const CAPACITY: (&str, &str) = ("#5b3a8c", "#c9b8e0");
const RESISTANCE: (&str, &str) = ("#d1662c", "#f3cfb8");

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

/// The picture.
pub fn chart(life: &Life) -> String {
    let drives = Axis::over_counted(life.drives.len(), 10, "drive");
    let mut svg = Svg::new(WIDTH, QUANTITIES.len() as f64 * PANEL_HEIGHT);
    for (quantity, place) in QUANTITIES.iter().zip(0..) {
        draw(&mut svg, quantity, f64::from(place) * PANEL_HEIGHT, &drives, life);
    }
    svg.finish()
}

fn draw(svg: &mut Svg, quantity: &Quantity, offset: f64, drives: &Axis, life: &Life) {
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
    let all = [&line, &lower, &upper].into_iter().flat_map(Series::values);
    let panel = Panel::new(quantity.title, offset, drives, Axis::over(all, 6));
    panel.between(svg, &lower, &upper);
    panel.draw(svg, std::slice::from_ref(&line), &[(BAND, band_colour)]);
    panel.dots(svg, &line);
}
