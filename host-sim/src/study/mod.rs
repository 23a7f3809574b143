//! The commands `study`: how honest the core is.

pub mod conditions;

use clap::Subcommand;
use miette::Result;

/// What is studied.
#[derive(Debug, Subcommand)]
pub enum Study {
    /// Simulated vehicles, mounts and receivers of many kinds, over seeds.
    Conditions(conditions::cli::Conditions),
}

/// Runs a study.
pub fn study(options: &Study, json: bool) -> Result<()> {
    match options {
        Study::Conditions(options) => conditions::cli::conditions(options, json),
    }
}
