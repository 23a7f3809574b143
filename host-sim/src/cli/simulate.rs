//! The commands that simulate: `drive`, `demo` and `fly`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum as _};
use miette::{IntoDiagnostic, Result, miette};
use serde::Serialize;

use super::identify::{identify_log, text_of};
use super::options::{Output, Print, aircraft, build};
use crate::aircraft::flight::Flight;
use crate::aircraft::input::error_model;
use crate::aircraft::pictures;
use crate::aircraft::plan::Plan;
use crate::identify::analysis::SUMMARY;
use crate::identify::true_errors::{self, Truth};
use crate::log::{self, BodyAxes, Compression, Grade, Log};
use crate::page::output;
use crate::page::progress::spinner;
use crate::sim::drive::{IMU_HZ, Recording};
use crate::sim::{DriveConfig, ErrorModel, SimulatedDrive, record, simulate};
use crate::study::options::minutes;

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.help("Folder of the log")))]
pub(super) struct Drive {
    #[command(flatten)]
    options: DriveOptions,
    /// Errors of the sensors if not those of their class: ideal, hg1700, mems or an error-model
    /// file.
    #[arg(long, value_name = "MODEL")]
    errors: Option<String>,
    #[command(flatten)]
    output: Output,
}

#[derive(Debug, Args)]
pub(super) struct Demo {
    /// Folder for log and report.
    #[arg(long, default_value = "out/demo")]
    out: PathBuf,
    #[command(flatten)]
    drive: DriveOptions,
    #[command(flatten)]
    print: Print,
}

#[derive(Clone, Copy, Debug, Args)]
struct DriveOptions {
    /// Fixes the route and every random number.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Class of the sensors, hg1700 unless their errors are of another.
    #[arg(long, value_enum)]
    grade: Option<Grade>,
    /// Length of the drive.
    #[arg(long, default_value_t = 40.0, value_parser = minutes)]
    minutes: f64,
}

/// Simulates a drive and writes its log.
pub(super) fn drive(options: &Drive) -> Result<()> {
    let errors = (options.errors.as_deref()).map(errors_of).transpose()?;
    warn_of_other_class(options.errors.as_deref(), options.options.grade);
    let Output { out, print, force } = &options.output;
    let truth = write_drive(out, options.options, errors, *force)?;
    let out = out.display();
    print.result(&truth, || format!("Log written to {out}\n"))
}

/// Error model of a name or file; warns of keys that have no effect on a log.
fn errors_of(name: &str) -> Result<ErrorModel> {
    let errors = error_model(name)?;
    (errors.check_at(IMU_HZ)).map_err(|error| miette!("{name}: {error}, {IMU_HZ} a second"))?;
    if errors.gnss.habits.delay_s[1] > 0.0 {
        eprintln!(
            "warning: {name}: gnss.habits.delay_s does nothing here: a log has no times of arrival"
        );
    }
    Ok(errors)
}

/// Warns if the class of the log differs from that of its sensors.
fn warn_of_other_class(errors: Option<&str>, grade: Option<Grade>) {
    let class = errors.and_then(|errors| Grade::from_str(errors, false).ok());
    if let (Some(class), Some(grade)) = (class, grade)
        && class != grade
    {
        let [class, grade] = [class, grade].map(Grade::name);
        eprintln!("warning: --grade {grade} with --errors {class}: sensors of another class");
    }
}

/// Simulates a drive, identifies it, and compares with the truth.
pub(super) fn demo(options: &Demo) -> Result<()> {
    let (log, results) = (options.out.join("log"), options.out.join("report"));
    // A demo is reproducible.
    let force = true;
    // Both before the simulation.
    output::check_free(&log, true_errors::FILE, force)?;
    output::check_free(&results, SUMMARY, force)?;
    write_drive(&log, options.drive, None, force)?;
    let (analysis, model) = identify_log(&log, &results, None, None, force)?;
    let text = || text_of(&analysis, Some(&model), &results);
    options.print.result(&analysis.summary, text)
}

fn write_drive(
    out: &Path,
    options: DriveOptions,
    errors: Option<ErrorModel>,
    force: bool,
) -> Result<Truth> {
    output::check_free(out, true_errors::FILE, force)?;
    let progress = spinner("simulating the drive");
    let class = || errors.as_ref().map_or(Grade::Hg1700, class);
    let grade = options.grade.unwrap_or_else(class);
    let mut config = DriveConfig::new(options.seed, grade, options.minutes);
    if let Some(errors) = errors {
        config.recording.errors = errors;
    }
    let run = simulate(&config);
    progress.set_message("writing the log");
    let name = format!("simulated drive, seed {}", options.seed);
    let mut drive = Simulated::new(run, &config.recording.errors, grade, name);
    let about = &mut drive.log.meta.document;
    about.insert("minutes".into(), options.minutes.into());
    build(out, true_errors::FILE, force, |folder| drive.write(folder))?;
    progress.finish_and_clear();
    Ok(drive.truth)
}

/// The simulated log of a unit, and its true errors.
struct Simulated {
    truth: Truth,
    log: Log,
}

impl Simulated {
    fn new(run: SimulatedDrive, errors: &ErrorModel, grade: Grade, name: String) -> Self {
        let truth = Truth::new(&run.errors, run.azimuth_error_rad(), BodyAxes::Frd);
        let mut log = run.into_log(BodyAxes::Frd, errors.imu.output);
        log.meta.grade = Some(grade);
        log.meta.document.insert("name".into(), name.into());
        log.meta.document.insert("real_data".into(), false.into());
        Self { truth, log }
    }

    fn write(&self, folder: &Path) -> Result<()> {
        log::write(&self.log, folder, Compression::Gzip)?;
        let errors = self.truth.to_toml().into_diagnostic()?;
        Ok(output::write(folder, true_errors::FILE, errors)?)
    }
}

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.help("Folder of the log")))]
pub(super) struct Fly {
    /// Flight plan, TOML.
    #[arg(long)]
    plan: PathBuf,
    /// Fixes turbulence and sensor errors.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Sensor errors: ideal, hg1700, mems, or a file with an error model.
    #[arg(long, default_value = "hg1700")]
    errors: String,
    /// Aircraft, TOML; the Cessna 172 unless given.
    #[arg(long)]
    aircraft: Option<PathBuf>,
    #[command(flatten)]
    output: Output,
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
pub(super) fn fly(options: &Fly) -> Result<()> {
    options.output.check(true_errors::FILE)?;
    let dynamics = aircraft(options.aircraft.as_deref())?;
    let errors = errors_of(&options.errors)?;
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
    // In a flight there may be no rest to determine it from.
    let grade = class(&recording.errors);
    let flown = Simulated::new(run, &recording.errors, grade, name);
    let plan = output::read(&options.plan)?;
    let write = |folder: &Path| -> Result<()> {
        flown.write(folder)?;
        output::write(folder, "plan.toml", &plan)?;
        Ok(pictures::write(&drawn, &folder.join("pictures"))?)
    };
    options.output.fill(true_errors::FILE, write)?;
    progress.finish_and_clear();

    let summary = FlySummary {
        log: &options.output.out,
        aircraft: &dynamics.parameters.name,
        seed: options.seed,
        duration_s: recording.duration_s,
        distance_km,
        errors: &flown.truth,
    };
    options.output.print.result(&summary, || {
        format!(
            "{}: {:.0} s, {distance_km:.1} km. Log and pictures written to {}\n",
            summary.aircraft,
            summary.duration_s,
            options.output.out.display()
        )
    })
}

/// Class for the configuration of the core: whether the gyros resolve Earth rate, with the noise of a second and
/// the drift of an hour. The limit of noise is between those of the two presets.
fn class(errors: &ErrorModel) -> Grade {
    const EARTH_RATE_DEG_H: f64 = 15.0;
    let gyros = &errors.gyro_deg_h;
    let noise_deg_h = gyros.noise_times.map(|times| times * gyros.white_noise);
    let bias_deg_h = libm::hypot(gyros.bias.sigma_after(3600.0), gyros.warming_sigma);
    let worst_deg_h = noise_deg_h.into_iter().fold(bias_deg_h, f64::max);
    if worst_deg_h < EARTH_RATE_DEG_H {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::errors::BiasModel;

    #[test]
    fn a_class_is_that_of_bias_drift_and_noise() {
        let of = |bias: BiasModel, white_noise: f64| {
            let mut errors = ErrorModel::hg1700();
            errors.gyro_deg_h.bias = bias;
            errors.gyro_deg_h.white_noise = white_noise;
            class(&errors)
        };
        for preset in [Grade::Hg1700, Grade::Mems] {
            assert_eq!(class(&preset.errors()), preset);
        }
        let wave = include_str!("../../errors/wave.toml");
        assert_eq!(class(&ErrorModel::from_toml(wave).unwrap()), Grade::Hg1700);
        // Calibrated, but with bias drift.
        assert_eq!(of(BiasModel::drifting(10.0, 40.0), 7.5), Grade::Mems);
        let jumps = BiasModel::Wave {
            initial_sigma: 1.0,
            interval_s: 10.0,
            jump_mean: 0.0,
            jump_sigma: 1.0,
        };
        // 19 deg/h within the hour.
        assert_eq!(of(jumps, 7.5), Grade::Mems);
        assert_eq!(of(BiasModel::constant(1.0), 30.0), Grade::Mems);
        assert_eq!(of(BiasModel::drifting(5.0, 5.0), 7.5), Grade::Hg1700);
    }
}
