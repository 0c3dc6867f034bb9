//! Writes an SVG document, one element a line.

use std::fmt::{Display, Write};

/// Which end of a text stands at its place.
#[derive(Clone, Copy, Debug)]
pub enum Anchor {
    /// It begins there.
    Start,
    /// It is centred there.
    Middle,
    /// It ends there.
    End,
}

/// A document that is being written. Lengths are in pixels, from the top left.
pub struct Svg {
    text: String,
}

impl Svg {
    /// An empty white sheet.
    pub fn new(width: f64, height: f64) -> Self {
        let mut svg = Self { text: String::new() };
        svg.write(format_args!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"12\" fill=\"#222222\">"
        ));
        svg.rectangle((0.0, 0.0), (width, height), "#ffffff");
        svg
    }

    /// A filled rectangle: its top left corner and its size.
    pub fn rectangle(&mut self, (x, y): (f64, f64), (width, height): (f64, f64), fill: &str) {
        self.write(format_args!(
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" fill=\"{fill}\"/>"
        ));
    }

    /// A thin straight line.
    pub fn line(&mut self, (x1, y1): (f64, f64), (x2, y2): (f64, f64), stroke: &str) {
        self.write(format_args!(
            "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"{stroke}\"/>"
        ));
    }

    /// A thin straight line of dashes.
    pub fn dashes(&mut self, (x1, y1): (f64, f64), (x2, y2): (f64, f64), stroke: &str) {
        self.write(format_args!(
            "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"{stroke}\" \
             stroke-dasharray=\"6 4\"/>"
        ));
    }

    /// A line through points; `name` identifies it to a reader of the document.
    pub fn polyline(&mut self, points: &[(f64, f64)], stroke: &str, name: &str) {
        self.write(format_args!(
            "<polyline data-name=\"{}\" fill=\"none\" stroke=\"{stroke}\" stroke-width=\"1.5\" points=\"{}\"/>",
            escaped(name),
            pairs(points)
        ));
    }

    /// A filled area within points; `name` identifies it to a reader of the document.
    pub fn polygon(&mut self, points: &[(f64, f64)], fill: &str, name: &str) {
        self.write(format_args!(
            "<polygon data-name=\"{}\" fill=\"{fill}\" fill-opacity=\"0.6\" points=\"{}\"/>",
            escaped(name),
            pairs(points)
        ));
    }

    /// A dot around a point.
    pub fn dot(&mut self, (x, y): (f64, f64), fill: &str) {
        self.write(format_args!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"{fill}\"/>"
        ));
    }

    /// A line of text.
    pub fn text(&mut self, place: (f64, f64), anchor: Anchor, text: &str) {
        self.write_text(place, anchor, text, "");
    }

    /// A line of large text.
    pub fn headline(&mut self, place: (f64, f64), text: &str) {
        self.write_text(
            place,
            Anchor::Start,
            text,
            " font-size=\"16\" font-weight=\"bold\"",
        );
    }

    /// A line of text that can be read on top of lines: there is a white one behind it.
    pub fn label(&mut self, place: (f64, f64), anchor: Anchor, text: &str) {
        self.write_text(place, anchor, text, " stroke=\"#ffffff\" stroke-width=\"4\"");
        self.write_text(place, anchor, text, "");
    }

    fn write_text(&mut self, (x, y): (f64, f64), anchor: Anchor, text: &str, looks: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        self.write(format_args!(
            "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\"{looks}>{}</text>",
            escaped(text)
        ));
    }

    /// The whole document.
    pub fn finish(mut self) -> String {
        self.write("</svg>");
        self.text
    }

    fn write(&mut self, element: impl Display) {
        // A String takes everything.
        let _ = writeln!(self.text, "{element}");
    }
}

fn pairs(points: &[(f64, f64)]) -> String {
    let points: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    points.join(" ")
}

/// A text as it is in XML and HTML.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
