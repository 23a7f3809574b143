//! Several panels in one drawing, with one key to all.

use std::fmt::Write as _;

use plotters::style::RGBColor;

use super::plot::{Mark, Plot};

/// Size of a panel's plot, px.
pub(crate) const CELL: (u32, u32) = (310, 165);
const COLUMNS: u32 = 3;
const TITLE: u32 = 20;
const ROW: u32 = CELL.1 + TITLE;

/// A plot with its heading and the meaning of its colours.
pub(crate) struct Panel {
    pub(crate) title: String,
    pub(crate) svg: String,
    pub(crate) keys: Vec<Key>,
}

/// What a colour means.
pub(crate) struct Key {
    pub(crate) colour: String,
    pub(crate) text: &'static str,
}

/// A plot for a panel: labels of its axes, and their ends.
pub(crate) fn plot(
    [x_label, y_label]: [&str; 2],
    x: (f64, f64),
    y: (f64, f64),
    marks: Vec<Mark>,
) -> Plot {
    Plot {
        size: CELL,
        x_label: x_label.to_owned(),
        y_label: y_label.to_owned(),
        x,
        y,
        marks,
    }
}

pub(crate) fn key(colour: RGBColor, text: &'static str) -> Key {
    Key {
        colour: format!("#{:02x}{:02x}{:02x}", colour.0, colour.1, colour.2),
        text,
    }
}

/// Panels of [`CELL`] size row by row; the colours are explained in the cell after the last.
pub(crate) fn svg(panels: &[Panel]) -> String {
    let places = (0..).map(|index| (index % COLUMNS * CELL.0, index / COLUMNS * ROW));
    let mut cells = String::new();
    let mut last = (0, 0);
    for (place, index) in places.zip(0..=panels.len()) {
        cells += &match panels.get(index) {
            Some(panel) => cell(panel, place),
            None => keys(panels, place),
        };
        last = place;
    }
    let (width, height) = (COLUMNS * CELL.0, last.1 + ROW);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
         width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" font-size=\"13\" \
         fill=\"#888888\">\n{cells}</svg>\n"
    )
}

fn cell(panel: &Panel, (x, y): (u32, u32)) -> String {
    // The title stands over the middle of the axes, not of the labels.
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
    for (line, key) in (3..).zip(keys) {
        let (left, base, colour) = (x + 60, y + 24 * line, &key.colour);
        let (bar, words) = (base - 6, left + 30);
        // Writing into a string cannot fail.
        let _ = writeln!(
            text,
            "<rect x=\"{left}\" y=\"{bar}\" width=\"22\" height=\"4\" fill=\"{colour}\"/>\
             <text x=\"{words}\" y=\"{base}\">{}</text>",
            key.text
        );
    }
    text
}
