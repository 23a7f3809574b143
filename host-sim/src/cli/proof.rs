//! The command `study rehearse`.

use std::path::PathBuf;

use clap::Args;
use miette::Result;

use super::identify::error_model_of;
use super::options::{GradeChoice, show};
use super::rehearse::{in_keys, keys};
use crate::identify::analysis::Analysis;
use crate::page::progress::bar;
use crate::rehearse::proof::{Row, readable, tried};
use crate::rehearse::settings::Drives;

/// Options of `study rehearse`.
#[derive(Debug, Args)]
pub struct Proof {
    /// Drives that the model is of.
    #[arg(required = true)]
    pub(super) drives: Vec<PathBuf>,
    /// Drives of the same unit on which it is tried.
    #[arg(long, required = true, num_args = 1..)]
    pub(super) against: Vec<PathBuf>,
    /// TOML with any keys of an error model that stand in place of what was identified or assumed.
    #[arg(long, value_name = "FILE")]
    pub(super) set: Option<PathBuf>,
    /// Simulations of each of them.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(2..=1000))]
    pub(super) seeds: u64,
    /// Class of the sensors.
    #[arg(long, value_enum, default_value_t = GradeChoice::Auto)]
    pub(super) grade: GradeChoice,
}

/// Foretells, compares, prints.
pub fn prove(options: &Proof, json: bool) -> Result<()> {
    let rows = rows(options)?;
    show(json, &rows, || readable(&rows))
}

/// Foretells and compares.
pub(super) fn rows(options: &Proof) -> Result<Vec<Row>> {
    let drives = Drives::read(&options.drives, options.grade.told())?;
    let mut model = error_model_of(&drives.records, drives.grade, None).model();
    model.imu.output = drives.output;
    let set = options.set.as_deref();
    let model = (model.with(&keys(set)?)).map_err(|error| in_keys(set, &error))?;
    let mut rows = Vec::new();
    for path in &options.against {
        let analysis = Analysis::of_log(path, Some(drives.grade), &bar())?;
        rows.extend(tried(&analysis, &model, options.seeds)?);
    }
    Ok(rows)
}
