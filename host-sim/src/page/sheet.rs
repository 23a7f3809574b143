//! Several panels in one drawing, with a common legend.

use std::fmt::Write as _;

use plotters::style::RGBColor;

use super::plot::{Mark, Plot};

/// Size of a panel's plot, px.
pub(crate) const CELL: (u32, u32) = (310, 165);
const COLUMNS: u32 = 3;
const TITLE: u32 = 20;
const ROW: u32 = CELL.1 + TITLE;

/// A plot with its title and legend.
pub(crate) struct Panel {
    pub(crate) title: String,
    pub(crate) svg: String,
    pub(crate) keys: Vec<Key>,
}

/// An entry of the legend.
pub(crate) type Key = (RGBColor, &'static str);

/// A plot for a panel: labels and ranges of its axes.
pub(crate) fn plot(labels: [&str; 2], x: (f64, f64), y: (f64, f64), marks: Vec<Mark>) -> Plot<'_> {
    Plot {
        size: CELL,
        labels,
        x,
        y,
        marks,
    }
}

/// Panels of [`CELL`] size row by row; the legend is in the cell after the last.
pub(crate) fn svg(panels: &[Panel]) -> String {
    let positions = (0..).map(|index| (index % COLUMNS * CELL.0, index / COLUMNS * ROW));
    let mut cells = String::new();
    let mut last = (0, 0);
    for (position, index) in positions.zip(0..=panels.len()) {
        cells += &match panels.get(index) {
            Some(panel) => cell(panel, position),
            None => keys(panels, position),
        };
        last = position;
    }
    let (width, height) = (COLUMNS * CELL.0, last.1 + ROW);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
         width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" font-size=\"13\" \
         fill=\"#888888\">\n{cells}</svg>\n"
    )
}

fn cell(panel: &Panel, (x, y): (u32, u32)) -> String {
    // The title is centred over the axes, without the labels.
    let (middle, base, top) = (x + CELL.0 / 2 + 25, y + TITLE - 5, y + TITLE);
    let (width, height) = CELL;
    let placed = format!("<svg x=\"{x}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" ");
    format!(
        "<text x=\"{middle}\" y=\"{base}\" text-anchor=\"middle\" font-weight=\"bold\">{}</text>\n{}",
        panel.title,
        panel.svg.replacen("<svg ", &placed, 1)
    )
}

fn keys(panels: &[Panel], (x, y): (u32, u32)) -> String {
    let mut text = String::new();
    let keys = panels.first().into_iter().flat_map(|panel| &panel.keys);
    for (line, (RGBColor(red, green, blue), meaning)) in (3..).zip(keys) {
        let (left, base) = (x + 60, y + 24 * line);
        let (bar, words) = (base - 6, left + 30);
        // Writing into a string cannot fail.
        let _ = writeln!(
            text,
            "<rect x=\"{left}\" y=\"{bar}\" width=\"22\" height=\"4\" \
             fill=\"#{red:02x}{green:02x}{blue:02x}\"/>\
             <text x=\"{words}\" y=\"{base}\">{meaning}</text>"
        );
    }
    text
}
