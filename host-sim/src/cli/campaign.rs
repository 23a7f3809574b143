//! The commands `campaign` and `merge`.

use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic, Result, bail};

use super::options::{Output, Print, print, report_kept};
use crate::campaign::ledger::{self, Shard};
use crate::campaign::plan::Plan;
use crate::campaign::run::run;
use crate::campaign::slurm;
use crate::campaign::summary::{Summary, Tally};
use crate::page;
use crate::page::output::{read, replace};
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

/// Runs what is missing of a campaign and prints the summary.
pub fn campaign(options: &Campaign) -> Result<()> {
    let plan = Plan::read(&options.plan)?;
    let out = &options.output.out;
    let shard = options.shard.unwrap_or(Shard::ALL);
    check_parts(&plan, options.slurm.unwrap_or(shard.of))?;
    prepare_folder(&plan, out, options.output.force)?;
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

/// Mark of a folder: the plan, still readable as one, and the version of this program, on which results may
/// depend.
fn mark(plan: &Plan) -> Result<String> {
    let plan = toml::to_string(plan).into_diagnostic()?;
    Ok(format!("# host-sim {}\n{plan}", env!("CARGO_PKG_VERSION")))
}

/// Creates the folder, or checks that it belongs to the same campaign.
fn prepare_folder(plan: &Plan, out: &Path, force: bool) -> Result<()> {
    let text = mark(plan)?;
    let other = match Plan::read(&out.join(PLAN)) {
        Ok(before) if before == *plan => "this campaign as another version of host-sim ran it",
        _ => "a campaign of another plan",
    };
    let same = |copy: &Path| Ok(read(copy)? == text);
    let kept = ledger::prepare_folder(out, PLAN, &text, force, same, other)?;
    report_kept(out, kept.as_deref());
    Ok(())
}

fn add_up(folders: &[&PathBuf], print: Print) -> Result<()> {
    let summary = summary(folders)?;
    replace(&folders[0].join(SUMMARY), &page::json(&summary)?)?;
    print.result(&summary, || {
        let why = summary.why.iter().map(|why| format!("The first: {why}.\n"));
        format!(
            "{}\n{} units, {} flights of each with each model; {} flights could not be flown.\n{}",
            summary.table().plain(),
            summary.plan.units,
            summary.plan.flights,
            summary.failed,
            why.collect::<String>()
        )
    })?;
    if summary.rows.is_empty() {
        bail!(
            help = "the cause of the first that could not be flown stands above",
            "fewer than two units have flown with both models: nothing to compare"
        );
    }
    Ok(())
}

/// Summary of the runs in some folders of one plan.
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

/// Tally of all runs in some folders of one plan.
fn tally(folders: &[&PathBuf]) -> Result<(Plan, Tally)> {
    let first = folders[0].join(PLAN);
    let (plan, text) = (Plan::read(&first)?, read(&first)?);
    let mut tally = Tally::new(&plan);
    for folder in folders {
        if read(&folder.join(PLAN))? != text {
            bail!(
                help = "what is added up is of one plan and of one version of host-sim",
                "{} belongs to another plan, or another version ran it",
                folder.display()
            );
        }
        ledger::read_folder(folder, |line| tally.add(&line))?;
    }
    Ok((plan, tally))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_of_another_version_are_not_continued() {
        let home = tempfile::tempdir().unwrap();
        let out = home.path().join("out");
        let text = "units = 2\ndrives = 1\ndrive_minutes = 6\nflights = 1\nminutes_aided = 6\n\
                    minutes_free = 1\n";
        let plan: Plan = toml::from_str(text).unwrap();
        prepare_folder(&plan, &out, false).unwrap();
        prepare_folder(&plan, &out, false).unwrap();
        let copy = out.join(PLAN);
        let older = read(&copy)
            .unwrap()
            .replace("# host-sim ", "# host-sim 0.0.");
        std::fs::write(&copy, older).unwrap();
        let refused = prepare_folder(&plan, &out, false).unwrap_err().to_string();
        assert!(
            refused.ends_with("as another version of host-sim ran it"),
            "{refused}"
        );
        prepare_folder(&plan, &out, true).unwrap();
        assert_eq!(Plan::read(&copy).unwrap(), plan);
    }
}
