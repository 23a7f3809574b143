//! The commands `campaign` and `merge`.

use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, Result, bail};

use super::options::{Output, Print, print};
use crate::campaign::ledger::{self, Shard};
use crate::campaign::plan::Plan;
use crate::campaign::run::run;
use crate::campaign::slurm;
use crate::campaign::summary::{Summary, Tally};
use crate::page;
use crate::page::output::replace;
use crate::page::progress::bar;

/// Copy of the plan; marks a folder as that of a campaign.
const PLAN: &str = "plan.toml";
const SUMMARY: &str = "campaign.json";

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.help("Folder of the results. A campaign that was stopped goes on there")))]
pub struct Campaign {
    /// What to do; host-sim/campaigns/hg1700.toml is an example.
    plan: PathBuf,
    /// Only the K-th of N parts; `merge` adds them up.
    #[arg(long, value_name = "K/N")]
    shard: Option<Shard>,
    /// Run nothing: write a job array of so many shards for Slurm into the folder.
    #[arg(long, value_name = "JOBS", conflicts_with = "shard",
          value_parser = clap::value_parser!(u32).range(1..=10_000))]
    slurm: Option<u32>,
    #[command(flatten)]
    output: Output,
}

#[derive(Debug, Args)]
pub struct Merge {
    /// Folder of a campaign whose shards are done. Further folders: shards that ran elsewhere.
    #[arg(required = true)]
    folders: Vec<PathBuf>,
    #[command(flatten)]
    print: Print,
}

/// Runs what is missing of a campaign and says what it shows.
pub fn campaign(options: &Campaign) -> Result<()> {
    let plan = Plan::read(&options.plan)?;
    let out = &options.output.out;
    let shard = options.shard.unwrap_or(Shard::ALL);
    check_parts(&plan, options.slurm.unwrap_or(shard.of))?;
    settle(&plan, out, options.output.force)?;
    if let Some(jobs) = options.slurm {
        let sum = ["merge".to_owned(), out.display().to_string()];
        let script = slurm::write("campaign", out, jobs, Some(&sum))?;
        return print(&format!("{}\n", script.display()));
    }
    run(&plan, shard, out, &bar())?;
    if shard == Shard::ALL {
        add_up(&[out], options.output.print)
    } else {
        print(&format!("{} is done\n", out.join(shard.file()).display()))
    }
}

pub fn merge(options: &Merge) -> Result<()> {
    let folders: Vec<&PathBuf> = options.folders.iter().collect();
    add_up(&folders, options.print)
}

fn check_parts(plan: &Plan, parts: u32) -> Result<()> {
    if parts > plan.units {
        bail!(
            help = "a unit is not divided",
            "{parts} parts of a campaign with {} units",
            plan.units
        );
    }
    Ok(())
}

/// Makes the folder with a copy of the plan, or finds that it belongs to this very plan.
fn settle(plan: &Plan, out: &Path, force: bool) -> Result<()> {
    let text = toml::to_string(plan).into_diagnostic()?;
    let same = |copy: &Path| Ok(Plan::read(copy)? == *plan);
    ledger::settle(out, PLAN, &text, force, same, "a campaign of another plan")
}

fn add_up(folders: &[&PathBuf], print: Print) -> Result<()> {
    let summary = summary(folders)?;
    replace(&folders[0].join(SUMMARY), &page::json(&summary)?)?;
    print.result(&summary, || {
        format!(
            "{}\n{} units, {} flights of each with each model; {} flights could not be flown.\n",
            summary.table().plain(),
            summary.plan.units,
            summary.plan.flights,
            summary.failed
        )
    })
}

/// What the runs in some folders of one plan say.
pub fn summary(folders: &[&PathBuf]) -> Result<Summary> {
    let (plan, tally) = tally(folders)?;
    let missing = tally.missing(&plan);
    if missing > 0 {
        bail!(
            help = "run the same command again, or the shards that were stopped",
            "{missing} flights are missing"
        );
    }
    Ok(Summary::new(&plan, &tally))
}

/// Sums over all files of runs in some folders of one plan.
fn tally(folders: &[&PathBuf]) -> Result<(Plan, Tally)> {
    let plan = Plan::read(&folders[0].join(PLAN))?;
    let mut tally = Tally::new(&plan);
    for folder in folders {
        if Plan::read(&folder.join(PLAN))? != plan {
            bail!("{} belongs to another plan", folder.display());
        }
        ledger::read_folder(folder, |line| tally.add(&line))?;
    }
    if tally.has_repeats(&plan) {
        bail!(
            help = "a folder was given twice, or shards of different numbers lie side by side",
            "there are more runs than the plan has"
        );
    }
    Ok((plan, tally))
}
