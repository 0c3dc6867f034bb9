//! A value over time, thinned out until it can be drawn.

/// Of this many neighbours the lowest and the highest are drawn: no spike is lost.
const MOST_CHUNKS: usize = 1000;

/// A point of a line: seconds and a value.
pub type Point = (f64, f64);

/// A value over time.
pub struct Series<'a> {
    /// What it is.
    pub name: &'a str,
    /// How it is drawn.
    pub colour: &'a str,
    points: Vec<(f64, Option<f64>)>,
}

impl<'a> Series<'a> {
    /// The values at these times, as far as they are known.
    pub fn new(name: &'a str, colour: &'a str, points: Vec<(f64, Option<f64>)>) -> Self {
        Self { name, colour, points }
    }

    /// All values that are known.
    pub fn values(&self) -> impl Iterator<Item = f64> {
        self.points.iter().filter_map(|(_, value)| *value)
    }

    /// At most two thousand points, in pieces that end where the value is not known for long enough to be seen.
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
        assert!(pieces[0].len() <= 2000);
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
