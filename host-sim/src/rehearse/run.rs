//! All flights of a rehearsal, or of a shard of it, that are not flown yet; and the errors of the solutions,
//! as integers, so that a file keeps them exactly.

use std::collections::HashSet;
use std::path::Path;

use indicatif::ProgressBar;
use ins_core::Solution;
use ins_core::earth::wrap_pi;
use miette::{IntoDiagnostic, Result};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::flight::{Answers, Apriori, Failure, Fault, FlightData, Scenario};
use super::settings::{Case, Rehearsal};
use super::subject::Subject;
use crate::campaign::ledger::{Ledger, Shard, read_folder};
use crate::identify::analysis::unusable;
use crate::sim::errors::GnssModel;
use crate::statistics::whole;

/// `tell` gets the numbers of flights done before, if any, and left.
pub fn run(
    rehearsal: &Rehearsal,
    scenario: &Scenario,
    apriori: &Apriori,
    shard: Shard,
    folder: &Path,
    tell: impl FnOnce(usize, usize),
    progress: &ProgressBar,
) -> Result<()> {
    let ledger = Ledger::open(folder, shard)?;
    // Of any shard. A program that could not be run may exist by now.
    let flown: HashSet<(Case, u32)> = (lines(folder)?.iter())
        .filter(|line| !line.could_not_run())
        .map(|line| (line.case, line.flight))
        .collect();
    let jobs = (0..).zip(rehearsal.jobs());
    let own = jobs.filter(|(number, _)| shard.has(*number));
    let (before, left): (Vec<_>, Vec<_>) =
        (own.map(|(_, job)| job)).partition(|job| flown.contains(job));
    if !before.is_empty() {
        tell(before.len(), left.len());
    }
    let moments = moments(scenario, &rehearsal.settings.model.gnss);
    progress.set_message("flying");
    progress.set_length(left.len() as u64);
    ledger.fill(left, progress, |(case, flight)| {
        let seed = rehearsal.settings.flight_seed(flight);
        let noise = rehearsal.noise.as_ref().filter(|_| case == Case::Recorded);
        let model = rehearsal.model(case).into_diagnostic()?;
        let (outcomes, why) = match scenario.fly(seed, &model, noise) {
            Ok(flown) => {
                let outcome = |subject: &Subject| {
                    let answers = subject.fly(&flown, apriori).map_err(unusable)?;
                    Ok(Outcome::new(answers, &flown, &moments))
                };
                let all: Result<_> = rehearsal.subjects_of(case).iter().map(outcome).collect();
                (all?, None)
            }
            Err(error) => (Vec::new(), Some(error.to_string())),
        };
        Ok(Line {
            case,
            flight,
            outcomes,
            why,
        })
    })
}

/// All flights in the files of a folder, each once, in an order that does not depend on the shards.
pub fn lines(folder: &Path) -> Result<Vec<Line>> {
    let mut all: Vec<Line> = Vec::new();
    read_folder(folder, |line| all.push(line))?;
    // Of duplicates the one that could be run, or the last.
    all.reverse();
    all.sort_by_key(|line| (line.case, line.flight, line.could_not_run()));
    all.dedup_by_key(|line| (line.case, line.flight));
    Ok(all)
}

// --- errors ---

/// Times at which errors are kept, of the part with GNSS, and of the part without.
const MOMENTS: usize = 60;

/// A quantity: name, unit, and resolution of the integers.
#[derive(Clone, Copy, Debug)]
pub struct Quantity {
    pub name: &'static str,
    pub unit: &'static str,
    pub count: f64,
}

const fn quantity(name: &'static str, unit: &'static str, count: f64) -> Quantity {
    Quantity { name, unit, count }
}

/// In the order of [`Errors`].
pub const QUANTITIES: [Quantity; 6] = [
    quantity("level position", "m", 1e-3),
    quantity("height", "m", 1e-3),
    quantity("level velocity", "m/s", 1e-4),
    quantity("vertical velocity", "m/s", 1e-4),
    quantity("roll and pitch", "deg", 1e-5),
    quantity("heading", "deg", 1e-5),
];
pub const POSITION: usize = 0;
pub const HEADING: usize = 5;

/// Absolute errors at one time, in counts.
pub type Errors = [u64; QUANTITIES.len()];

/// Result of one flight with one algorithm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// At each time; none without a solution. Empty if it failed.
    pub errors: Vec<Option<Errors>>,
    /// Why there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<Failure>,
    pub took_ms: u64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    pub case: Case,
    pub flight: u32,
    /// In the order of the algorithms; empty if it could not be flown.
    pub outcomes: Vec<Outcome>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

impl Line {
    fn could_not_run(&self) -> bool {
        let mut failures = self.outcomes.iter().flat_map(|of| &of.failure);
        failures.any(|of| of.fault == Fault::Unusable)
    }
}

/// At most `MOMENTS` of `count` indices, evenly spaced, the last one included.
fn evenly_spaced(count: usize) -> impl Iterator<Item = usize> {
    let kept = count.min(MOMENTS);
    (1..=kept).map(move |moment| (moment * count).div_ceil(kept) - 1)
}

/// Availability of GNSS.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gnss {
    Aided,
    /// An outage of the receiver's model.
    Outage,
    /// Without GNSS to the end of the flight.
    Denied,
}

/// The times that are kept: index in [`FlightData::asks`], and availability of GNSS.
pub fn moments(scenario: &Scenario, receiver: &GnssModel) -> Vec<(usize, Gnss)> {
    let [aided, all] = [scenario.aided_s(), scenario.duration_s].map(whole);
    let aided_ones = evenly_spaced(aided).map(|at| {
        let is_out = receiver.is_out((at + 1) as f64);
        (at, if is_out { Gnss::Outage } else { Gnss::Aided })
    });
    let free_ones = evenly_spaced(all - aided).map(|at| (aided + at, Gnss::Denied));
    aided_ones.chain(free_ones).collect()
}

impl Outcome {
    pub fn new(answers: Answers, flown: &FlightData, moments: &[(usize, Gnss)]) -> Self {
        let took_ms = u64::try_from(answers.took.as_millis()).unwrap_or(u64::MAX);
        let (errors, failure) = match answers.solutions {
            Ok(solutions) => {
                let at = |&(ask, _): &(usize, Gnss)| {
                    let solution = solutions.get(ask)?.as_ref()?;
                    Some(error_counts(solution, flown.asks().get(ask)?))
                };
                (moments.iter().map(at).collect(), None)
            }
            Err(failure) => (Vec::new(), Some(failure)),
        };
        Self {
            errors,
            failure,
            took_ms,
        }
    }
}

fn error_counts(solution: &Solution, truth: &Solution) -> Errors {
    let errors = solution_errors(solution, truth);
    // Saturates at the greatest count.
    let counts = |which: usize| errors[which].abs() / QUANTITIES[which].count;
    core::array::from_fn(|which| whole(counts(which).round()) as u64)
}

/// Errors of a solution, in the order and the units of [`QUANTITIES`].
pub fn solution_errors(solution: &Solution, truth: &Solution) -> [f64; QUANTITIES.len()] {
    let velocity = solution.velocity_enu_mps - truth.velocity_enu_mps;
    // At the first sample after a gap, the solution is still that of the one before.
    let since_s = truth.time.seconds_since(solution.time);
    let moved = since_s * solution.velocity_enu_mps;
    let position = solution.position.enu_from(&truth.position) + moved;
    let up = |of: &Solution| of.attitude.inverse() * Vector3::z();
    let heading_rad = wrap_pi(solution.euler().heading_rad - truth.euler().heading_rad);
    [
        position.xy().norm(),
        position.z,
        velocity.xy().norm(),
        velocity.z,
        (up(solution) - up(truth)).norm().to_degrees(),
        heading_rad.to_degrees(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_moment_is_always_kept() {
        for count in [1, 59, 60, 61, 300, 3601] {
            let kept: Vec<usize> = evenly_spaced(count).collect();
            assert_eq!(kept.len(), count.min(MOMENTS));
            assert_eq!(kept.last(), Some(&(count - 1)));
            assert!(kept.windows(2).all(|pair| pair[0] < pair[1]));
        }
        assert_eq!(evenly_spaced(0).count(), 0);
    }
}
