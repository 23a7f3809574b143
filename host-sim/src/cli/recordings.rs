//! The command `study recordings`.

use std::path::PathBuf;

use clap::Args;
use miette::Result;

use super::options::{GradeChoice, show};
use crate::page::progress::bar;
use crate::study::recordings::{recordings, table};

/// Options of `study recordings`.
#[derive(Debug, Args)]
pub struct Recordings {
    /// Recordings of any known format, and folders of logs; each is opened on its own.
    #[arg(required = true)]
    paths: Vec<PathBuf>,
    /// Class of the sensors.
    #[arg(long, value_enum, default_value_t = GradeChoice::Auto)]
    grade: GradeChoice,
}

/// Tries every recording, one after another, for their times are told.
pub fn study(options: &Recordings, json: bool) -> Result<()> {
    let progress = bar();
    progress.set_message("trying");
    progress.set_length(options.paths.len() as u64);
    let mut rows = Vec::new();
    for path in &options.paths {
        rows.extend(recordings(path, options.grade.told()));
        progress.inc(1);
    }
    progress.finish_and_clear();
    show(json, &rows, || table(&rows).plain())
}
