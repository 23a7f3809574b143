//! What a campaign does: every run of it, or of a shard of it, that is not done yet.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use indicatif::ProgressBar;
use miette::{IntoDiagnostic, Result, miette};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::ledger::{Ledger, Shard, read_folder};
use super::plan::Plan;
use crate::identify::baro_aided_ins::HorizontalError;
use crate::identify::error_model::{Identified, Record};
use crate::log::Grade;
use crate::page::progress::counted;
use crate::sim::ErrorModel;
use crate::statistics::whole;
use crate::study::flights::route::Route;
use crate::study::flights::run::{Left, Settings, run_alone};
use crate::study::recovery::drive_record;

/// Moments of the free part that are looked at, in quarters of it.
pub(super) const QUARTERS: u32 = 4;

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "run", rename_all = "lowercase")]
pub enum Line {
    Model {
        unit: u32,
        /// The model as TOML: its numbers come back bit for bit.
        model: String,
    },
    Flight {
        unit: u32,
        with: With,
        flight: u32,
        /// What came out; none if it could not be flown.
        flown: Option<Flown>,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        why: Option<String>,
    },
}

/// One flight: whole numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Flown {
    /// Horizontal position error after each quarter of the free part, cm.
    pub position_cm: [u64; QUARTERS as usize],
    /// Horizontal velocity error then, mm/s.
    pub velocity_mmps: [u64; QUARTERS as usize],
    /// Azimuth error when GNSS went, thousandths of a degree, without its sign.
    pub azimuth_mdeg: u64,
}

impl Flown {
    /// Of what was left when GNSS went and the errors at every minute after that.
    pub fn new(left: &Left, minutes: &[HorizontalError]) -> Self {
        let whole = |value: f64| whole(value.abs().round()) as u64;
        let at = |quarter: usize| {
            let minute = ((quarter + 1) * minutes.len()).div_ceil(QUARTERS as usize);
            minutes[minute - 1]
        };
        Self {
            position_cm: core::array::from_fn(|q| whole(1e2 * at(q).position_m)),
            velocity_mmps: core::array::from_fn(|q| whole(1e3 * at(q).velocity_mps)),
            azimuth_mdeg: whole(1e3 * left.azimuth_deg),
        }
    }

    /// All figures, in the order of the summary.
    pub(super) fn figures(&self) -> [u64; 9] {
        let ([a, b, c, d], [e, f, g, h]) = (self.position_cm, self.velocity_mmps);
        [self.azimuth_mdeg, a, b, c, d, e, f, g, h]
    }
}

/// Model of the sensors on a flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum With {
    /// That the drives were made with.
    True,
    /// That was identified from them.
    Identified,
}

pub fn run(plan: &Plan, shard: Shard, folder: &Path, progress: &ProgressBar) -> Result<()> {
    let (mut known, mut flown) = (HashMap::new(), HashSet::new());
    let ledger = Ledger::open(folder, shard)?;
    // Whoever ran it.
    read_folder(folder, |line| match line {
        Line::Model { unit, model } => drop(known.insert(unit, model)),
        Line::Flight {
            unit, with, flight, ..
        } => drop(flown.insert((unit, with, flight))),
    })?;
    let units: Vec<u32> = (0..plan.units).filter(|unit| shard.has(*unit)).collect();
    progress.set_message("identifying");
    progress.set_length(units.len() as u64);
    let models = identify(plan, &units, &known, &ledger, progress)?;

    let all = units
        .iter()
        .zip(&models)
        .flat_map(|(&unit, [truth, found])| {
            let models = [(With::True, truth), (With::Identified, found)];
            let flights =
                move |(with, model)| (0..plan.flights).map(move |n| (unit, with, n, model));
            models.into_iter().flat_map(flights)
        });
    let left = all.filter(|&(unit, with, flight, _)| !flown.contains(&(unit, with, flight)));
    let left: Vec<_> = left.collect();
    let route = Route::cessna172()?;
    progress.set_message("flying");
    progress.set_length(left.len() as u64);
    progress.set_position(0);
    ledger.fill(left, progress, |(unit, with, flight, model)| {
        let settings = Settings {
            minutes_aided: plan.minutes_aided,
            minutes_free: plan.minutes_free,
            errors: model.clone(),
        };
        let (flown, why) = match run_alone(plan.flight_seed(unit, flight), &route, &settings) {
            Ok((left, errors)) => (Some(Flown::new(&left, &errors)), None),
            Err(error) => (None, Some(error.to_string())),
        };
        Ok(Line::Flight {
            unit,
            with,
            flight,
            flown,
            why,
        })
    })
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
    ErrorModel {
        // No drive shows how well a heading is known that is told: the same is told to both.
        given_heading_sigma_deg: truth.given_heading_sigma_deg,
        ..Identified::new(&records, Grade::Hg1700, None).model()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn predicted_flights_are_told_a_heading_as_the_true_ones_are() {
        let text = "units = 2\ndrives = 1\ndrive_minutes = 3\nflights = 1\nminutes_aided = 1\n\
                    minutes_free = 1\n";
        let plan: Plan = toml::from_str(text).unwrap();
        for given_heading_sigma_deg in [Some(0.5), None] {
            let truth = ErrorModel {
                given_heading_sigma_deg,
                ..plan.unit(0)
            };
            let found = identified(&plan, 0, &truth);
            assert_eq!(found.given_heading_sigma_deg, given_heading_sigma_deg);
        }
    }
}
