//! Contents and files of the reproduced figures and tables: `reproduce.json`, `report.html`, a drawing and a
//! table of data for each part.

use std::path::Path;

use miette::Result;
use minijinja::context;
use minijinja::value::{Serde, Value};
use serde::Serialize;

use crate::log::Grade;
use crate::page::html::{REPORT, fill};
use crate::page::table::{Table, heads};
use crate::page::{self, brief, output};

/// Name of the file that marks the folder as ours.
pub const JSON: &str = "reproduce.json";

/// Class of the sensors.
pub(super) const GRADE: Grade = Grade::Hg1700;

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Settings {
    /// First seed; others follow.
    pub seed: u64,
    /// Drives for the figures.
    pub drives: u64,
    /// Length of each, min.
    pub minutes: f64,
    /// Units for the table of free velocity errors, at rest, in the car and in the aircraft.
    pub units: u64,
    /// Length of each of their runs, min.
    pub unit_minutes: f64,
    /// Flights without GNSS.
    pub flights: u64,
    /// Length of the flight of Figure 9, min.
    pub flight_minutes: f64,
}

impl Settings {
    pub(super) fn seeds(&self, count: u64) -> core::ops::Range<u64> {
        self.seed..self.seed.saturating_add(count)
    }

    /// Settings of the command.
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

/// The reproduced parts, and what is not reproduced.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reproduction {
    pub version: &'static str,
    pub settings: Settings,
    pub parts: Vec<Part>,
    /// Parts of the thesis without a counterpart.
    pub not_reproduced: [NotReproduced; 1],
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NotReproduced {
    pub what: &'static str,
    pub why: &'static str,
}

pub(super) const NOT_REPRODUCED: [NotReproduced; 1] = [NotReproduced {
    what: "the recordings behind Figures 1 and 3 to 8 and Table 1",
    why: "they are not public: a simulated unit of the same class stands in for the thesis's",
}];

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Part {
    /// Stem of its files.
    pub name: &'static str,
    pub title: String,
    /// Data and method.
    pub how: String,
    pub numbers: Vec<Number>,
    #[serde(skip)]
    pub svg: Option<String>,
    #[serde(skip)]
    pub csv: String,
}

/// A number of the thesis and ours.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Number {
    /// Quantity, with its unit.
    pub what: String,
    /// As published; none if the thesis gives none, or it is not known here.
    pub thesis: Option<f64>,
    pub ours: f64,
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

/// A number without a counterpart in the thesis.
pub(super) fn here(what: impl Into<String>, value: f64) -> Number {
    Number::new(what, None, value)
}

/// Comma-separated text: names, then rows of numbers.
pub(super) fn csv(names: &str, rows: impl Iterator<Item = Vec<f64>>) -> Result<String> {
    let cells = |row: Vec<f64>| row.into_iter().map(|value| format!("{value:.6}"));
    page::csv(names, rows.map(cells))
}

impl Reproduction {
    pub fn write(&self, folder: &Path) -> Result<()> {
        output::write(folder, JSON, page::json(self)?)?;
        output::write(folder, REPORT, self.html()?)?;
        for Part { name, csv, svg, .. } in &self.parts {
            output::write(folder, &format!("{name}.csv"), csv)?;
            if let Some(svg) = svg {
                output::write(folder, &format!("{name}.svg"), svg)?;
            }
        }
        Ok(())
    }

    fn html(&self) -> Result<String> {
        let part = |part: &Part| {
            let rows: Vec<[String; 4]> = part.numbers.iter().map(row).collect();
            let (rows, svg) = (Value::from(Serde(rows)), part.svg.as_deref());
            context! { rows, svg, ..Value::from(Serde(part)) }
        };
        let parts: Vec<Value> = self.parts.iter().map(part).collect();
        let reproduction = Value::from(Serde(self));
        fill(
            include_str!("report.html"),
            context! { reproduction, parts },
        )
    }

    pub fn table(&self) -> Table {
        let rows = self.parts.iter().flat_map(|part| {
            let source = part.title.split(':').next().unwrap_or_default();
            let cells = |number| [&[source.to_owned()][..], &row(number)].concat();
            part.numbers.iter().map(cells)
        });
        let header = heads("of the thesis | what | thesis | ours | ratio");
        Table::of("", header, rows)
    }

    pub fn readable(&self) -> String {
        let mut text = self.table().plain();
        let missing = self.not_reproduced.iter();
        text.extend(
            missing
                .map(|NotReproduced { what, why }| format!("\nNot reproduced: {what}: {why}.\n")),
        );
        text
    }
}

fn row(number: &Number) -> [String; 4] {
    let thesis = number.thesis.map(|value| value.to_string());
    [
        number.what.clone(),
        thesis.unwrap_or_default(),
        brief(number.ours),
        number.ratio.map_or(String::new(), brief),
    ]
}
