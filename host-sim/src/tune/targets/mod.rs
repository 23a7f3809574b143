//! Each target's names, signs, axes and units: a file of each, with its sources.
//!
//! What is not known is a comment, never a value. So is what would come on top of a value that the
//! recording does not hold.

pub mod ardupilot;
pub mod gnss_ins_sim;
pub mod kalibr;
pub mod kf_gins;
pub mod own;
pub mod px4;
mod setting;

use clap::ValueEnum;

use super::table;
use super::tuning::Tuning;
pub use setting::a_step;

/// Whose parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Target {
    /// A table to read.
    Table,
    /// PX4, for its console.
    Px4,
    /// `ArduPilot`, a parameter file.
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

type Print = fn(&Tuning) -> String;

/// What is printed.
pub fn text(tuning: &Tuning, target: Target) -> serde_json::Result<String> {
    let all: [(Target, Print); 7] = [
        (Target::Table, table::text),
        (Target::Px4, px4::text),
        (Target::Ardupilot, ardupilot::text),
        (Target::Kalibr, kalibr::text),
        (Target::KfGins, kf_gins::text),
        (Target::GnssInsSim, gnss_ins_sim::text),
        (Target::Core, own::text),
    ];
    if target == Target::Json {
        return Ok(serde_json::to_string_pretty(tuning)? + "\n");
    }
    let wanted = all
        .iter()
        .filter(|(this, _)| target == Target::All || target == *this);
    let texts: Vec<String> = wanted.map(|(_, text)| text(tuning)).collect();
    Ok(texts.join("\n"))
}
