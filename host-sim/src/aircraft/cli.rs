//! The commands `fly` and `aircraft`.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use ins_core::earth::wrap_pi;
use miette::{IntoDiagnostic, Result, miette};
use serde::Serialize;

use super::dynamics::Dynamics;
use super::flight::Flight;
use super::input::{read_aircraft, read_text};
use super::performance::{Performance, performance};
use super::pictures;
use super::plan::Plan;
use crate::cli::spinner;
use crate::log::{self, BodyAxes, Compression, Log, Meta};
use crate::output::{self, OutputError};
use crate::sim::drive::{Grade, Recording};
use crate::sim::{ErrorModel, SimulatedDrive, record};
use crate::truth::{self, Truth};

/// Inertial samples per second.
const IMU_HZ: f64 = 100.0;

/// Options of `fly`.
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

/// Options of `aircraft`.
#[derive(Debug, Args)]
pub struct Table {
    /// Aircraft, TOML; the Cessna 172 unless given.
    #[arg(long)]
    aircraft: Option<PathBuf>,
    /// Folder for pictures and the table.
    #[arg(long)]
    out: Option<PathBuf>,
}

/// That of a file, or the Cessna 172.
pub(crate) fn aircraft(file: Option<&Path>) -> Result<Dynamics> {
    match file {
        Some(file) => Ok(read_aircraft(file)?),
        None => Ok(Dynamics::new(&super::cessna172())),
    }
}

/// A preset by its name, or a file.
pub(crate) fn error_model(name: &str) -> Result<ErrorModel> {
    match name {
        "ideal" => Ok(Grade::Ideal.errors()),
        "hg1700" => Ok(Grade::Hg1700.errors()),
        "mems" => Ok(Grade::Mems.errors()),
        file => {
            let path = Path::new(file);
            let text = read_text(path, "ideal, hg1700, mems or an error model")?;
            ErrorModel::from_toml(&text).map_err(|error| {
                miette!(
                    help = "host-sim/errors/wave.toml is a complete example",
                    "{file}: {error}"
                )
            })
        }
    }
}

// --- fly ---

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
    output::check_free(&options.out, truth::FILE, force)?;
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
    let truth = Truth::new(&run.errors, azimuth_error_rad(&run), BodyAxes::Frd);
    let distance_km = 1e-3 * distance_m(&run);
    write(options, &recording, run, truth, force)?;
    progress.finish_and_clear();

    let summary = FlySummary {
        log: &options.out,
        aircraft: &dynamics.parameters.name,
        seed: options.seed,
        duration_s: recording.duration_s,
        distance_km,
        errors: &truth,
    };
    if json {
        println!(
            "{}",
            serde_json::to_string_pretty(&summary).into_diagnostic()?
        );
    } else {
        println!(
            "{}: {:.0} s, {distance_km:.1} km. Log and pictures written to {}",
            summary.aircraft,
            summary.duration_s,
            options.out.display()
        );
    }
    Ok(())
}

/// What a navigator has to be told of sensors: whether its gyros feel the Earth's rate.
fn class(errors: &ErrorModel) -> log::Grade {
    const EARTH_RATE_DEG_H: f64 = 15.0;
    if errors.gyro_deg_h.bias.initial_sigma() < EARTH_RATE_DEG_H {
        log::Grade::Hg1700
    } else {
        log::Grade::Mems
    }
}

fn azimuth_error_rad(run: &SimulatedDrive) -> Option<f64> {
    let start = run.truth.first()?;
    run.given_heading_rad
        .map(|given| wrap_pi(given - start.euler().heading_rad))
}

fn distance_m(run: &SimulatedDrive) -> f64 {
    run.truth
        .windows(2)
        .map(|w| w[1].position.enu_from(&w[0].position).xy().norm())
        .sum()
}

fn write(
    options: &Fly,
    recording: &Recording,
    run: SimulatedDrive,
    truth: Truth,
    force: bool,
) -> Result<()> {
    let drawn = pictures::of_flight(&run, recording.errors.imu.output);
    let name = format!("simulated flight, seed {}", options.seed);
    let entries = [
        ("name", toml::Value::from(name)),
        ("real_data", toml::Value::from(false)),
    ];
    let log = Log {
        meta: Meta {
            initial_heading_deg: run.given_heading_rad.map(f64::to_degrees),
            // A flight has no rest that would tell.
            grade: Some(class(&recording.errors)),
            document: entries
                .into_iter()
                .map(|(key, value)| (key.to_owned(), value))
                .collect(),
            ..Meta::new(BodyAxes::Frd, recording.errors.imu.output)
        },
        imu: run.imu,
        gnss: run.gnss,
        truth: run.truth,
    };
    let true_errors = truth.to_toml().into_diagnostic()?;
    let plan = fs::read(&options.plan).map_err(|e| OutputError::io(&options.plan, e))?;
    output::build(&options.out, truth::FILE, force, |folder| -> Result<()> {
        log::write(&log, folder, Compression::Gzip)?;
        for (name, contents) in [(truth::FILE, true_errors.as_bytes()), ("plan.toml", &plan)] {
            let path = folder.join(name);
            fs::write(&path, contents).map_err(|e| OutputError::io(&path, e))?;
        }
        pictures::write(&drawn, &folder.join("pictures"))?;
        Ok(())
    })
}

// --- aircraft ---

/// File name of the table; marks the folder as ours.
const TABLE: &str = "performance.json";

/// Prints the performance table and the modes of an aircraft.
pub fn table(options: &Table, json: bool, force: bool) -> Result<()> {
    let dynamics = aircraft(options.aircraft.as_deref())?;
    let name = &dynamics.parameters.name;
    let table = performance(&dynamics).ok_or_else(|| {
        miette!(
            help = "check mass, lift and power of its file",
            "the {name} cannot fly level at sea level"
        )
    })?;
    let text = serde_json::to_string_pretty(&table).into_diagnostic()?;
    if let Some(out) = &options.out {
        let slowest_mps = 1.05 * table.clean_stall_speed_kmh / 3.6;
        let drawn = pictures::of_aircraft(&dynamics, slowest_mps, table.max_speed_kmh / 3.6);
        output::build(out, TABLE, force, |folder| -> Result<()> {
            let path = folder.join(TABLE);
            fs::write(&path, text.clone() + "\n").map_err(|e| OutputError::io(&path, e))?;
            pictures::write(&drawn, folder)?;
            Ok(())
        })?;
    }
    if json {
        println!("{text}");
    } else {
        print!("{}", readable(&dynamics, &table));
    }
    Ok(())
}

fn readable(dynamics: &Dynamics, table: &Performance) -> String {
    let published = dynamics.parameters.specification.as_ref();
    let mut text = format!(
        "{}\n\n{:<34}{:>10}{:>15}\n",
        table.name, "", "model", "specification"
    );
    let rows = [
        (
            "maximum level speed, km/h",
            table.max_speed_kmh,
            published.map(|p| p.max_speed_kmh),
        ),
        (
            "stall speed, flaps down, km/h",
            table.stall_speed_kmh,
            published.map(|p| p.stall_speed_kmh),
        ),
        (
            "rate of climb, m/s",
            table.climb_rate_mps,
            published.map(|p| p.climb_rate_mps),
        ),
        (
            "stall speed, flaps up, km/h",
            table.clean_stall_speed_kmh,
            None,
        ),
        ("speed of best climb, km/h", table.climb_speed_kmh, None),
        ("service ceiling, m", table.service_ceiling_m, None),
        ("ceiling, m", table.ceiling_m, None),
        (
            "engine at full speed, rpm",
            table.engine_rpm_at_max_speed,
            None,
        ),
        ("engine in the climb, rpm", table.engine_rpm_in_climb, None),
    ];
    for (name, value, published) in rows {
        let published = published.map_or(String::new(), |p| format!("{p:.1}"));
        let _ = writeln!(text, "{name:<34}{value:>10.1}{published:>15}");
    }
    let _ = writeln!(
        text,
        "\nSteady level flight at sea level: trim and natural motions\n{:>8}{:>8}{:>9}{:>9}{:>9}{:>14}{:>14}{:>14}{:>8}{:>8}",
        "m/s",
        "alpha",
        "elevator",
        "throttle",
        "power",
        "phugoid",
        "short period",
        "Dutch roll",
        "roll",
        "spiral"
    );
    let _ = writeln!(
        text,
        "{:>8}{:>8}{:>9}{:>9}{:>9}{:>14}{:>14}{:>14}{:>8}{:>8}",
        "", "deg", "deg", "", "kW", "s, damping", "s, damping", "s, damping", "s", "s"
    );
    for row in &table.trims {
        let _ = write!(
            text,
            "{:>8.1}{:>8.2}{:>9.2}{:>9.2}{:>9.1}",
            row.airspeed_mps, row.alpha_deg, row.elevator_deg, row.throttle, row.shaft_power_kw
        );
        if let Some(modes) = &row.modes {
            for mode in [&modes.phugoid, &modes.short_period, &modes.dutch_roll] {
                let _ = write!(text, "{:>8.2} {:>5.2}", mode.period_s, mode.damping_ratio);
            }
            let _ = write!(
                text,
                "{:>8.2}{:>8.0}",
                modes.roll_time_constant_s, modes.spiral_time_constant_s
            );
        }
        text.push('\n');
    }
    text
}
