//! The thesis's figures and tables from simulation, its numbers beside ours.

mod cross_channel;
mod drive;
mod flight;
mod free_velocity;
mod observable;
pub(crate) mod output;
pub(crate) mod performance;
mod spans;
mod velocity_plot;

use miette::{Result, miette};
use rayon::prelude::*;
use serde::Serialize;

use crate::sim::{ErrorModel, Grade};
use crate::study::flights::route::Route;
use drive::Drive;
pub use output::{JSON, markdown};

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
}

impl Settings {
    /// What the command does.
    pub fn new(seed: u64) -> Self {
        Self {
            seed,
            drives: 6,
            minutes: 60.0,
            units: 8,
            unit_minutes: 60.0,
            flights: 12,
        }
    }
}

/// All that is reproduced, and what is not.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reproduction {
    /// Version of this program.
    pub version: &'static str,
    /// What was simulated.
    pub settings: Settings,
    /// In the order of the page.
    pub parts: Vec<Part>,
    /// Numbers of the thesis that have nothing here.
    pub not_reproduced: [NotReproduced; 2],
}

/// A figure or a table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Part {
    /// Stem of its files.
    pub name: &'static str,
    /// Heading.
    pub title: &'static str,
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
    fn new(what: impl Into<String>, thesis: Option<f64>, ours: f64) -> Self {
        Self {
            what: what.into(),
            thesis,
            ours,
            ratio: thesis.map(|thesis| ours / thesis),
        }
    }
}

/// Something of the thesis that is not here.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NotReproduced {
    /// Which.
    pub what: &'static str,
    /// Why.
    pub why: &'static str,
}

const NOT_REPRODUCED: [NotReproduced; 2] = [
    NotReproduced {
        what: "Figures 3, 4, 6, 7, 9",
        why: "what each of them shows is not known here, so nothing stands under their numbers",
    },
    NotReproduced {
        what: "the recordings behind Figures 1, 5, 8 and Table 1",
        why: "they are not public: a simulated unit of the same class stands in for the thesis's",
    },
];

/// Simulates and measures everything; what comes out does not depend on the number of threads.
pub fn reproduce(settings: Settings) -> Result<Reproduction> {
    let Settings { seed, drives, .. } = settings;
    let unusable = |error: ins_core::ConfigError| miette!("{}", error);
    let drives = (seed..seed.saturating_add(drives))
        .into_par_iter()
        .map(|seed| Drive::new(seed, settings.minutes))
        .collect::<Result<Vec<Drive>, _>>()
        .map_err(unusable)?;
    let Some(first) = drives.first() else {
        return Err(miette!("at least one drive"));
    };
    let route = Route::cessna172()?;
    let parts = vec![
        observable::figure_1(first),
        cross_channel::figure_5(&drives),
        free_velocity::figure_8(&drives),
        spans::table_1(&settings, &route)?,
        flight::table_2()?,
        flight::hour(&settings, &route, &ErrorModel::hg1700())?,
    ];
    Ok(Reproduction {
        version: env!("CARGO_PKG_VERSION"),
        settings,
        parts,
        not_reproduced: NOT_REPRODUCED,
    })
}

/// Root mean square.
fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), v| (sum + v * v, count + 1.0));
    if count > 0.0 {
        (sum / count).sqrt()
    } else {
        0.0
    }
}

/// Comma-separated text: names, then rows of numbers.
fn csv(header: &[&str], rows: impl Iterator<Item = Vec<f64>>) -> String {
    let mut text = header.join(",") + "\n";
    for row in rows {
        let cells: Vec<String> = row.iter().map(|value| format!("{value:.6}")).collect();
        text += &cells.join(",");
        text.push('\n');
    }
    text
}

/// The class of sensors that everything here has.
const GRADE: Grade = Grade::Hg1700;
