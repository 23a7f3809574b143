//! The command group `study`.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use miette::{Result, bail, miette};
use rayon::prelude::*;
use serde::Serialize;

use super::identify::error_model_of;
use super::options::{Class, Folder, Print, identified, print, print_warnings};
use super::rehearse::{in_keys, keys};
use crate::identify::analysis::folder_name;
use crate::identify::configure;
use crate::log::{self, Grade};
use crate::page::output::{check_free_file, replace};
use crate::page::progress::{bar, counted};
use crate::rehearse::proof;
use crate::rehearse::settings::{DriveVerdict, Drives};

use crate::study::options::MOST_SEED;
use crate::study::recordings::{Outcome, Recording};
use crate::study::{accuracy, conditions, flights, logs, plan_drive, recordings, recovery};

/// The studies.
#[derive(Debug, Subcommand)]
pub enum Study {
    /// Run many simulated drives and say how good the estimates are.
    Accuracy(Accuracy),
    /// Try simulated vehicles, mounts and receivers of many kinds over seeds: how honest the core is.
    Conditions(Conditions),
    /// Fly many flights, damped and then free, and report what the estimates are worth.
    Flights(Box<Flights>),
    /// Identify many simulated units and say how well their error models are found.
    Recovery(Recovery),
    /// Say what recorded logs can tell of the core: halves, methods, outages, free INS.
    Logs(Logs),
    /// Try recordings of any format: what is found in each, what is warned of, and the time it takes.
    Recordings(Recordings),
    /// Compare the sigmas that `plan-drive` predicts with the errors of simulated drives.
    PlanDrive {
        #[command(flatten)]
        options: plan_drive::Options,
        #[command(flatten)]
        print: Print,
    },
    /// Predict the drift of recorded drives without GNSS by a model of other drives, and compare.
    Rehearse(Rehearse),
}

impl Study {
    /// Runs it.
    pub fn run(&self) -> Result<()> {
        match self {
            Self::Accuracy(options) => options.run(),
            Self::Conditions(options) => options.run(),
            Self::Flights(options) => options.run(),
            Self::Recovery(options) => options.run(),
            Self::Logs(options) => options.run(),
            Self::Recordings(options) => options.run(),
            Self::PlanDrive { options, print } => {
                let all = plan_drive::compared(options)?;
                print.result(&all, || plan_drive::readable(&all))
            }
            Self::Rehearse(options) => options.run(),
        }
    }
}

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.help("Folder for accuracy.json, accuracy.csv and accuracy.svg")))]
pub struct Accuracy {
    #[command(flatten)]
    study: accuracy::Study,
    #[command(flatten)]
    folder: Folder,
}

impl Accuracy {
    fn run(&self) -> Result<()> {
        self.folder.check(accuracy::JSON)?;
        let progress = bar().with_message("driving");
        let results = (self.study.results(&progress))
            .map_err(|error| miette!("these options cannot be used: {}", error))?;
        let write = |folder: &Path| accuracy::write(&results, folder);
        let text = || accuracy::readable(&results);
        self.folder.deliver(accuracy::JSON, write, &results, text)
    }
}

#[derive(Debug, Args)]
#[allow(clippy::struct_excessive_bools)]
pub struct Conditions {
    /// Runs of each kind.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    seeds: u64,
    /// Seed of the first run; the others follow.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=MOST_SEED))]
    first_seed: u64,
    /// Kinds by name; all unless given.
    #[arg(long, value_delimiter = ',')]
    kinds: Vec<String>,
    /// The kinds that judge, and no other.
    #[arg(long)]
    judges: bool,
    /// The kinds to develop on, and no other.
    #[arg(long, conflicts_with = "judges")]
    development: bool,
    /// Sensors of one class alone.
    #[arg(long, value_enum)]
    class: Option<Grade>,
    #[command(flatten)]
    trial: conditions::Trial,
    /// The overview and the totals alone.
    #[arg(long)]
    brief: bool,
    /// File for a line of each kind and quantity, as CSV.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Print the kinds there are, and run none.
    #[arg(long)]
    list: bool,
    #[command(flatten)]
    print: Print,
    /// Replace what an earlier run wrote.
    #[arg(long, requires = "csv")]
    force: bool,
}

impl Conditions {
    fn run(&self) -> Result<()> {
        /// What is printed as JSON.
        #[derive(Serialize)]
        struct Page {
            seeds: u64,
            first_seed: u64,
            totals: Vec<conditions::Totals>,
            kinds: Vec<conditions::Results>,
        }
        let kinds = self.chosen()?;
        if self.list {
            let line = |kind: &conditions::Kind| {
                let side = if kind.judge { "judge  " } else { "develop" };
                format!("{:<26} {side}  {}\n", kind.name, kind.what)
            };
            return print(&kinds.into_iter().map(line).collect::<String>());
        }
        if let Some(file) = &self.csv {
            check_free_file(file, conditions::output::HEADER, self.force)?;
        }
        let study = conditions::Study {
            kinds,
            only: self.class,
            first_seed: self.first_seed,
            seeds: self.seeds,
            trial: self.trial,
        };
        let results = study.results(&bar().with_message("running"));
        let table = conditions::output::csv(&results)?;
        let page = Page {
            seeds: study.seeds,
            first_seed: study.first_seed,
            totals: conditions::output::totals(&results),
            kinds: results,
        };
        self.print.result(&page, || {
            conditions::output::readable(&page.kinds, !self.brief)
        })?;
        // Last, so that hours of work are printed even if the disk is full.
        if let Some(file) = &self.csv {
            replace(file, &table)?;
        }
        Ok(())
    }

    fn chosen(&self) -> Result<Vec<&'static conditions::Kind>> {
        let has_class = |kind: &conditions::Kind| {
            (self.class).is_none_or(|class| kind.classes.contains(&class))
        };
        for name in &self.kinds {
            let Some(kind) = conditions::all().find(|kind| kind.name == *name) else {
                bail!(
                    help = "`study conditions --list` prints all",
                    "no kind of conditions is called {name}"
                );
            };
            if let Some(class) = self.class.filter(|_| !has_class(kind)) {
                let class = class.name();
                bail!(
                    help = format!("`study conditions --list --class {class}` prints what is"),
                    "{name} is not tried with sensors of the class {class}"
                );
            }
        }
        let wanted = |kind: &&conditions::Kind| {
            let named = self.kinds.is_empty() || self.kinds.iter().any(|name| name == kind.name);
            let of_side = !(self.judges && !kind.judge || self.development && kind.judge);
            named && of_side && has_class(kind)
        };
        let chosen: Vec<&conditions::Kind> = conditions::all().filter(wanted).collect();
        if chosen.is_empty() {
            bail!(
                help = "`study conditions --list` prints all, and on which side they are",
                "no kind of {} {}",
                self.kinds.join(", "),
                side(self.judges)
            );
        }
        Ok(chosen)
    }
}

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.help("Folder for tables and pictures")))]
pub struct Flights {
    /// Number of flights.
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    runs: u32,
    #[command(flatten)]
    settings: flights::Settings,
    /// Seed of the first flight; the others follow.
    #[arg(long, default_value_t = 0,
          value_parser = clap::value_parser!(u64).range(..=MOST_SEED))]
    first_seed: u64,
    #[command(flatten)]
    folder: Folder,
}

impl Flights {
    fn run(&self) -> Result<()> {
        self.folder.check(flights::SUMMARY)?;
        let seeds = self.first_seed..self.first_seed + u64::from(self.runs);
        let progress = bar().with_message("flights");
        let (runs, summary) = flights::measure(seeds, &self.settings, &progress)?;
        let write = |folder: &Path| flights::write(folder, &runs, &summary);
        let text = || flights::readable(&summary);
        self.folder.deliver(flights::SUMMARY, write, &summary, text)
    }
}

#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.help("Folder for recovery.json and, in Markdown, recovery.md")))]
pub struct Recovery {
    #[command(flatten)]
    study: recovery::Study,
    /// Both classes of sensors, in a car and in an aircraft: only how often intervals hold the truth.
    #[arg(long)]
    closure: bool,
    #[command(flatten)]
    folder: Folder,
}

impl Recovery {
    fn run(&self) -> Result<()> {
        self.folder.check(recovery::JSON)?;
        let results = if self.closure {
            self.study.of_all_kinds()
        } else {
            self.study.of_both_laws()
        };
        let tables = recovery::tables(&results, self.closure);
        let write = |folder: &Path| recovery::write(&results, &tables, folder);
        let text = || recovery::readable(&tables);
        self.folder.deliver(recovery::JSON, write, &results, text)
    }
}

/// Distinct paths; repeated ones are reported.
fn distinct(paths: &[PathBuf]) -> Vec<&PathBuf> {
    let mut known = HashSet::new();
    let first = |path: &&PathBuf| {
        let new = known.insert(path.canonicalize().unwrap_or_else(|_| (*path).clone()));
        if !new {
            eprintln!("{}: named twice, counted once", path.display());
        }
        new
    };
    paths.iter().filter(first).collect()
}

/// Use of the kinds or logs of a side, as text.
fn side(judges: bool) -> &'static str {
    if judges { "judges" } else { "is developed on" }
}

#[derive(Debug, Args)]
pub struct Logs {
    /// Folders of recorded logs.
    #[arg(required = true)]
    #[allow(clippy::struct_field_names)] // Named on the command line.
    logs: Vec<PathBuf>,
    /// Only the logs that nothing was developed on: all but the development logs.
    #[arg(long, conflicts_with = "development")]
    judges: bool,
    /// Only the development logs.
    #[arg(long)]
    development: bool,
    #[command(flatten)]
    class: Class,
    #[command(flatten)]
    print: Print,
}

impl Logs {
    /// Studies every log; one that cannot be used is reported, and the others are continued.
    fn run(&self) -> Result<()> {
        let wanted = |folder: &&PathBuf| match logs::Role::of(&folder_name(folder)) {
            logs::Role::Development => !self.judges,
            logs::Role::Judge => !self.development,
        };
        let folders: Vec<&PathBuf> = distinct(&self.logs).into_iter().filter(wanted).collect();
        if folders.is_empty() {
            bail!("no log of those given {}", side(self.judges));
        }
        let progress = bar().with_message("studying");
        progress.set_length(folders.len() as u64);
        let one = |folder: &&PathBuf| {
            let name = folder_name(folder);
            let (log, warnings) = log::read(folder)?;
            progress.suspend(|| print_warnings(&warnings));
            progress.set_message(name.clone());
            let grade = configure::grade(&log, self.class.grade);
            logs::LogStudy::of_log(name, &log, grade)
                .map_err(|error| miette!("cannot be used: {}", error))
        };
        // Each to the next free thread; results are in the order of the folders.
        let studies: Vec<Result<logs::LogStudy>> = (folders.par_iter())
            .with_max_len(1)
            .map(counted(&progress, one))
            .collect();
        progress.finish_and_clear();
        let (mut used, all) = (Vec::new(), folders.len());
        for study in studies {
            match study {
                Ok(study) => used.push(study),
                Err(error) => eprintln!("{error:?}"),
            }
        }
        if used.is_empty() {
            bail!("{all} of {all} logs cannot be used");
        }
        let failed = all - used.len();
        let study = logs::Study::new(used);
        self.print.result(&study, || logs::page::plain(&study))?;
        match failed {
            0 => Ok(()),
            _ => bail!("{failed} of {all} logs cannot be used"),
        }
    }
}

#[derive(Debug, Args)]
pub struct Recordings {
    /// Recordings of any known format, and folders of logs; each is opened on its own.
    #[arg(required = true)]
    paths: Vec<PathBuf>,
    #[command(flatten)]
    class: Class,
    #[command(flatten)]
    print: Print,
}

impl Recordings {
    /// Processes every recording, one after another, for correct times.
    fn run(&self) -> Result<()> {
        let progress = bar().with_message("trying");
        let paths = distinct(&self.paths);
        progress.set_length(paths.len() as u64);
        let one = |path: &PathBuf| recordings::recordings(path, self.class.grade);
        let rows: Vec<Recording> = (paths.into_iter())
            .flat_map(counted(&progress, one))
            .collect();
        progress.finish_and_clear();
        self.print
            .result(&rows, || recordings::table(&rows).plain())?;
        let refused = |row: &Recording| matches!(row.outcome, Outcome::Refused(_));
        if rows.iter().all(refused) {
            let all = rows.len();
            bail!("{all} of {all} recordings cannot be used");
        }
        Ok(())
    }
}

#[derive(Debug, Args)]
pub struct Rehearse {
    /// Drives that the model is of.
    #[arg(required = true)]
    drives: Vec<PathBuf>,
    /// Drives of the same unit on which it is tried.
    #[arg(long, required = true, num_args = 1..)]
    against: Vec<PathBuf>,
    /// TOML with any keys of an error model that stand in place of what was identified or assumed.
    #[arg(long, value_name = "FILE")]
    set: Option<PathBuf>,
    /// Simulations of each of them.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(2..=1000))]
    seeds: u64,
    #[command(flatten)]
    class: Class,
    #[command(flatten)]
    print: Print,
}

impl Rehearse {
    fn run(&self) -> Result<()> {
        /// What is printed as JSON.
        #[derive(Serialize)]
        struct Proof {
            /// Of all drives: first those of the model.
            verdicts: Vec<DriveVerdict>,
            rows: Vec<proof::Row>,
        }
        let grade = self.class.grade;
        let drives = Drives::of(&self.drives, |drive| identified(drive, grade))?;
        let mut model = error_model_of(&drives.records, drives.grade, None).model();
        model.imu.output = drives.output;
        let set = self.set.as_deref();
        let model = (model.with(&keys(set)?)).map_err(|error| in_keys(set, &error))?;
        let mut proof = Proof {
            verdicts: drives.verdicts,
            rows: Vec::new(),
        };
        for path in &self.against {
            let analysis = identified(path, Some(drives.grade))?;
            let rows = proof::compare_drift(&analysis, &model, self.seeds)?;
            if rows.is_empty() {
                eprintln!(
                    "{}: nothing to compare: it never navigates, or no outage fits, on it or on its \
                     simulations",
                    analysis.summary.log
                );
            }
            proof.rows.extend(rows);
            proof.verdicts.push(DriveVerdict::of(analysis.summary));
        }
        self.print.result(&proof, || {
            let verdicts = proof.verdicts.iter().flat_map(DriveVerdict::lines);
            let verdicts = verdicts.collect::<Vec<_>>().join("\n");
            format!("{verdicts}\n\n{}", proof::readable(&proof.rows))
        })
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        conditions: Conditions,
    }

    fn chosen(arguments: &str) -> Result<Vec<&'static conditions::Kind>> {
        let all = ["conditions"]
            .into_iter()
            .chain(arguments.split_whitespace());
        Line::try_parse_from(all).unwrap().conditions.chosen()
    }

    #[test]
    fn kinds_are_of_the_class_that_is_asked_for() {
        let ring_lasers = chosen("--class hg1700").unwrap();
        assert!(ring_lasers.len() < chosen("").unwrap().len());
        let names = |kinds: &[&conditions::Kind]| kinds.iter().any(|k| k.name == "quadrotor");
        assert!(!names(&ring_lasers) && names(&chosen("--class mems").unwrap()));
        let refused = chosen("--kinds plain,quadrotor --class hg1700").unwrap_err();
        let expected = "quadrotor is not tried with sensors of the class hg1700";
        assert_eq!(refused.to_string(), expected);
    }
}
