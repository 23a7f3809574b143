//! The command `study recordings`.

use std::path::PathBuf;

use clap::Args;
use miette::Result;

use super::options::{GradeChoice, show};
use crate::page::progress::{bar, counted};
use crate::study::recordings::{Recording, recordings, table};

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
    let progress = bar().with_message("trying");
    progress.set_length(options.paths.len() as u64);
    let one = |path: &PathBuf| recordings(path, options.grade.told());
    let rows: Vec<Recording> = (options.paths.iter())
        .flat_map(counted(&progress, one))
        .collect();
    progress.finish_and_clear();
    show(json, &rows, || table(&rows).plain())
}
