//! Statistics over the runs.

use indicatif::ProgressBar;
use ins_core::ConfigError;
use serde::Serialize;

use super::{Check, EVERY_S, QUANTITIES, Quantity, Run, Study};
use crate::statistics::rms;

/// Fraction of normally distributed errors within one sigma.
const WITHIN_SIGMA: f64 = 0.6827;

/// All runs of a study, and their statistics.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Results {
    #[serde(flatten)]
    pub study: Study,
    /// Runs that end with a correct azimuth.
    pub converged: usize,
    pub quantities: Vec<Row>,
    /// The same over time.
    pub history: Vec<RmsPoint>,
    /// The runs themselves, by seed.
    #[serde(skip)]
    pub runs: Vec<Run>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Row {
    #[serde(flatten)]
    pub quantity: Quantity,
    pub rms_error: f64,
    pub rms_sigma: f64,
    pub within_sigma_percent: f64,
    /// Time after which the RMS error over the runs stays below twice its final value, s.
    pub settled_s: f64,
}

/// All quantities at one time, in the order of [`QUANTITIES`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RmsPoint {
    /// Since the first sample, s.
    pub time_s: f64,
    /// Runs that navigate; only these are in the RMS.
    pub navigating: usize,
    pub rms_error: [f64; 8],
    pub rms_sigma: [f64; 8],
}

impl Study {
    pub fn results(mut self, progress: &ProgressBar) -> Result<Results, ConfigError> {
        self.form = self.form.filter(|_| self.kalman_noise.is_none());
        let runs = self.drive(&|_| {}, &|_| {}, progress)?;
        Ok(Results::new(self, runs))
    }
}

impl Results {
    /// Of runs of equal length.
    pub fn new(study: Study, runs: Vec<Run>) -> Self {
        let checks = runs.iter().map(|run| run.history.len()).min().unwrap_or(0);
        let history: Vec<RmsPoint> = (0..checks)
            .filter_map(|check| rms_point(&runs, check))
            .collect();
        let mut results = Self {
            study,
            converged: runs.iter().filter(|run| run.converged).count(),
            quantities: Vec::new(),
            history,
            runs,
        };
        let rows = (0..QUANTITIES.len()).filter_map(|which| results.row(which));
        results.quantities = rows.collect();
        results
    }

    /// `None` if no run navigates at the end.
    fn row(&self, which: usize) -> Option<Row> {
        let end = self.history.last()?;
        let rms_error = end.rms_error[which];
        let ends = self
            .runs
            .iter()
            .filter_map(|run| run.history.last()?.as_ref());
        let within = ends.filter(|checks| checks[which].error.abs() < checks[which].sigma);
        let settled_s = self.settled_s(which, 2.0 * rms_error);
        let mut quantity = QUANTITIES[which];
        if !self.study.has_limits() {
            (quantity.limit, quantity.goal) = (None, None);
        }
        Some(Row {
            quantity,
            rms_error,
            rms_sigma: end.rms_sigma[which],
            within_sigma_percent: 100.0 * within.count() as f64 / self.runs.len() as f64,
            settled_s: settled_s.unwrap_or(end.time_s),
        })
    }

    /// Time after which the RMS error of all runs in a quantity stays below a level, s; `None` if it does
    /// not.
    pub fn settled_s(&self, which: usize, level: f64) -> Option<f64> {
        let settled = |point: &&RmsPoint| {
            point.navigating == self.runs.len() && point.rms_error[which] < level
        };
        let since = self.history.iter().rev().take_while(settled).last();
        since.map(|point| point.time_s)
    }

    /// Two standard deviations of the fraction of errors within one sigma if the sigmas are correct, percent.
    pub fn coverage_spread_percent(&self) -> f64 {
        let variance = WITHIN_SIGMA * (1.0 - WITHIN_SIGMA) / self.runs.len() as f64;
        200.0 * variance.sqrt()
    }
}

/// `None` if no run navigates yet.
fn rms_point(runs: &[Run], check: usize) -> Option<RmsPoint> {
    let checks: Vec<&[Check; 8]> = runs
        .iter()
        .filter_map(|run| run.history[check].as_ref())
        .collect();
    let rms = |value: fn(&Check) -> f64| {
        core::array::from_fn(|which| rms(checks.iter().map(|checks| value(&checks[which]))))
    };
    (!checks.is_empty()).then(|| RmsPoint {
        time_s: EVERY_S * (check + 1) as f64,
        navigating: checks.len(),
        rms_error: rms(|check| check.error),
        rms_sigma: rms(|check| check.sigma),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Grade;

    /// Runs with the given errors in every quantity; sigma is 1.
    fn runs(errors: &[&[f64]]) -> Vec<Run> {
        let checks = |error: &f64| {
            let check = Check {
                error: *error,
                sigma: 1.0,
            };
            Some([check; 8])
        };
        (0..)
            .zip(errors)
            .map(|(seed, errors)| Run {
                seed,
                converged: errors[0] < 10.0,
                history: errors.iter().map(checks).collect(),
            })
            .collect()
    }

    #[test]
    fn statistics_of_two_runs() {
        let study = Study::new(Grade::Hg1700, 2);
        // RMS 11.5, 12, 1.5, 2.5, 1: below the level at the third check already, settled at the last.
        let all = runs(&[&[3.0, 12.0, 1.5, 2.5, -0.6], &[-16.0, 12.0, 1.5, 2.5, 1.28]]);
        let results = Results::new(study, all);
        let row = results.quantities[3];
        assert_eq!(results.converged, 2);
        assert!((row.rms_error - 0.9996).abs() < 1e-3);
        assert!((row.rms_sigma - 1.0).abs() < 1e-12);
        assert!((row.within_sigma_percent - 50.0).abs() < 1e-9);
        assert!((row.settled_s - 50.0).abs() < 1e-9);
    }

    #[test]
    fn limits_and_goals_are_given_only_for_their_drives() {
        for (grade, minutes, there) in [
            (Grade::Hg1700, 40.0, true),
            (Grade::Hg1700, 20.0, false),
            (Grade::Mems, 40.0, false),
        ] {
            let study = Study {
                minutes,
                ..Study::new(grade, 1)
            };
            let quantity = Results::new(study, runs(&[&[1.0]])).quantities[0].quantity;
            let both = [quantity.limit, quantity.goal].map(|value| value.is_some());
            assert_eq!(both, [there; 2], "{grade:?}, {minutes} min");
        }
    }

    #[test]
    fn runs_count_from_when_they_navigate() {
        let mut all = runs(&[&[4.0, 1.0, 1.0], &[0.0, 1.0, 1.0]]);
        all[1].history[0] = None;
        let results = Results::new(Study::new(Grade::Hg1700, 2), all);
        assert_eq!(results.history[0].navigating, 1);
        assert!((results.history[0].rms_error[0] - 4.0).abs() < 1e-12);
        assert!((results.quantities[0].settled_s - 20.0).abs() < 1e-9);
    }
}
