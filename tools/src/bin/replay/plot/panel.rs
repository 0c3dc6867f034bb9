//! One of the diagrams below each other, its scales and its lines.

use super::axis::Axis;
use super::svg::{Anchor, Svg};

/// Height of a diagram, in pixels.
pub const PANEL_HEIGHT: f64 = 260.0;

/// Left edge of the diagrams, in pixels.
pub const LEFT: f64 = 60.0;
const MARGIN_TOP: f64 = 40.0;
const MARGIN_BOTTOM: f64 = 40.0;

const GRID: &str = "#cccccc";
const EVENT: &str = "#a01818";

const LINE_HEIGHT: f64 = 16.0;
const SWATCH: f64 = 12.0;

/// Left edge of a legend, behind the title; the width of a character is that of a wide font.
const LEGEND_LEFT: f64 = LEFT + 135.0;
const CHARACTER_WIDTH: f64 = 6.5;
const SWATCH_GAP: f64 = 5.0;
const ENTRY_GAP: f64 = 12.0;

/// A diagram over time.
pub struct Panel<'a> {
    title: &'a str,
    right: f64,
    top: f64,
    bottom: f64,
    time: &'a Axis,
    values: Axis,
}

impl<'a> Panel<'a> {
    /// The diagram that begins at this height and ends at `right`, in pixels from the top left.
    pub fn new(title: &'a str, (right, offset): (f64, f64), time: &'a Axis, values: Axis) -> Self {
        Self {
            title,
            right,
            top: offset + MARGIN_TOP,
            bottom: offset + PANEL_HEIGHT - MARGIN_BOTTOM,
            time,
            values,
        }
    }

    fn x(&self, time_s: f64) -> f64 {
        LEFT + self.time.share(time_s) * (self.right - LEFT)
    }

    fn y(&self, value: f64) -> f64 {
        self.bottom - self.values.share(value) * (self.bottom - self.top)
    }

    /// Axes, lines and legend, which also says what further colours mean.
    pub fn draw(&self, svg: &mut Svg, lines: &[Series], colours: &[(&str, &str)]) {
        self.axes(svg);
        for line in lines {
            for piece in line.pieces() {
                let points: Vec<Point> = piece.iter().map(|(t, v)| (self.x(*t), self.y(*v))).collect();
                svg.polyline(&points, line.colour, line.name);
            }
        }
        let drawn = || lines.iter().filter(|line| line.is_known());
        let of_lines = drawn().map(|line| (line.name, line.colour));
        self.legend(svg, of_lines.chain(colours.iter().copied()));
        if drawn().next().is_none() {
            let middle = (0.5 * (LEFT + self.right), 0.5 * (self.top + self.bottom));
            svg.text(middle, Anchor::Middle, "not known");
        }
    }

    /// Marks each value of a line that has few.
    pub fn dots(&self, svg: &mut Svg, line: &Series) {
        for (time_s, value) in line.pieces().concat() {
            svg.dot((self.x(time_s), self.y(value)), line.colour);
        }
    }

    fn axes(&self, svg: &mut Svg) {
        for (value, text) in self.values.ticks() {
            let y = self.y(value);
            svg.line((LEFT, y), (self.right, y), GRID);
            svg.text((LEFT - 6.0, y + 4.0), Anchor::End, &text);
        }
        for (time_s, text) in self.time.ticks() {
            let x = self.x(time_s);
            svg.line((x, self.top), (x, self.bottom), GRID);
            svg.text((x, self.bottom + LINE_HEIGHT), Anchor::Middle, &text);
        }
        svg.text(
            (self.right, self.bottom + 2.0 * LINE_HEIGHT),
            Anchor::End,
            self.time.caption,
        );
        svg.text((LEFT, self.top - 12.0), Anchor::Start, self.title);
    }

    /// Colours the background from one time to another.
    pub fn band(&self, svg: &mut Svg, from_s: f64, to_s: f64, colour: &str) {
        let size = (self.width(from_s, to_s), self.bottom - self.top);
        svg.rectangle((self.x(from_s), self.top), size, colour);
    }

    /// The distance of two times, in pixels.
    pub fn width(&self, from_s: f64, to_s: f64) -> f64 {
        self.x(to_s) - self.x(from_s)
    }

    /// Colours what lies between two lines that are known at the same times.
    pub fn between(&self, svg: &mut Svg, lower: &Series, upper: &Series) {
        for (low, high) in lower.pieces().iter().zip(upper.pieces()) {
            let outline = high.iter().chain(low.iter().rev());
            let points: Vec<Point> = outline.map(|(t, v)| (self.x(*t), self.y(*v))).collect();
            svg.polygon(&points, upper.colour, upper.name);
        }
    }

    /// Names with their colours. Each takes the room that it needs, so that the next does not cover it.
    fn legend<'n>(&self, svg: &mut Svg, entries: impl Iterator<Item = (&'n str, &'n str)>) {
        let y = self.top - 12.0;
        let mut x = LEGEND_LEFT;
        for (name, colour) in entries {
            svg.rectangle((x, y - SWATCH + 2.0), (SWATCH, SWATCH), colour);
            x += SWATCH + SWATCH_GAP;
            svg.text((x, y), Anchor::Start, name);
            x += CHARACTER_WIDTH * name.chars().count() as f64 + ENTRY_GAP;
        }
    }

    /// Draws a limit of the values, with its name beside the diagram.
    pub fn limit(&self, svg: &mut Svg, value: f64, text: &str) {
        let y = self.y(value);
        svg.dashes((LEFT, y), (self.right, y), EVENT);
        svg.text((self.right + 6.0, y + 4.0), Anchor::Start, text);
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

/// A line is drawn from at most so many groups of neighbours, by the lowest and the highest of each: no spike is lost, and a
/// picture of 800 pixels needs no more.
const MOST_CHUNKS: usize = 300;

/// A point of a line: seconds and a value.
pub type Point = (f64, f64);

/// A value over time.
pub struct Series<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its style.
    pub colour: &'a str,
    points: Vec<(f64, Option<f64>)>,
}

impl<'a> Series<'a> {
    /// The values at these times, as far as they are known.
    pub fn new(name: &'a str, colour: &'a str, points: Vec<(f64, Option<f64>)>) -> Self {
        Self { name, colour, points }
    }

    /// Whether any value is known.
    pub fn is_known(&self) -> bool {
        self.values().next().is_some()
    }

    /// All values that are known.
    pub fn values(&self) -> impl Iterator<Item = f64> {
        self.points.iter().filter_map(|(_, value)| *value)
    }

    /// At most six hundred points, in pieces that end where the value is not known for long enough to be seen.
    pub fn pieces(&self) -> Vec<Vec<Point>> {
        let size = self.points.len().div_ceil(MOST_CHUNKS).max(1);
        let chunks: Vec<Vec<Point>> = self.points.chunks(size).map(extremes).collect();
        chunks
            .split(Vec::is_empty)
            .map(<[_]>::concat)
            .filter(|piece| !piece.is_empty())
            .collect()
    }
}

/// The lowest and the highest of these points, in the order of time.
fn extremes(points: &[(f64, Option<f64>)]) -> Vec<Point> {
    let known = || {
        points
            .iter()
            .filter_map(|(time_s, value)| Some((*time_s, (*value)?)))
    };
    let by_value = |a: &Point, b: &Point| a.1.total_cmp(&b.1);
    let mut both: Vec<Point> = known()
        .min_by(by_value)
        .into_iter()
        .chain(known().max_by(by_value))
        .collect();
    both.sort_by(|a, b| a.0.total_cmp(&b.0));
    both.dedup();
    both
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_series_keeps_its_spikes() {
        let points = (0..60_000).map(|n| (f64::from(n), Some(if n == 31_234 { 9.0 } else { 1.0 })));
        let pieces = Series::new("", "", points.collect()).pieces();
        assert_eq!(pieces.len(), 1);
        assert!(pieces[0].len() <= 600);
        assert!(pieces[0].contains(&(31_234.0, 9.0)));
        assert!(pieces[0].is_sorted_by(|a, b| a.0 < b.0));
    }

    #[test]
    fn a_gap_parts_the_line() {
        let points = vec![(0.0, Some(1.0)), (1.0, Some(2.0)), (2.0, None), (3.0, Some(4.0))];
        let pieces = Series::new("", "", points).pieces();
        assert_eq!(pieces, [vec![(0.0, 1.0), (1.0, 2.0)], vec![(3.0, 4.0)]]);
    }
}
