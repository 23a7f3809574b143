//! Tables of identified error models.

use std::path::Path;

use indicatif::ProgressBar;
use miette::Result;

use super::super::recovery::{both, printed};
use crate::campaign::plan::Plan;
use crate::campaign::run::{Shard, run};
use crate::log::Grade;
use crate::page::table::Table;
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

/// The campaign of the example plan. What an earlier measurement has finished is not run again.
pub(super) fn campaign(root: &Path) -> Result<String> {
    let plan = Plan::read(&root.join("host-sim/campaigns/hg1700.toml"))?;
    let out = root.join("out/campaign");
    super::super::campaign::settle(&plan, &out, false)?;
    run(&plan, Shard::ALL, &out, &ProgressBar::hidden())?;
    Ok(super::super::campaign::summary(&[&out])?.table().markdown())
}
