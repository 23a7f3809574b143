//! A figure or a table of the thesis, and what goes into it.

use serde::Serialize;

use crate::sim::Grade;

/// How much is simulated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Settings {
    /// First seed; others follow.
    pub seed: u64,
    /// Drives behind the figures that need one.
    pub drives: u64,
    /// Length of each, min.
    pub minutes: f64,
    /// Units behind the table of free velocity errors, at rest, in the car and in the aircraft.
    pub units: u64,
    /// Length of each of their runs, min.
    pub unit_minutes: f64,
    /// Flights without GNSS.
    pub flights: u64,
    /// Length of the flight of Figure 9, min.
    pub flight_minutes: f64,
}

impl Settings {
    /// The first so many seeds.
    pub(super) fn seeds(&self, count: u64) -> core::ops::Range<u64> {
        self.seed..self.seed.saturating_add(count)
    }

    /// What the command does.
    pub fn new(seed: u64) -> Self {
        Self {
            seed,
            drives: 6,
            minutes: 60.0,
            units: 8,
            unit_minutes: 60.0,
            flights: 12,
            flight_minutes: 170.0,
        }
    }
}

/// A figure or a table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Part {
    /// Stem of its files.
    pub name: &'static str,
    /// Heading.
    pub title: String,
    /// Over what and how it was measured.
    pub how: String,
    /// Numbers.
    pub numbers: Vec<Number>,
    /// Drawing, if there is one.
    #[serde(skip)]
    pub svg: Option<String>,
    /// Its data as CSV.
    #[serde(skip)]
    pub csv: String,
}

/// A number of the thesis beside ours.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Number {
    /// What, with its unit.
    pub what: String,
    /// As published; none where the thesis gives none, or none that is known here.
    pub thesis: Option<f64>,
    /// As measured.
    pub ours: f64,
    /// Ours over the thesis's.
    pub ratio: Option<f64>,
}

impl Number {
    pub(super) fn new(what: impl Into<String>, thesis: Option<f64>, ours: f64) -> Self {
        Self {
            what: what.into(),
            thesis,
            ours,
            ratio: thesis.map(|thesis| ours / thesis),
        }
    }
}

/// What the thesis has no number of.
pub(super) fn here(what: impl Into<String>, value: f64) -> Number {
    Number::new(what, None, value)
}

/// Comma-separated text: names, then rows of numbers.
pub(super) fn csv(header: &str, rows: impl Iterator<Item = Vec<f64>>) -> String {
    let mut text = format!("{header}\n");
    for row in rows {
        let cells: Vec<String> = row.iter().map(|value| format!("{value:.6}")).collect();
        text += &cells.join(",");
        text.push('\n');
    }
    text
}

/// The class of sensors that everything here has.
pub(super) const GRADE: Grade = Grade::Hg1700;
