//! Each target's names, signs, axes and units; `docs/tune.md` has the source of each.
//!
//! Unknown values are comments, never values. So are increments to a value that the recording does not
//! contain.

mod autopilots;
mod models;
mod setting;
mod table;

use clap::ValueEnum;

use super::tuning::Tuning;

/// Format of the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Target {
    /// A table to read.
    Table,
    /// PX4, for its console.
    Px4,
    /// ArduPilot, a parameter file.
    Ardupilot,
    /// Kalibr's imu.yaml.
    Kalibr,
    /// KF-GINS's yaml.
    KfGins,
    /// gnss-ins-sim's accuracy dictionary.
    GnssInsSim,
    /// This core's configuration and parameters, Rust.
    Core,
    /// Everything, for programs.
    Json,
    /// The table and all formats but JSON.
    All,
}

pub fn text(t: &Tuning, target: Target) -> serde_json::Result<String> {
    Ok(match target {
        Target::Table => table::text(t),
        Target::Px4 => autopilots::px4(t),
        Target::Ardupilot => autopilots::ardupilot(t),
        Target::Kalibr => models::kalibr(t),
        Target::KfGins => models::kf_gins(t),
        Target::GnssInsSim => models::gnss_ins_sim(t),
        Target::Core => models::core(t),
        Target::Json => serde_json::to_string_pretty(t)? + "\n",
        Target::All => {
            let all = Target::value_variants().iter();
            let printed = all.filter(|this| !matches!(this, Target::Json | Target::All));
            let texts: Result<Vec<String>, _> = printed.map(|this| text(t, *this)).collect();
            texts?.join("\n")
        }
    })
}
