//! The command `reproduce-thesis`.

use std::path::{Path, PathBuf};

use clap::Args;
use miette::Result;

use super::options::{Output, print_warnings, refuse_same, report_line};
use crate::identify::analysis::log_name;
use crate::log::import;
use crate::page::progress::spinner;
use crate::study::reproduce::{JSON, Recorded, Settings, reproduce as measure};

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.help("Folder for drawings, data and report")))]
pub struct Reproduce {
    /// Fixes every drive, unit and flight.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// A log or recording on which Figures 3, 4, 6 and 7 are drawn too.
    #[arg(long)]
    log: Option<PathBuf>,
    #[command(flatten)]
    output: Output,
}

fn read(path: &Path) -> Result<Recorded> {
    let (log, warnings) = import::open(path)?;
    print_warnings(&warnings);
    Ok(Recorded {
        name: log_name(path, &log),
        log,
    })
}

/// Regenerates the thesis's figures and tables.
pub fn reproduce(options: &Reproduce) -> Result<()> {
    let output = &options.output;
    output.check(JSON)?;
    if let Some(log) = &options.log {
        refuse_same(log, &output.out)?;
    }
    let recorded = options.log.as_deref().map(read).transpose()?;
    let progress = spinner("simulating drives and flights");
    let reproduction = measure(Settings::new(options.seed), recorded.as_ref())?;
    progress.finish_and_clear();
    output.fill(JSON, |folder| reproduction.write(folder))?;
    output.print.result(&reproduction, || {
        format!("{}\n{}", reproduction.readable(), report_line(&output.out))
    })
}
