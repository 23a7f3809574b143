//! All runs of a campaign, or of a shard of it, that are not done yet.

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
use crate::study::flights::run::{ResidualErrors, Settings, run_alone};
use crate::study::recovery::drive_record;

/// Times of the free part at which errors are evaluated, in quarters of it.
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
        with: FlightModel,
        flight: u32,
        /// Errors; none if it could not be flown.
        flown: Option<FlightErrors>,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        why: Option<String>,
    },
}

/// Errors of one flight, as integers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FlightErrors {
    /// Horizontal position error after each quarter of the free part, cm.
    pub position_cm: [u64; QUARTERS as usize],
    /// Horizontal velocity error then, mm/s.
    pub velocity_mmps: [u64; QUARTERS as usize],
    /// Azimuth error at the end of GNSS, thousandths of a degree, absolute.
    pub azimuth_mdeg: u64,
}

impl FlightErrors {
    /// From the errors left at the end of GNSS, and those at every minute after it.
    pub fn new(left: &ResidualErrors, minutes: &[HorizontalError]) -> Self {
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

/// Which error model of the sensors a flight has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FlightModel {
    /// That the drives were made with.
    True,
    /// That was identified from them.
    Identified,
}

pub fn run(plan: &Plan, shard: Shard, folder: &Path, progress: &ProgressBar) -> Result<()> {
    let (mut known, mut flown) = (HashMap::new(), HashSet::new());
    let ledger = Ledger::open(folder, shard)?;
    // Of all shards.
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
            let models = [(FlightModel::True, truth), (FlightModel::Identified, found)];
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
            Ok((left, errors)) => (Some(FlightErrors::new(&left, &errors)), None),
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
        // A new model is read back from its text as well: the same bits either way.
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
        // The sigma of a given heading is not observable in drives: it is the same for both.
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
