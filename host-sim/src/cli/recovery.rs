//! The command `recovery`.

use std::path::PathBuf;

use clap::Args;
use miette::Result;

use super::options::{minutes, show};
use crate::log::Grade;
use crate::page::progress::bar;
use crate::page::table::Table;
use crate::page::{self, output};
use crate::sim::errors::Law;
use crate::study::recovery::{Results, Study, Vehicle, coverage};

const JSON: &str = "recovery.json";
const MARKDOWN: &str = "recovery.md";

/// Seeds from one kind of units to the next: no study has so many.
const KIND_SEEDS: u64 = 1_000_000_000;

/// Options of `recovery`.
#[derive(Debug, Args)]
pub struct Recovery {
    /// Number of units, of each model of the gyro biases.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(2..=100_000))]
    units: u64,
    /// Drives of a unit.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=100))]
    drives: u64,
    /// Length of a drive.
    #[arg(long, default_value_t = 40.0, value_parser = minutes)]
    minutes: f64,
    /// Seed of the first drive.
    #[arg(long, default_value_t = 0)]
    first_seed: u64,
    /// Both classes of sensors, in a car and in an aircraft: only how often intervals hold the truth.
    #[arg(long)]
    closure: bool,
    /// Folder for recovery.json and, in Markdown, recovery.md.
    #[arg(long)]
    out: Option<PathBuf>,
}

/// Makes units, identifies them and says how well that went.
pub fn recovery(options: &Recovery, json: bool, force: bool) -> Result<()> {
    if let Some(out) = &options.out {
        output::check_free(out, JSON, force)?;
    }
    let study = Study {
        class: Grade::Hg1700,
        vehicle: Vehicle::Car,
        units: options.units,
        drives: options.drives,
        minutes: options.minutes,
        first_seed: options.first_seed,
    };
    let (results, tables) = if options.closure {
        let results = closure(study);
        let table = coverage(&results);
        (results, vec![table])
    } else {
        let results = both(study);
        let tables = results.iter().map(Results::table).collect();
        (results, tables)
    };
    if let Some(out) = &options.out {
        output::build(out, JSON, force, |folder| -> Result<()> {
            output::write(folder, MARKDOWN, printed(&tables, Table::markdown))?;
            Ok(output::write(folder, JSON, page::json(&results)?)?)
        })?;
    }
    show(json, &results, || printed(&tables, Table::plain) + "\n")
}

/// Each under its title.
pub(crate) fn printed(tables: &[Table], form: fn(&Table) -> String) -> String {
    let text = |table: &Table| format!("{}:\n\n{}", table.title, form(table));
    tables.iter().map(text).collect::<Vec<_>>().join("\n")
}

/// Units of both models.
pub(crate) fn both(study: Study) -> Vec<Results> {
    let of = |law| study.results(law, &bar().with_message("units"));
    [Law::Wave, Law::Continuous].map(of).into()
}

/// Of both classes, in both vehicles.
fn closure(study: Study) -> Vec<Results> {
    let classes = [Grade::Hg1700, Grade::Mems];
    let kinds =
        classes.map(|class| [Vehicle::Car, Vehicle::Aircraft].map(|vehicle| (class, vehicle)));
    let of = |((class, vehicle), seeds)| {
        both(Study {
            class,
            vehicle,
            first_seed: study.first_seed + KIND_SEEDS * seeds,
            ..study
        })
    };
    kinds.into_iter().flatten().zip(0..).flat_map(of).collect()
}
