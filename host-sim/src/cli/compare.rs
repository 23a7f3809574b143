//! The command `compare`.

use std::path::PathBuf;

use clap::Args;
use miette::Result;

use super::options::{Class, Output, read, refuse_same, report_line};
use crate::compare::{Comparison, JSON, plain};
use crate::page::progress::spinner;

#[derive(Debug, Args)]
pub struct Compare {
    /// Folder of a log, or a recording of a known format.
    log: PathBuf,
    #[command(flatten)]
    class: Class,
    #[command(flatten)]
    output: Output,
}

/// Runs every method over a log and writes the comparison.
pub fn compare(options: &Compare) -> Result<()> {
    let output = &options.output;
    output.check(JSON)?;
    refuse_same(&options.log, &output.out)?;
    let progress = spinner("reading");
    let input = read(&options.log, options.class.grade, &progress)?;
    let comparison = Comparison::of_input(input, &progress)?;
    output.fill(JSON, |folder| comparison.write(folder))?;
    output.print.result(&comparison, || {
        format!("{}\n{}", plain(&comparison), report_line(&output.out))
    })
}
