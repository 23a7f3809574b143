//! The command group `study`.

use clap::Subcommand;
use miette::Result;

use super::{conditions, logs, plan_drive};
use crate::rehearse::proof;

/// What is studied.
#[derive(Debug, Subcommand)]
pub enum Study {
    /// Try simulated vehicles, mounts and receivers of many kinds over seeds: how honest the core is.
    Conditions(conditions::cli::Conditions),
    /// Say what recorded logs can tell of the core: halves, methods, outages, free INS.
    Logs(logs::cli::Logs),
    /// Hold the sigmas that `plan-drive` foretells against the errors of simulated drives.
    PlanDrive(plan_drive::PlanDrive),
    /// Foretell the drift of recorded drives without GNSS by a model of other drives, and compare.
    Rehearse(proof::Proof),
}

/// Runs a study.
pub fn study(study: &Study, json: bool) -> Result<()> {
    match study {
        Study::Conditions(options) => conditions::cli::conditions(options, json),
        Study::Logs(options) => logs::cli::logs(options, json),
        Study::PlanDrive(options) => plan_drive::study(options, json),
        Study::Rehearse(options) => proof::prove(options, json),
    }
}
