//! Velocity errors over time, drawn.

use plotters::style::RGBColor;

use crate::page::plot::{Mark, padded};
use crate::page::sheet::{self, Panel, key};

/// A named line, m/s over s.
pub(super) struct Line {
    pub(super) name: &'static str,
    pub(super) colour: RGBColor,
    pub(super) points: Vec<(f64, f64)>,
}

/// Lines, the first undermost, over one axis of time.
pub(super) fn panel(title: String, lines: Vec<Line>) -> Panel {
    let points = || lines.iter().flat_map(|line| &line.points);
    let end_s = points().fold(1.0, |end, point| f64::max(end, point.0));
    let y = padded(points().map(|point| point.1), 1e-2);
    let keys = lines
        .iter()
        .map(|line| key(line.colour, line.name))
        .collect();
    let marks = (lines.into_iter()).map(|line| Mark::Line(line.points, line.colour));
    Panel {
        title,
        svg: sheet::plot(["time, s", "m/s"], (0.0, end_s), y, marks.collect()).svg(),
        keys,
    }
}
