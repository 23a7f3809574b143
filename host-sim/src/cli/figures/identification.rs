//! Tables of identified error models.

use std::path::Path;

use indicatif::ProgressBar;
use miette::Result;

use super::super::recovery::both;
use crate::campaign::plan::Plan;
use crate::campaign::run::{Shard, run};
use crate::study::recovery::Study;

/// Drives of a unit, and their length.
const DRIVES: u64 = 5;
const MINUTES: f64 = 40.0;

/// How well the parameters of error models are found.
pub(super) fn recovery(units: u64) -> String {
    let study = Study {
        units,
        drives: DRIVES,
        minutes: MINUTES,
        first_seed: 0,
    };
    let tables = both(study).map(|results| {
        let table = results.table().markdown();
        format!("Gyro biases of equation {}:\n\n{table}", results.gyro_model)
    });
    tables.join("\n")
}

/// The campaign of the example plan. What an earlier measurement has finished is not run again.
pub(super) fn campaign(root: &Path) -> Result<String> {
    let plan = Plan::read(&root.join("host-sim/campaigns/hg1700.toml"))?;
    let out = root.join("out/campaign");
    super::super::campaign::settle(&plan, &out, false)?;
    run(&plan, Shard::ALL, &out, &ProgressBar::hidden())?;
    Ok(super::super::campaign::summary(&[&out])?.table().markdown())
}
