//! Output of commands.

use std::fs;
use std::path::Path;

use clap::Parser;
use host_sim::identify::analysis::Analysis;
use host_sim::{Cli, campaign_summary, picture_of_estimates, run};
use indicatif::ProgressBar;
use ins_tests::pages;
use miette::{IntoDiagnostic, Result};

/// `host-sim` with these arguments.
fn host_sim(arguments: &[&str]) -> Result<()> {
    let all = ["host-sim"].iter().chain(arguments);
    run(&Cli::try_parse_from(all).into_diagnostic()?)
}

/// The drive of `demo`: its estimates and its picture.
pub fn demo(root: &Path) -> Result<String> {
    let folder = tempfile::tempdir().into_diagnostic()?;
    let log = folder.path().join("log");
    host_sim(&["drive", "--out", &log.to_string_lossy()])?;
    let analysis = Analysis::of_log(&log, None, &ProgressBar::hidden())?;
    pages::picture(root, "demo.svg", &picture_of_estimates(&analysis))?;
    Ok(analysis.table().markdown())
}

/// Accuracy of identified error models.
pub fn recovery(units: u64) -> Result<String> {
    let folder = tempfile::tempdir().into_diagnostic()?;
    let out = folder.path().join("recovery");
    let (units, to) = (units.to_string(), out.to_string_lossy());
    host_sim(&["study", "recovery", "--units", &units, "--out", &to])?;
    fs::read_to_string(out.join("recovery.md")).into_diagnostic()
}

/// The campaign of the example plan; resumed, or started anew.
pub fn campaign(root: &Path, resume: bool) -> Result<String> {
    let plan = root.join("host-sim/campaigns/hg1700.toml");
    let out = root.join("out/campaign");
    let (plan, to) = (plan.to_string_lossy(), out.to_string_lossy());
    let force = (!resume).then_some("--force");
    let arguments = ["campaign", &plan, "--out", &to].into_iter().chain(force);
    host_sim(&arguments.collect::<Vec<_>>())?;
    Ok(campaign_summary(&[&out])?.table().markdown())
}
