//! The command `tune`.

use std::path::PathBuf;

use clap::Args;
use miette::{IntoDiagnostic, Result};

use crate::cli::identify::error_model_of;
use crate::cli::options::{Class, Print, print, print_warnings};
use crate::identify::analysis::{Analysis, Input};
use crate::identify::error_model::Record;
use crate::log::import::Choice;
use crate::page::progress::bar;
use crate::tune::Tuning;
use crate::tune::targets::{self, Target};

#[derive(Debug, Args)]
pub struct Tune {
    /// Folder of a log, or a recording of a known format; or one of inertial sensors and one of GNSS.
    #[arg(required = true)]
    log: Vec<PathBuf>,
    /// Whose parameters to print.
    #[arg(long, value_enum, default_value_t = Target::Table, conflicts_with = "json")]
    format: Target,
    #[command(flatten)]
    choice: Choice,
    #[command(flatten)]
    class: Class,
    #[command(flatten)]
    print: Print,
}

/// Identifies a log and prints it as parameters.
pub fn tune(options: &Tune) -> Result<()> {
    let progress = bar();
    let input = Input::read_all(&options.log, options.choice, options.class.grade, &progress)?;
    progress.suspend(|| print_warnings(&input.warnings));
    let analysis = Analysis::of_input(input, &progress)?;
    let records = [Record::new(&analysis.log, &analysis.found)];
    let model = error_model_of(&records, analysis.summary.grade, None);
    let tuning = Tuning::new(&analysis, &model);
    let target = if options.print.json {
        Target::Json
    } else {
        options.format
    };
    // All of it, or nothing.
    print(&targets::text(&tuning, target).into_diagnostic()?)
}
