//! The command `reproduce`.

use std::path::PathBuf;

use clap::Args;
use miette::Result;

use super::options::show;
use crate::page::output;
use crate::page::progress::spinner;
use crate::study::reproduce::output::plain;
use crate::study::reproduce::{JSON, Settings, markdown, reproduce as measure};

/// Options of `reproduce`.
#[derive(Debug, Args)]
pub struct Reproduce {
    /// Folder for drawings, data and report.
    #[arg(long)]
    out: PathBuf,
    /// Fixes every drive, unit and flight.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// The numbers, as docs/thesis.md has them.
pub fn page() -> Result<String> {
    measure(Settings::new(1)).map(|reproduction| markdown(&reproduction))
}

/// Regenerates the thesis's figures and tables.
pub fn reproduce(options: &Reproduce, json: bool, force: bool) -> Result<()> {
    output::check_free(&options.out, JSON, force)?;
    let progress = spinner("simulating drives and flights");
    let reproduction = measure(Settings::new(options.seed))?;
    progress.finish_and_clear();
    output::build(&options.out, JSON, force, |folder| {
        reproduction.write(folder)
    })?;
    show(json, &reproduction, || {
        let report = options.out.join("report.html");
        format!(
            "{}
Report: {}
",
            plain(&reproduction),
            report.display()
        )
    })
}
