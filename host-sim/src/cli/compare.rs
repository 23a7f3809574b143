//! The command `compare`.

use std::path::PathBuf;

use clap::Args;
use miette::Result;

use super::options::{GradeChoice, Output, refuse_same};
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
    #[command(flatten)]
    output: Output,
}

/// Runs every method over a log and writes how they compare.
pub fn compare(options: &Compare) -> Result<()> {
    output::check_free(&options.out, JSON, options.output.force)?;
    refuse_same(&options.log, &options.out)?;
    let progress = spinner("reading");
    let comparison = Comparison::of_log(&options.log, options.grade.told(), &progress)?;
    output::build(&options.out, JSON, options.output.force, |folder| {
        comparison.write(folder)
    })?;
    options.output.print.result(&comparison, || {
        let report = options.out.join("report.html");
        format!("{}\nReport: {}\n", plain(&comparison), report.display())
    })
}
