//! What the runs of a kind say together, and all kinds.

use serde::Serialize;

use super::quantities::QUANTITIES;
use super::run::{Check, Run, Tried};
use super::{Kind, Quantity};
use crate::sim::Grade;
use crate::statistics::rms_of_any;

/// An error beyond so many of its own sigmas is wrong.
pub const WRONG_SIGMAS: f64 = 4.5;
/// RMS of error over sigma of an honest quantity.
pub const HONEST: [f64; 2] = [0.7, 1.3];

/// A quantity over the runs of a kind, in its unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Which.
    #[serde(flatten)]
    pub quantity: Quantity,
    /// Claims that were checked.
    pub checks: usize,
    /// Root mean square of the errors.
    pub rms_error: f64,
    /// Root mean square of the stated sigmas.
    pub rms_sigma: Option<f64>,
    /// Root mean square of error over sigma.
    pub rms_ratio: Option<f64>,
    /// Part of the errors within one stated sigma.
    pub within_one: f64,
    /// Part within three.
    pub within_three: f64,
    /// Part called observable.
    pub observable: f64,
    /// How often called observable and wrong.
    pub wrong_and_sure: usize,
    /// Root mean square of the Kalman filter's errors.
    pub kalman_rms_error: Option<f64>,
}

impl Row {
    /// `None` where nothing was claimed.
    fn new(quantity: usize, runs: &[&Tried]) -> Option<Self> {
        let of = |run: &Run| -> Vec<Check> {
            let checks = run.checks.iter().copied();
            checks.filter(|check| check.quantity == quantity).collect()
        };
        let checks: Vec<Check> = runs.iter().flat_map(|tried| of(&tried.core)).collect();
        let kalman: Vec<Check> = runs
            .iter()
            .filter_map(|tried| tried.kalman.as_ref())
            .flat_map(of)
            .collect();
        let ratios: Vec<f64> = checks.iter().filter_map(ratio).collect();
        let part = |count: usize, of: usize| count as f64 / of as f64;
        let within = |bound: f64| {
            let inside = ratios.iter().filter(|ratio| ratio.abs() <= bound).count();
            part(inside, ratios.len())
        };
        let errors = |checks: &[Check]| rms_of_any(checks.iter().map(|check| check.error));
        Some(Self {
            quantity: QUANTITIES[quantity],
            checks: checks.len(),
            rms_error: errors(&checks)?,
            rms_sigma: rms_of_any(checks.iter().filter_map(|check| check.sigma)),
            rms_ratio: rms_of_any(ratios.iter().copied()),
            within_one: within(1.0),
            within_three: within(3.0),
            observable: part(checks.iter().filter(|c| c.observable).count(), checks.len()),
            wrong_and_sure: checks.iter().filter(|check| wrong_and_sure(check)).count(),
            kalman_rms_error: errors(&kalman),
        })
    }

    /// Whether error over sigma is about one; what is never called observable may err less: it
    /// stands where it was told to.
    pub fn honest(&self) -> Option<bool> {
        let [least, most] = HONEST;
        let least = if self.observable > 0.0 { least } else { 0.0 };
        self.rms_ratio.map(|ratio| (least..=most).contains(&ratio))
    }

    /// Claims called observable.
    pub fn sure(&self) -> f64 {
        self.observable * self.checks as f64
    }

    /// RMS error over that of the Kalman filter.
    pub fn over_kalman(&self) -> Option<f64> {
        self.kalman_rms_error.map(|kalman| self.rms_error / kalman)
    }
}

fn ratio(check: &Check) -> Option<f64> {
    check.sigma.map(|sigma| check.error / sigma)
}

fn wrong_and_sure(check: &Check) -> bool {
    // A sigma or an error that is no number is not within any bound.
    let right = ratio(check).is_none_or(|ratio| ratio.abs() <= WRONG_SIGMAS);
    check.observable && !right
}

/// A kind with one class of sensors.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Results {
    /// Name of the kind.
    pub kind: &'static str,
    /// What it is.
    pub what: &'static str,
    /// Whether it judges; else it is there to develop on.
    pub judge: bool,
    /// Class of the sensors.
    pub class: Grade,
    /// How many.
    pub runs: usize,
    /// Part of the runs that never had a solution.
    pub never: f64,
    /// Mean part of the second half without a solution.
    pub without_solution: f64,
    /// Median time of the first solution of those that had one, s.
    pub first_solution_s: Option<f64>,
    /// Quantities that were claimed.
    pub rows: Vec<Row>,
}

impl Results {
    /// Sums up, in the order of the runs.
    pub fn new(kind: &Kind, class: Grade, runs: &[&Tried]) -> Self {
        let mut firsts: Vec<f64> = runs
            .iter()
            .filter_map(|tried| tried.core.first_solution_s)
            .collect();
        firsts.sort_by(f64::total_cmp);
        let count = runs.len() as f64;
        Self {
            kind: kind.name,
            what: kind.what,
            judge: kind.judge,
            class,
            runs: runs.len(),
            never: 1.0 - firsts.len() as f64 / count,
            without_solution: runs.iter().map(|t| t.core.without_solution).sum::<f64>() / count,
            first_solution_s: firsts.get(firsts.len() / 2).copied(),
            rows: (0..QUANTITIES.len())
                .filter_map(|quantity| Row::new(quantity, runs))
                .collect(),
        }
    }

    /// The quantity whose error is the most of its sigma.
    pub fn worst(&self) -> Option<&Row> {
        let stated = self.rows.iter().filter(|row| row.rms_ratio.is_some());
        stated.max_by(|a, b| f64::total_cmp(&a.worst_key(), &b.worst_key()))
    }

    /// How often anything was called observable and wrong.
    pub fn wrong_and_sure(&self) -> usize {
        self.rows.iter().map(|row| row.wrong_and_sure).sum()
    }

    /// Quantities that are honest, of those with a sigma.
    pub fn honest(&self) -> (usize, usize) {
        let judged: Vec<bool> = self.rows.iter().filter_map(Row::honest).collect();
        (
            judged.iter().filter(|honest| **honest).count(),
            judged.len(),
        )
    }

    /// The quantity whose error is the most of the Kalman filter's.
    pub fn worst_over_kalman(&self) -> Option<(&Row, f64)> {
        let compared = self
            .rows
            .iter()
            .filter_map(|row| Some((row, row.over_kalman()?)));
        compared.max_by(|a, b| f64::total_cmp(&a.1, &b.1))
    }
}

impl Row {
    fn worst_key(&self) -> f64 {
        self.rms_ratio.unwrap_or_default()
    }
}

/// Many kinds together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Totals {
    /// Which.
    pub name: String,
    /// Kinds, each class apart.
    pub kinds: usize,
    /// Of them those with every quantity honest.
    pub honest_kinds: usize,
    /// Quantities of all kinds.
    pub quantities: usize,
    /// Of them honest ones.
    pub honest_quantities: usize,
    /// Claims called observable.
    pub sure: f64,
    /// Of them wrong ones.
    pub wrong_and_sure: usize,
    /// Mean part of the runs that never had a solution.
    pub never: f64,
    /// Mean part of the second half without a solution.
    pub without_solution: f64,
    /// Geometric mean over kinds and quantities of RMS error over the Kalman filter's.
    pub over_kalman: Option<f64>,
}

impl Totals {
    /// `None` of nothing.
    pub fn new(name: &str, results: &[&Results]) -> Option<Self> {
        let count = results.len() as f64;
        let honest: Vec<(usize, usize)> = results.iter().map(|r| r.honest()).collect();
        let rows = || results.iter().flat_map(|results| &results.rows);
        let logs: Vec<f64> = rows().filter_map(Row::over_kalman).map(f64::ln).collect();
        let mean = |part: fn(&Results) -> f64| results.iter().map(|r| part(r)).sum::<f64>() / count;
        (!results.is_empty()).then(|| Self {
            name: name.to_owned(),
            kinds: results.len(),
            honest_kinds: honest
                .iter()
                .filter(|(good, all)| *all > 0 && good == all)
                .count(),
            quantities: honest.iter().map(|(_, all)| all).sum(),
            honest_quantities: honest.iter().map(|(good, _)| good).sum(),
            sure: rows()
                .filter(|row| row.rms_sigma.is_some())
                .map(Row::sure)
                .sum(),
            wrong_and_sure: results.iter().map(|r| r.wrong_and_sure()).sum(),
            never: mean(|r| r.never),
            without_solution: mean(|r| r.without_solution),
            over_kalman: (!logs.is_empty())
                .then(|| (logs.iter().sum::<f64>() / logs.len() as f64).exp()),
        })
    }
}
