//! The command `fly`.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::{Result, miette};
use serde::Serialize;

use super::drive::Simulated;
use super::options::{aircraft, show};
use crate::aircraft::flight::Flight;
use crate::aircraft::input::error_model;
use crate::aircraft::pictures;
use crate::aircraft::plan::Plan;
use crate::identify::true_errors::{self, Truth};
use crate::log::Grade;
use crate::page::output::{self, OutputError};
use crate::page::progress::spinner;
use crate::sim::drive::Recording;
use crate::sim::{ErrorModel, SimulatedDrive, record};

/// Inertial samples per second.
const IMU_HZ: f64 = 100.0;

#[derive(Debug, Args)]
pub struct Fly {
    /// Flight plan, TOML.
    #[arg(long)]
    plan: PathBuf,
    /// Fixes turbulence and sensor errors.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder of the log.
    #[arg(long)]
    out: PathBuf,
    /// Sensor errors: ideal, hg1700, mems, or a file with an error model.
    #[arg(long, default_value = "hg1700")]
    errors: String,
    /// Aircraft, TOML; the Cessna 172 unless given.
    #[arg(long)]
    aircraft: Option<PathBuf>,
}

/// What `fly --json` prints.
#[derive(Serialize)]
struct FlySummary<'a> {
    log: &'a Path,
    aircraft: &'a str,
    seed: u64,
    duration_s: f64,
    distance_km: f64,
    errors: &'a Truth,
}

/// Flies a plan and writes its log, with truth and pictures.
pub fn fly(options: &Fly, json: bool, force: bool) -> Result<()> {
    output::check_free(&options.out, true_errors::FILE, force)?;
    let dynamics = aircraft(options.aircraft.as_deref())?;
    let errors = error_model(&options.errors)?;
    let plan = Plan::read(&options.plan, &dynamics)?;
    let progress = spinner("flying");
    let in_plan = |error| miette!("{}: {error}", options.plan.display());
    let flight = Flight::new(&dynamics, &plan, options.seed).map_err(in_plan)?;
    let recording = Recording {
        seed: options.seed,
        duration_s: flight.duration_s().map_err(in_plan)?,
        imu_hz: IMU_HZ,
        truth_every: 10,
        origin: plan.start.position,
        errors,
    };
    let run = record(flight, &recording);
    progress.set_message("writing the log");
    let drawn = pictures::of_flight(&run, recording.errors.imu.output);
    let distance_km = 1e-3 * distance_m(&run);
    let name = format!("simulated flight, seed {}", options.seed);
    // A flight has no rest that would tell.
    let grade = class(&recording.errors);
    let flown = Simulated::new(run, &recording.errors, grade, name);
    let plan = fs::read(&options.plan).map_err(|e| OutputError::io(&options.plan, e))?;
    let write = |folder: &Path| -> Result<()> {
        flown.write(folder)?;
        output::write(folder, "plan.toml", &plan)?;
        Ok(pictures::write(&drawn, &folder.join("pictures"))?)
    };
    output::build(&options.out, true_errors::FILE, force, write)?;
    progress.finish_and_clear();

    let summary = FlySummary {
        log: &options.out,
        aircraft: &dynamics.parameters.name,
        seed: options.seed,
        duration_s: recording.duration_s,
        distance_km,
        errors: &flown.truth,
    };
    show(json, &summary, || {
        format!(
            "{}: {:.0} s, {distance_km:.1} km. Log and pictures written to {}\n",
            summary.aircraft,
            summary.duration_s,
            options.out.display()
        )
    })
}

/// What a navigator has to be told of sensors: whether its gyros feel the Earth's rate.
fn class(errors: &ErrorModel) -> Grade {
    const EARTH_RATE_DEG_H: f64 = 15.0;
    if errors.gyro_deg_h.bias.initial_sigma() < EARTH_RATE_DEG_H {
        Grade::Hg1700
    } else {
        Grade::Mems
    }
}

fn distance_m(run: &SimulatedDrive) -> f64 {
    run.truth
        .windows(2)
        .map(|w| w[1].position.enu_from(&w[0].position).xy().norm())
        .sum()
}
