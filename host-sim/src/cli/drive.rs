//! The command `drive`.

use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, Result};

use super::options::{DriveOptions, error_model, show};
use crate::identify::true_errors::{self, Truth};
use crate::log::{self, BodyAxes, Compression};
use crate::page::output;
use crate::page::progress::spinner;
use crate::sim::{self, DriveConfig, ErrorModel};

/// Options of `drive`.
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

/// Simulates a drive and writes its log.
pub(super) fn drive(options: &Drive, json: bool, force: bool) -> Result<()> {
    let errors = options.errors.as_deref().map(error_model).transpose()?;
    let truth = write_drive(&options.out, options.options, errors, force)?;
    let out = options.out.display();
    show(json, &truth, || format!("Log written to {out}\n"))
}

pub(super) fn write_drive(
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
    let drive = sim::simulate(&config);
    progress.set_message("writing the log");
    let truth = Truth::new(&drive.errors, drive.azimuth_error_rad(), BodyAxes::Frd);
    let mut log = drive.into_log(BodyAxes::Frd, config.recording.errors.imu.output);
    log.meta.grade = Some(options.grade);
    let about = &mut log.meta.document;
    let name = format!("simulated drive, seed {}", options.seed);
    about.insert("name".into(), name.into());
    about.insert("real_data".into(), false.into());
    about.insert("minutes".into(), options.minutes.into());
    let errors = truth.to_toml().into_diagnostic()?;
    output::build(out, true_errors::FILE, force, |folder| -> Result<()> {
        log::write(&log, folder, Compression::Gzip)?;
        Ok(output::write(folder, true_errors::FILE, errors)?)
    })?;
    progress.finish_and_clear();
    Ok(truth)
}
