//! One of the diagrams below each other.

use super::axis::Axis;
use super::series::{Point, Series};
use super::svg::{Anchor, Svg};
use super::{HEAD_HEIGHT, PANEL_HEIGHT, WIDTH};

/// Where the diagrams begin, in pixels from the left.
pub const LEFT: f64 = 60.0;
const RIGHT: f64 = WIDTH - 115.0;
const MARGIN_TOP: f64 = 40.0;
const MARGIN_BOTTOM: f64 = 40.0;

const GRID: &str = "#cccccc";
const EVENT: &str = "#a01818";

const LINE_HEIGHT: f64 = 16.0;
const SWATCH: f64 = 12.0;

/// Where a legend begins, behind the title, and the room for an entry.
const LEGEND_LEFT: f64 = LEFT + 140.0;
const ENTRY_WIDTH: f64 = 112.0;

/// A diagram over time.
pub struct Panel<'a> {
    title: &'a str,
    top: f64,
    bottom: f64,
    time: &'a Axis,
    values: Axis,
}

impl<'a> Panel<'a> {
    /// The diagram in this place, counted from the top.
    pub fn new(title: &'a str, place: u32, time: &'a Axis, values: Axis) -> Self {
        let offset = HEAD_HEIGHT + f64::from(place) * PANEL_HEIGHT;
        Self {
            title,
            top: offset + MARGIN_TOP,
            bottom: offset + PANEL_HEIGHT - MARGIN_BOTTOM,
            time,
            values,
        }
    }

    fn x(&self, time_s: f64) -> f64 {
        LEFT + self.time.share(time_s) * (RIGHT - LEFT)
    }

    fn y(&self, value: f64) -> f64 {
        self.bottom - self.values.share(value) * (self.bottom - self.top)
    }

    /// Axes, lines and legend.
    pub fn draw(&self, svg: &mut Svg, lines: &[Series]) {
        self.axes(svg);
        for (entry, line) in lines.iter().enumerate() {
            for piece in line.pieces() {
                let points: Vec<Point> = piece.iter().map(|(t, v)| (self.x(*t), self.y(*v))).collect();
                svg.polyline(&points, line.colour, line.name);
            }
            self.legend_entry(svg, entry, line.name, line.colour);
        }
        if lines.iter().all(|line| line.values().next().is_none()) {
            let middle = (0.5 * (LEFT + RIGHT), 0.5 * (self.top + self.bottom));
            svg.text(middle, Anchor::Middle, "not known");
        }
    }

    fn axes(&self, svg: &mut Svg) {
        for (value, text) in self.values.ticks() {
            let y = self.y(value);
            svg.line((LEFT, y), (RIGHT, y), GRID);
            svg.text((LEFT - 6.0, y + 4.0), Anchor::End, &text);
        }
        for (time_s, text) in self.time.ticks() {
            let x = self.x(time_s);
            svg.line((x, self.top), (x, self.bottom), GRID);
            svg.text((x, self.bottom + LINE_HEIGHT), Anchor::Middle, &text);
        }
        svg.text((RIGHT, self.bottom + 2.0 * LINE_HEIGHT), Anchor::End, "time (s)");
        svg.text((LEFT, self.top - 12.0), Anchor::Start, self.title);
    }

    /// Colours the background from one time to another.
    pub fn band(&self, svg: &mut Svg, from_s: f64, to_s: f64, colour: &str) {
        let (from, to) = (self.x(from_s), self.x(to_s));
        svg.rectangle((from, self.top), (to - from, self.bottom - self.top), colour);
    }

    /// Colours what lies between two lines that are known at the same times.
    pub fn between(&self, svg: &mut Svg, lower: &Series, upper: &Series) {
        for (low, high) in lower.pieces().iter().zip(upper.pieces()) {
            let outline = high.iter().chain(low.iter().rev());
            let points: Vec<Point> = outline.map(|(t, v)| (self.x(*t), self.y(*v))).collect();
            svg.polygon(&points, upper.colour, upper.name);
        }
    }

    /// What further colours mean: behind this many lines.
    pub fn legend(&self, svg: &mut Svg, lines: usize, colours: &[(&str, &str)]) {
        for (entry, (name, colour)) in colours.iter().enumerate() {
            self.legend_entry(svg, lines + entry, name, colour);
        }
    }

    fn legend_entry(&self, svg: &mut Svg, entry: usize, name: &str, colour: &str) {
        let x = LEGEND_LEFT + ENTRY_WIDTH * entry as f64;
        let y = self.top - 12.0;
        svg.rectangle((x, y - SWATCH + 2.0), (SWATCH, SWATCH), colour);
        svg.text((x + SWATCH + 5.0, y), Anchor::Start, name);
    }

    /// Draws a limit of the values, with its name beside the diagram.
    pub fn limit(&self, svg: &mut Svg, value: f64, text: &str) {
        let y = self.y(value);
        svg.dashes((LEFT, y), (RIGHT, y), EVENT);
        svg.text((RIGHT + 6.0, y + 4.0), Anchor::Start, text);
    }

    /// Marks when something happened.
    pub fn mark(&self, svg: &mut Svg, time_s: f64) {
        let x = self.x(time_s);
        svg.line((x, self.top), (x, self.bottom), EVENT);
    }

    /// Says what happened, in one of several lines.
    pub fn event(&self, svg: &mut Svg, time_s: f64, line: usize, text: &str) {
        let x = self.x(time_s);
        let y = self.top + (line as f64 + 1.0) * LINE_HEIGHT;
        // It is written towards the middle, so that it is not cut off.
        if self.time.share(time_s) < 0.5 {
            svg.label((x + 4.0, y), Anchor::Start, text);
        } else {
            svg.label((x - 4.0, y), Anchor::End, text);
        }
    }
}
