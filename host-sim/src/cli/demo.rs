//! The command `demo`.

use std::path::PathBuf;

use clap::Args;
use miette::Result;

use super::drive::write_drive;
use super::identify::{identify_log, print_analysis};
use super::options::DriveOptions;
use crate::identify::analysis::SUMMARY;
use crate::identify::true_errors;
use crate::page::output;

/// Options of `demo`.
#[derive(Debug, Args)]
pub(super) struct Demo {
    /// Folder for log and report.
    #[arg(long, default_value = "out/demo")]
    out: PathBuf,
    #[command(flatten)]
    drive: DriveOptions,
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
