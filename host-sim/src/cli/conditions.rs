//! The command `study conditions`.

use std::path::PathBuf;

use clap::Args;
use miette::{Result, bail};
use serde::Serialize;

use super::options::show;
use crate::log::Grade;
use crate::page::output;
use crate::page::progress::bar;
use crate::study::conditions::output::{csv, readable, totals};
use crate::study::conditions::{Kind, Results, Study, Totals, Trial, all};

/// Options of `study conditions`.
#[derive(Debug, Args)]
#[allow(clippy::struct_excessive_bools)]
pub struct Conditions {
    /// Runs of each kind.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    seeds: u64,
    /// Seed of the first run; the others follow.
    #[arg(long, default_value_t = 0)]
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
    trial: Trial,
    /// The overview and the totals alone.
    #[arg(long)]
    brief: bool,
    /// File for a line of each kind and quantity, as CSV.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Print the kinds there are, and run none.
    #[arg(long)]
    list: bool,
}

/// What is printed as JSON.
#[derive(Debug, Serialize)]
struct Page {
    seeds: u64,
    first_seed: u64,
    totals: Vec<Totals>,
    kinds: Vec<Results>,
}

/// Runs kinds of conditions and says how honest the core was.
pub fn conditions(options: &Conditions, json: bool) -> Result<()> {
    let kinds = options.chosen()?;
    if options.list {
        for kind in kinds {
            let side = if kind.judge { "judge  " } else { "develop" };
            println!("{:<26} {side}  {}", kind.name, kind.what);
        }
        return Ok(());
    }
    let study = Study {
        kinds,
        only: options.class.map(Into::into),
        first_seed: options.first_seed,
        seeds: options.seeds,
        trial: options.trial,
    };
    let results = study.results(&bar().with_message("running"));
    if let Some(file) = &options.csv {
        output::replace(file, &csv(&results)?)?;
    }
    let page = Page {
        seeds: study.seeds,
        first_seed: study.first_seed,
        totals: totals(&results),
        kinds: results,
    };
    show(json, &page, || readable(&page.kinds, !options.brief))
}

impl Conditions {
    fn chosen(&self) -> Result<Vec<&'static Kind>> {
        for name in &self.kinds {
            if !all().any(|kind| kind.name == *name) {
                bail!(
                    help = "`study conditions --list` prints all",
                    "no kind of conditions is called {name}"
                );
            }
        }
        let named =
            |kind: &&Kind| self.kinds.is_empty() || self.kinds.iter().any(|name| name == kind.name);
        let used = |kind: &&Kind| !(self.judges && !kind.judge || self.development && kind.judge);
        Ok(all().filter(named).filter(used).collect())
    }
}
