//! The command `study logs`.

use std::path::PathBuf;

use clap::Args;
use miette::Result;
use rayon::prelude::*;

use super::options::{GradeChoice, show};
use crate::page::progress::{bar, counted};
use crate::study::logs::page::plain;
use crate::study::logs::role::{Role, name_of};
use crate::study::logs::{LogStudy, Study};

/// Options of `study logs`.
#[derive(Debug, Args)]
pub struct Logs {
    /// Folders of recorded logs.
    #[arg(required = true)]
    #[allow(clippy::struct_field_names)] // Named on the command line.
    logs: Vec<PathBuf>,
    /// Only the logs that nothing was developed on: all but the development logs.
    #[arg(long, conflicts_with = "development")]
    judges: bool,
    /// Only the development logs.
    #[arg(long)]
    development: bool,
    /// Class of the sensors.
    #[arg(long, value_enum, default_value_t = GradeChoice::Auto)]
    grade: GradeChoice,
}

impl Logs {
    fn wants(&self, role: Role) -> bool {
        match role {
            Role::Development => !self.judges,
            Role::Judge => !self.development,
        }
    }
}

/// Studies every log; one that cannot be used is named, and the others go on.
pub fn logs(options: &Logs, json: bool) -> Result<()> {
    let folders: Vec<&PathBuf> = options
        .logs
        .iter()
        .filter(|folder| options.wants(Role::of(&name_of(folder))))
        .collect();
    let progress = bar().with_message("studying");
    progress.set_length(folders.len() as u64);
    let one = |folder: &&PathBuf| LogStudy::of_folder(folder, options.grade.told(), &progress);
    // Longest work first to whoever is free; results stand in the order of the folders.
    let studies: Vec<Result<LogStudy>> = (folders.par_iter())
        .with_max_len(1)
        .map(counted(&progress, one))
        .collect();
    progress.finish_and_clear();
    let mut logs = Vec::new();
    for (folder, study) in folders.iter().zip(studies) {
        match study {
            Ok(study) => logs.push(study),
            Err(error) => eprintln!("{}: {error:?}", folder.display()),
        }
    }
    let study = Study::new(logs);
    show(json, &study, || plain(&study))
}
