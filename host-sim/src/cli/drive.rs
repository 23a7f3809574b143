//! The commands `drive` and `demo`.

use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, Result};

use super::identify::{identify_log, print_analysis};
use super::options::{minutes, show};
use crate::aircraft::input::error_model;
use crate::identify::analysis::SUMMARY;
use crate::identify::true_errors::{self, Truth};
use crate::log::{self, BodyAxes, Compression, Grade, Log};
use crate::page::output;
use crate::page::progress::spinner;
use crate::sim::{self, DriveConfig, ErrorModel, SimulatedDrive};

#[derive(Debug, Args)]
pub(super) struct Drive {
    /// Folder of the log.
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    options: DriveOptions,
    /// Errors of the sensors if not those of their class: ideal, hg1700, mems or an error-model
    /// file.
    #[arg(long, value_name = "MODEL")]
    errors: Option<String>,
}

#[derive(Debug, Args)]
pub(super) struct Demo {
    /// Folder for log and report.
    #[arg(long, default_value = "out/demo")]
    out: PathBuf,
    #[command(flatten)]
    drive: DriveOptions,
}

#[derive(Clone, Copy, Debug, Args)]
struct DriveOptions {
    /// Fixes the route and every random number.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Class of the sensors.
    #[arg(long, value_enum, default_value_t = Grade::Hg1700)]
    grade: Grade,
    /// Length of the drive.
    #[arg(long, default_value_t = 40.0, value_parser = minutes)]
    minutes: f64,
}

/// Simulates a drive and writes its log.
pub(super) fn drive(options: &Drive, json: bool, force: bool) -> Result<()> {
    let errors = options.errors.as_deref().map(error_model).transpose()?;
    let truth = write_drive(&options.out, options.options, errors, force)?;
    let out = options.out.display();
    show(json, &truth, || format!("Log written to {out}\n"))
}

/// Simulates a drive, identifies it, and compares with the truth.
pub(super) fn demo(options: &Demo, json: bool) -> Result<()> {
    let (log, results) = (options.out.join("log"), options.out.join("report"));
    // An earlier demo can be had again at any time.
    let force = true;
    // Both before either, so that nothing is simulated in vain.
    output::check_free(&log, true_errors::FILE, force)?;
    output::check_free(&results, SUMMARY, force)?;
    write_drive(&log, options.drive, None, force)?;
    let (analysis, model) = identify_log(&log, &results, None, None, force)?;
    print_analysis(&analysis, Some(&model), &results, json)
}

fn write_drive(
    out: &Path,
    options: DriveOptions,
    errors: Option<ErrorModel>,
    force: bool,
) -> Result<Truth> {
    output::check_free(out, true_errors::FILE, force)?;
    let progress = spinner("simulating the drive");
    let mut config = DriveConfig::new(options.seed, options.grade.into(), options.minutes);
    if let Some(errors) = errors {
        config.recording.errors = errors;
    }
    let run = sim::simulate(&config);
    progress.set_message("writing the log");
    let name = format!("simulated drive, seed {}", options.seed);
    let mut drive = Simulated::new(run, &config.recording.errors, options.grade, name);
    let about = &mut drive.log.meta.document;
    about.insert("minutes".into(), options.minutes.into());
    output::build(out, true_errors::FILE, force, |folder| drive.write(folder))?;
    progress.finish_and_clear();
    Ok(drive.truth)
}

/// What was simulated, as the log of a unit, and its true errors.
pub(super) struct Simulated {
    pub(super) truth: Truth,
    log: Log,
}

impl Simulated {
    pub(super) fn new(
        run: SimulatedDrive,
        errors: &ErrorModel,
        grade: Grade,
        name: String,
    ) -> Self {
        let truth = Truth::new(&run.errors, run.azimuth_error_rad(), BodyAxes::Frd);
        let mut log = run.into_log(BodyAxes::Frd, errors.imu.output);
        log.meta.grade = Some(grade);
        log.meta.document.insert("name".into(), name.into());
        log.meta.document.insert("real_data".into(), false.into());
        Self { truth, log }
    }

    pub(super) fn write(&self, folder: &Path) -> Result<()> {
        log::write(&self.log, folder, Compression::Gzip)?;
        let errors = self.truth.to_toml().into_diagnostic()?;
        Ok(output::write(folder, true_errors::FILE, errors)?)
    }
}
