//! The command group `study`.

use clap::Subcommand;
use miette::Result;

use super::{conditions, logs, plan_drive, proof, recordings};

/// What is studied.
#[derive(Debug, Subcommand)]
pub enum Study {
    /// Try simulated vehicles, mounts and receivers of many kinds over seeds: how honest the core is.
    Conditions(conditions::Conditions),
    /// Say what recorded logs can tell of the core: halves, methods, outages, free INS.
    Logs(logs::Logs),
    /// Try recordings of any format: what is found in each, what is warned of, and the time it takes.
    Recordings(recordings::Recordings),
    /// Hold the sigmas that `plan-drive` foretells against the errors of simulated drives.
    PlanDrive(plan_drive::study::PlanDrive),
    /// Foretell the drift of recorded drives without GNSS by a model of other drives, and compare.
    Rehearse(proof::Proof),
}

/// Runs a study.
pub fn study(study: &Study, json: bool) -> Result<()> {
    match study {
        Study::Conditions(options) => conditions::conditions(options, json),
        Study::Logs(options) => logs::logs(options, json),
        Study::Recordings(options) => recordings::study(options, json),
        Study::PlanDrive(options) => plan_drive::study::study(options, json),
        Study::Rehearse(options) => proof::prove(options, json),
    }
}
