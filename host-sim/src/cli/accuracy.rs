//! The command `accuracy`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use ins_core::config::Form;
use miette::{Result, miette};

use super::options::{minutes, show};
use crate::log::Grade;
use crate::page::output;
use crate::page::progress::bar;
use crate::study::accuracy::{JSON, Results, Study, write};

/// Options of `accuracy`.
#[derive(Debug, Args)]
pub struct Accuracy {
    /// Class of the sensors.
    #[arg(long, value_enum, default_value_t = Grade::Hg1700)]
    grade: Grade,
    /// Number of drives.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    runs: u64,
    /// Length of a drive.
    #[arg(long, default_value_t = 40.0, value_parser = minutes)]
    minutes: f64,
    /// Seed of the first drive; the others follow.
    #[arg(long, default_value_t = 0)]
    first_seed: u64,
    /// Bandwidth of the horizontal damping loop, rad/s.
    #[arg(long)]
    bandwidth: Option<f64>,
    /// Form of the estimators.
    #[arg(long, value_enum, default_value_t = FormChoice::Exact)]
    form: FormChoice,
    /// Run a Kalman filter in place of the core, which takes the noise of the inertial sensors for
    /// FACTOR times what it is.
    #[arg(long, value_name = "FACTOR", value_parser = factor)]
    kalman: Option<f64>,
    /// Give that filter no level positions.
    #[arg(long, requires = "kalman")]
    velocity_alone: bool,
    /// Folder for accuracy.json, accuracy.csv and accuracy.svg.
    #[arg(long)]
    out: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum FormChoice {
    /// Controls undone exactly, all parameters jointly.
    Exact,
    /// The thesis's (7) to (11) as printed.
    Literal,
}

fn factor(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(factor) if (0.01..=100.0).contains(&factor) => Ok(factor),
        _ => Err("a factor from 0.01 to 100".to_owned()),
    }
}

/// Runs many drives and says how good the estimates were.
pub fn accuracy(options: &Accuracy, json: bool, force: bool) -> Result<()> {
    if let Some(out) = &options.out {
        output::check_free(out, JSON, force)?;
    }
    let study = Study {
        minutes: options.minutes,
        first_seed: options.first_seed,
        form: match options.form {
            FormChoice::Exact => Form::Exact,
            FormChoice::Literal => Form::Literal,
        },
        bandwidth_radps: options.bandwidth,
        kalman_noise: options.kalman,
        kalman_positions: !options.velocity_alone,
        ..Study::new(options.grade.into(), options.runs)
    };
    let results = study
        .results(&bar().with_message("driving"))
        .map_err(|error| miette!("these options cannot be used: {}", error))?;
    if let Some(out) = &options.out {
        output::build(out, JSON, force, |folder| write(&results, folder))?;
    }
    show(json, &results, || readable(&results))
}

fn readable(results: &Results) -> String {
    let study = &results.study;
    let limits = if study.has_limits() {
        "limit: a Kalman filter that knows the exact noises, on the linear model.\n"
    } else {
        ""
    };
    format!(
        "{} drives of {} min, seeds from {}: {} converged.\n\n{}\n{limits}\
         Of honest errors {:.0} +- {:.0} % lie within one sigma (95 times out of 100).\n",
        study.runs,
        study.minutes,
        study.first_seed,
        results.converged,
        results.table().plain(),
        68.0,
        results.coverage_spread_percent(),
    )
}
