//! All runs of a campaign, or of a shard of it, that are not done yet.

use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::str::FromStr;

use indicatif::ProgressBar;
use miette::{IntoDiagnostic, Result, miette};
use rayon::prelude::*;

use super::ledger::{Flown, Ledger, LedgerError, Line, With};
use super::plan::Plan;
use crate::identify::error_model::{Identified, Record};
use crate::log::Grade;
use crate::page::progress::counted;
use crate::sim::ErrorModel;
use crate::study::flights::route::Route;
use crate::study::flights::run::{Settings, run_alone};
use crate::study::recovery::drive_record;

/// A part of a campaign: every `of`th unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Counted from 1.
    pub part: u32,
    /// How many there are.
    pub of: u32,
}

impl Shard {
    /// Everything.
    pub const ALL: Self = Self { part: 1, of: 1 };

    /// Whether a unit belongs to it.
    pub fn has(self, unit: u32) -> bool {
        unit % self.of == self.part - 1
    }

    /// Name of its file.
    pub fn file(self) -> String {
        match self {
            Self::ALL => "runs.jsonl".to_owned(),
            Self { part, of } => format!("runs-{part}-of-{of}.jsonl"),
        }
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/').and_then(|(part, of)| {
            Some(Self {
                part: part.parse().ok()?,
                of: of.parse().ok()?,
            })
        });
        numbers
            .filter(|shard| (1..=shard.of).contains(&shard.part))
            .ok_or_else(|| "K/N, the K-th of N, say 1/4".to_owned())
    }
}

/// Runs all that is missing. Which thread does what leaves no trace in the results.
pub fn run(plan: &Plan, shard: Shard, folder: &Path, progress: &ProgressBar) -> Result<()> {
    let (mut known, mut flown) = (HashMap::new(), HashSet::new());
    let ledger = Ledger::open(&folder.join(shard.file()), |line| match line {
        Line::Model { unit, model } => drop(known.insert(unit, model)),
        Line::Flight {
            unit, with, flight, ..
        } => drop(flown.insert((unit, with, flight))),
    })?;
    let units: Vec<u32> = (0..plan.units).filter(|unit| shard.has(*unit)).collect();
    let flights = units.len() as u64 * 2 * u64::from(plan.flights);

    progress.set_message("identifying");
    progress.set_length(units.len() as u64);
    let models = identify(plan, &units, &known, &ledger, progress)?;
    progress.set_message("flying");
    progress.set_length(flights);
    progress.set_position(flown.len() as u64);
    let route = Route::cessna172()?;
    (0..flights)
        .into_par_iter()
        .try_for_each(|run| -> Result<(), LedgerError> {
            let (at, flight) = (run / u64::from(plan.flights), run % u64::from(plan.flights));
            // Both are below the numbers of the plan, which are 32 bits long.
            #[allow(clippy::cast_possible_truncation)]
            let (at, flight) = (at as usize, flight as u32);
            let (unit, with) = (units[at / 2], [With::True, With::Identified][at % 2]);
            if flown.contains(&(unit, with, flight)) {
                return Ok(());
            }
            let settings = Settings {
                minutes_aided: plan.minutes_aided,
                minutes_free: plan.minutes_free,
                errors: models[at / 2][at % 2].clone(),
            };
            let line = fly(plan, unit, with, flight, &route, &settings);
            progress.inc(1);
            ledger.add(&line)
        })?;
    Ok(())
}

/// True and identified model of each unit.
fn identify(
    plan: &Plan,
    units: &[u32],
    known: &HashMap<u32, String>,
    ledger: &Ledger,
    progress: &ProgressBar,
) -> Result<Vec<[ErrorModel; 2]>> {
    let one = |&unit: &u32| {
        let truth = plan.unit(unit);
        let text = if let Some(text) = known.get(&unit) {
            text.clone()
        } else {
            let model = toml::to_string(&identified(plan, unit, &truth)).into_diagnostic()?;
            ledger.add(&Line::Model {
                unit,
                model: model.clone(),
            })?;
            model
        };
        // Fresh or known, the model goes through its text: the same bits either way.
        let found = ErrorModel::from_toml(&text)
            .map_err(|error| miette!("model of unit {unit}: {error}"))?;
        Ok([truth, found])
    };
    units.par_iter().map(counted(progress, one)).collect()
}

fn identified(plan: &Plan, unit: u32, truth: &ErrorModel) -> ErrorModel {
    let records: Vec<Record> = (0..plan.drives)
        .map(|drive| {
            let seed = plan.drive_seed(unit, drive);
            drive_record(seed, truth, Grade::Hg1700, plan.drive_minutes)
        })
        .collect();
    Identified::new(&records, Grade::Hg1700, None).model()
}

fn fly(
    plan: &Plan,
    unit: u32,
    with: With,
    flight: u32,
    route: &Route,
    settings: &Settings,
) -> Line {
    let (flown, why) = match run_alone(plan.flight_seed(unit, flight), route, settings) {
        Ok((left, errors)) => (Some(Flown::new(&left, &errors)), None),
        Err(error) => (None, Some(error.to_string())),
    };
    Line::Flight {
        unit,
        with,
        flight,
        flown,
        why,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_belongs_to_one_shard() {
        for unit in 0..20 {
            let held = (1..=3).filter(|part| Shard { part: *part, of: 3 }.has(unit));
            assert_eq!(held.count(), 1);
        }
        assert_eq!("2/3".parse(), Ok(Shard { part: 2, of: 3 }));
        for wrong in ["0/3", "4/3", "2", "a/b"] {
            assert!(wrong.parse::<Shard>().is_err());
        }
    }
}
