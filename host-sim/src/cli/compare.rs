//! The command `compare`.

use std::path::PathBuf;

use clap::Args;
use miette::{Result, bail};

use super::options::{Output, read, refuse_same, report_line};
use crate::compare::{Comparison, JSON, NEVER, plain};
use crate::log::Grade;
use crate::page::progress::spinner;

#[derive(Debug, Args)]
pub struct Compare {
    /// Folder of a log, or a recording of a known format.
    log: PathBuf,
    /// Class of the sensors; else what meta.toml says, or what the gyros show at rest.
    #[arg(long, value_enum)]
    grade: Option<Grade>,
    #[command(flatten)]
    output: Output,
}

/// Runs every method over a log and writes how they compare.
pub fn compare(options: &Compare) -> Result<()> {
    options.output.check(JSON)?;
    refuse_same(&options.log, &options.output.out)?;
    let progress = spinner("reading");
    let input = read(&options.log, options.grade, &progress)?;
    let comparison = Comparison::of_input(input, &progress)?;
    options
        .output
        .fill(JSON, |folder| comparison.write(folder))?;
    options.output.print.result(&comparison, || {
        let report = report_line(&options.output.out);
        format!("{}\n{report}", plain(&comparison))
    })?;
    if !comparison.navigates() {
        bail!(
            help = "a longer log, with motion: see the warnings",
            "{NEVER}"
        );
    }
    Ok(())
}
