//! The command `flights`.

use std::path::PathBuf;

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Result};

use super::options::show;
use crate::page::output::check_free;
use crate::sim::ErrorModel;
use crate::study::flights::output::{self, SUMMARY};
use crate::study::flights::route::Route;
use crate::study::flights::run::{Run, Settings, all};
use crate::study::flights::schuler::schuler;
use crate::study::flights::summary::Summary;

/// Options of `flights`.
#[derive(Debug, Args)]
pub struct Flights {
    /// Number of flights.
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    runs: u32,
    /// Minutes damped by GNSS.
    #[arg(long, default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=600))]
    minutes_aided: u32,
    /// Minutes without GNSS after that.
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=600))]
    minutes_free: u32,
    /// Seed of the first flight; the others follow.
    #[arg(long, default_value_t = 0)]
    seed_from: u64,
    /// Folder for tables and pictures.
    #[arg(long)]
    out: Option<PathBuf>,
}

/// Flies, and reports what the estimates are worth.
pub fn flights(options: &Flights, json: bool, force: bool) -> Result<()> {
    if let Some(out) = &options.out {
        check_free(out, SUMMARY, force)?;
    }
    let (runs, summary) = measure(options)?;
    if let Some(out) = &options.out {
        output::write(out, force, &runs, &summary)?;
    }
    show(json, &summary, || output::readable(&summary))
}

/// The figures of so many flights, from the first seed on, as docs/aircraft.md has them.
pub fn page(runs: u64) -> Result<String> {
    let options = Flights {
        runs: u32::try_from(runs).into_diagnostic()?,
        minutes_aided: 40,
        minutes_free: 60,
        seed_from: 0,
        out: None,
    };
    measure(&options).map(|(_, summary)| output::markdown(&summary))
}

fn measure(options: &Flights) -> Result<(Vec<Run>, Summary)> {
    let settings = Settings {
        minutes_aided: options.minutes_aided,
        minutes_free: options.minutes_free,
        errors: ErrorModel::hg1700(),
    };
    let route = Route::cessna172()?;
    let seeds = options.seed_from..options.seed_from + u64::from(options.runs);
    let runs = all(seeds, &route, &settings, &bar(options.runs)).into_diagnostic()?;
    let schuler = schuler(options.seed_from, &route, &settings.errors).into_diagnostic()?;
    let summary = Summary::new(&runs, &route, &settings, schuler);
    Ok((runs, summary))
}

fn bar(runs: u32) -> ProgressBar {
    let bar = ProgressBar::new(u64::from(runs));
    if let Ok(style) = ProgressStyle::with_template("flights {bar:40} {pos}/{len} {eta}") {
        bar.set_style(style);
    }
    bar
}
