//! The command `plan-drive`.

use std::path::{Path, PathBuf};

use clap::Args;
use miette::{Result, miette};

use super::identify::error_model_of;
use super::options::{Folder, identified, refuse_same, report_line};
use crate::identify::error_model::Record;
use crate::page::progress::spinner;
use crate::plan_drive::output::{PLAN, Report};
use crate::plan_drive::{Plan, Target};

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.help("Folder for the plan as text, page, drawn route and JSON")))]
pub struct PlanDrive {
    /// What is wanted, of which unit, and what the site allows, TOML.
    #[arg(long)]
    target: PathBuf,
    /// A drive: folder of a log, or a recording of a known format. What it lacks is added to it.
    log: Option<PathBuf>,
    /// Fixes the noise of the simulated drive.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    folder: Folder,
}

/// Plans a drive, or an addition to one.
pub fn plan_drive(options: &PlanDrive) -> Result<()> {
    let folder = &options.folder;
    folder.check(PLAN)?;
    let target = Target::read(&options.target)?;
    let (plan, log) = match &options.log {
        None => (target.plan(options.seed, &spinner("planning"))?, None),
        Some(log) => {
            if let Some(out) = &folder.out {
                refuse_same(log, out)?;
            }
            let (plan, about) = added_to(log, &target, options.seed)?;
            (plan, Some(about))
        }
    };
    let report = Report::new(&plan, &target.site, log);
    let text = || {
        let written = (folder.out.as_ref()).map(|out| format!("\n{}", report_line(out)));
        report.readable() + &written.unwrap_or_default()
    };
    folder.deliver(PLAN, |folder| report.write(folder), &report, text)
}

/// Plan of an addition to a log; name and verdict of the log.
fn added_to(log: &Path, target: &Target, seed: u64) -> Result<(Plan, (String, Vec<String>))> {
    let analysis = identified(log, target.unit.class)?;
    let navigator = target.navigator_after(&analysis)?;
    let records = [Record::new(&analysis.log, &analysis.found)];
    let mut model = error_model_of(&records, analysis.summary.grade, None).model();
    model.imu.output = analysis.log.meta.imu;
    let model = target.with_errors(&model)?;
    let progress = spinner("planning");
    let plan = (target.added_to(&analysis.log, &navigator, &model, seed, &progress))
        .map_err(|error| miette!("{}: {error}", log.display()))?;
    let summary = analysis.summary;
    Ok((plan, (summary.log, summary.verdict.lines())))
}
