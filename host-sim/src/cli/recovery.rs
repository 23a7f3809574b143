//! The command `recovery`.

use std::path::PathBuf;

use clap::Args;
use miette::Result;

use crate::cli::options::minutes;
use crate::page;
use crate::page::output::{self};
use crate::page::progress::bar;
use crate::sim::errors::Law;
use crate::study::recovery::{Results, Study};

const JSON: &str = "recovery.json";

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
    /// Folder for recovery.json.
    #[arg(long)]
    out: Option<PathBuf>,
}

/// Makes units, identifies them and says how well that went.
pub fn recovery(options: &Recovery, json: bool, force: bool) -> Result<()> {
    if let Some(out) = &options.out {
        output::check_free(out, JSON, force)?;
    }
    let study = Study {
        units: options.units,
        drives: options.drives,
        minutes: options.minutes,
        first_seed: options.first_seed,
    };
    let results = both(study);
    let text = page::json(&results)?;
    if let Some(out) = &options.out {
        output::build(out, JSON, force, |folder| {
            output::write(folder, JSON, &text)
        })?;
    }
    if json {
        print!("{text}");
        return Ok(());
    }
    for results in &results {
        println!("Gyro biases of thesis equation {}:\n", results.gyro_model);
        println!("{}", results.table().plain());
    }
    Ok(())
}

/// Units of both models.
pub(crate) fn both(study: Study) -> [Results; 2] {
    [Law::Wave, Law::Continuous].map(|law| {
        let progress = bar();
        progress.set_message("units");
        study.results(law, &progress)
    })
}
