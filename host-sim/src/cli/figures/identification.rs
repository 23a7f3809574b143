//! Tables of identified error models.

use std::path::{Path, PathBuf};

use indicatif::ProgressBar;
use miette::Result;

use super::super::options::GradeChoice;
use super::super::proof::{self, Proof};
use super::super::recovery::{both, printed};
use super::logs::found;
use crate::campaign::ledger::Shard;
use crate::campaign::plan::Plan;
use crate::campaign::run::run;
use crate::log::Grade;
use crate::page::table::Table;
use crate::rehearse::proof::{overview, verdict};
use crate::study::recovery::{Results, Study, Vehicle};

/// Drives of a unit, and their length.
const DRIVES: u64 = 5;
const MINUTES: f64 = 40.0;

/// How well the parameters of error models are found.
pub(super) fn recovery(units: u64) -> String {
    let study = Study {
        class: Grade::Hg1700,
        vehicle: Vehicle::Car,
        units,
        drives: DRIVES,
        minutes: MINUTES,
        first_seed: 0,
    };
    let tables: Vec<Table> = both(study).iter().map(Results::table).collect();
    printed(&tables, Table::markdown)
}

/// Drives of one unit with many turns, and long ones.
const TURNS: [&str; 3] = [
    "yk_urban_medium_turn_loop_nominal_001",
    "yk_urban_short_turn_loop_nominal_001",
    "yk_urban_stop_go_large_mount_001",
];
const LONG: [&str; 2] = [
    "yk_mixed_road_long_drive_nominal_001",
    "yk_urban_long_turn_loop_nominal_001",
];

/// Recorded drives of one unit that its model is of, and others that it is tried on.
const TRIALS: [(&[&str], &[&str]); 4] = [
    (&TURNS, &LONG),
    (
        &[LONG[0], LONG[1], "yk_parking_lot_circle_turns_nominal_001"],
        &TURNS,
    ),
    (&["quad_joey1"], &["quad_joey1_imu2"]),
    (&["quad_joey1_imu2"], &["quad_joey1"]),
];

/// Drift foretold from recorded drives; `None` without them.
pub(super) fn proof(root: &Path, folder: Option<&Path>) -> Result<Option<String>> {
    let logs = found(root, folder);
    if logs.is_empty() {
        return Ok(None);
    }
    let named = |names: &[&str]| -> Vec<PathBuf> {
        let is_one = |log: &&PathBuf| names.iter().any(|name| log.ends_with(name));
        logs.iter().filter(is_one).cloned().collect()
    };
    let mut rows = Vec::new();
    for (drives, against) in TRIALS {
        rows.extend(proof::rows(&Proof {
            drives: named(drives),
            against: named(against),
            set: None,
            seeds: 20,
            grade: GradeChoice::Auto,
        })?);
    }
    let table = overview(&rows).markdown();
    Ok(Some(format!("{table}\n{}\n", verdict(&rows))))
}

/// The campaign of the example plan. What an earlier measurement has finished is not run again.
pub(super) fn campaign(root: &Path) -> Result<String> {
    let plan = Plan::read(&root.join("host-sim/campaigns/hg1700.toml"))?;
    let out = root.join("out/campaign");
    super::super::campaign::settle(&plan, &out, false)?;
    run(&plan, Shard::ALL, &out, &ProgressBar::hidden())?;
    Ok(super::super::campaign::summary(&[&out])?.table().markdown())
}
