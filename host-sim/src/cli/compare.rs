//! The command `compare`.

use std::path::PathBuf;

use clap::Args;
use miette::Result;

use super::options::{GradeChoice, refuse_same, show};
use crate::compare::{Comparison, JSON, plain};
use crate::page::output;
use crate::page::progress::spinner;

#[derive(Debug, Args)]
pub struct Compare {
    /// Folder of a log, or a recording of a known format.
    log: PathBuf,
    /// Folder for the results.
    #[arg(long)]
    out: PathBuf,
    /// Class of the sensors.
    #[arg(long, value_enum, default_value_t = GradeChoice::Auto)]
    grade: GradeChoice,
}

/// Runs every method over a log and writes how they compare.
pub fn compare(options: &Compare, json: bool, force: bool) -> Result<()> {
    output::check_free(&options.out, JSON, force)?;
    refuse_same(&options.log, &options.out)?;
    let progress = spinner("reading");
    let comparison = Comparison::of_log(&options.log, options.grade.told(), &progress)?;
    output::build(&options.out, JSON, force, |folder| comparison.write(folder))?;
    show(json, &comparison, || {
        let report = options.out.join("report.html");
        format!("{}\nReport: {}\n", plain(&comparison), report.display())
    })
}
