//! Statistics over the runs of a kind, and over all kinds.

use serde::Serialize;

use super::quantities::{QUANTITIES, index};
use super::run::{Check, Run, TrialRuns};
use super::{Kind, Quantity};
use crate::log::Grade;
use crate::statistics::{geometric_mean, median, rms_of_any};

/// An error of more than this many of its own sigmas is wrong.
pub const WRONG_SIGMAS: f64 = 4.5;
/// Bounds of the RMS of error over sigma of a consistent ("honest") quantity.
pub const HONEST: [f64; 2] = [0.7, 1.3];
/// Ratio of the RMS error to that of the Kalman filter up to which the core counts as near it.
pub const NEAR_KALMAN: f64 = 1.3;
/// A Kalman filter with an error of more than this many of its own sigmas has diverged.
pub const DIVERGED_SIGMAS: f64 = 10.0;

/// A quantity over the runs of a kind, in its unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Row {
    #[serde(flatten)]
    pub quantity: Quantity,
    pub checks: usize,
    pub rms_error: f64,
    pub rms_sigma: Option<f64>,
    /// Root mean square of error over sigma.
    pub rms_ratio: Option<f64>,
    /// Fraction of the errors within one stated sigma.
    pub within_one: f64,
    pub within_three: f64,
    /// Fraction stated as observable.
    pub observable: f64,
    /// How often stated as observable and wrong by `WRONG_SIGMAS`.
    pub wrong_and_sure: usize,
    /// Comparison with the Kalman filter, if one was run.
    pub kalman: Option<KalmanComparison>,
}

/// Errors of core and Kalman filter over the runs in which both have the quantity and the filter is not
/// lost.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct KalmanComparison {
    pub runs: usize,
    /// RMS error of the core in these.
    pub core_rms_error: f64,
    /// RMS error of the filter.
    pub rms_error: f64,
    /// RMS of the filter's error over its sigma: not about one if its model is incomplete.
    pub rms_ratio: Option<f64>,
    /// RMS error of the core over the filter's; zero if the core has no error, as with a latency within its
    /// bounds.
    pub over: f64,
}

impl KalmanComparison {
    /// `None` without a run to compare.
    fn new(quantity: usize, runs: &[&TrialRuns]) -> Option<Self> {
        let both: Vec<[Vec<Check>; 2]> = runs
            .iter()
            .filter_map(|trial| {
                let compared = |run: &&Run| !run.has_no_solution() && !run.has_diverged();
                let kalman = trial.kalman.as_ref().filter(compared)?;
                let both = [&trial.core, kalman].map(|run| run.of(quantity));
                both.iter().all(|checks| !checks.is_empty()).then_some(both)
            })
            .collect();
        let checks = |method: usize| both.iter().flat_map(move |both| &both[method]);
        let errors = |method: usize| rms_of_any(checks(method).map(|check| check.error));
        let (core_rms_error, rms_error) = (errors(0)?, errors(1)?);
        Some(Self {
            runs: both.len(),
            core_rms_error,
            rms_error,
            rms_ratio: rms_of_any(checks(1).filter_map(ratio)),
            over: if core_rms_error == 0.0 {
                0.0
            } else {
                core_rms_error / rms_error
            },
        })
    }
}

impl Run {
    fn of(&self, quantity: usize) -> Vec<Check> {
        let checks = self.checks.iter().copied();
        checks.filter(|check| check.quantity == quantity).collect()
    }

    /// At the end; most of these never aligned.
    fn has_no_solution(&self) -> bool {
        self.of(index::HEADING).is_empty()
    }

    /// An error is NaN, or more than [`DIVERGED_SIGMAS`].
    fn has_diverged(&self) -> bool {
        let mut ratios = self.checks.iter().filter_map(ratio);
        !self.has_no_solution() && !ratios.all(|ratio| ratio.abs() <= DIVERGED_SIGMAS)
    }
}

impl Row {
    /// `None` without estimates.
    fn new(quantity: usize, runs: &[&TrialRuns]) -> Option<Self> {
        let checks = runs.iter().flat_map(|trial| trial.core.of(quantity));
        let checks: Vec<Check> = checks.collect();
        let ratios: Vec<f64> = checks.iter().filter_map(ratio).collect();
        let fraction = |count: usize, of: usize| count as f64 / of as f64;
        let within = |bound: f64| {
            let inside = ratios.iter().filter(|ratio| ratio.abs() <= bound);
            fraction(inside.count(), ratios.len())
        };
        Some(Self {
            quantity: QUANTITIES[quantity],
            checks: checks.len(),
            rms_error: rms_of_any(checks.iter().map(|check| check.error))?,
            rms_sigma: rms_of_any(checks.iter().filter_map(|check| check.sigma)),
            rms_ratio: rms_of_any(ratios.iter().copied()),
            within_one: within(1.0),
            within_three: within(3.0),
            observable: fraction(checks.iter().filter(|c| c.observable).count(), checks.len()),
            wrong_and_sure: checks.iter().filter(|check| wrong_and_sure(check)).count(),
            kalman: KalmanComparison::new(quantity, runs),
        })
    }

    /// Whether the RMS of error over sigma is about one; less is allowed for a quantity that is never
    /// observable: it stays at its prior.
    pub fn honest(&self) -> Option<bool> {
        let [least, most] = HONEST;
        let least = if self.observable > 0.0 { least } else { 0.0 };
        self.rms_ratio.map(|ratio| (least..=most).contains(&ratio))
    }

    /// Estimates stated as observable.
    pub fn sure(&self) -> f64 {
        self.observable * self.checks as f64
    }
}

fn ratio(check: &Check) -> Option<f64> {
    check.sigma.map(|sigma| check.error / sigma)
}

fn wrong_and_sure(check: &Check) -> bool {
    // NaN is not within any bound.
    let right = ratio(check).is_none_or(|ratio| ratio.abs() <= WRONG_SIGMAS);
    check.observable && !right
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Results {
    pub kind: &'static str,
    pub what: &'static str,
    /// Whether it is a judge; else for development.
    pub judge: bool,
    pub class: Grade,
    pub runs: usize,
    /// Fraction of the runs that never had a solution.
    pub never: f64,
    /// Mean fraction of the second half without a solution.
    pub without_solution: f64,
    /// Median time of the first solution of those that had one, s.
    pub first_solution_s: Option<f64>,
    /// Runs of the Kalman filter that cannot be compared, if it was run.
    pub kalman_lost: Option<KalmanLost>,
    /// Quantities with estimates.
    pub rows: Vec<Row>,
}

/// Runs of the Kalman filter that cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct KalmanLost {
    pub without_solution: usize,
    /// With an error of more than `DIVERGED_SIGMAS`, or NaN.
    pub diverged: usize,
}

impl KalmanLost {
    fn new(runs: &[&TrialRuns]) -> Option<Self> {
        let kalman = || runs.iter().filter_map(|trial| trial.kalman.as_ref());
        kalman().next()?;
        Some(Self {
            without_solution: kalman().filter(|run| run.has_no_solution()).count(),
            diverged: kalman().filter(|run| run.has_diverged()).count(),
        })
    }

    /// Both.
    pub fn runs(self) -> usize {
        self.without_solution + self.diverged
    }
}

impl Results {
    pub fn new(kind: &Kind, class: Grade, runs: &[&TrialRuns]) -> Self {
        let firsts: Vec<f64> = (runs.iter())
            .filter_map(|trial| trial.core.first_solution_s)
            .collect();
        let count = runs.len() as f64;
        Self {
            kind: kind.name,
            what: kind.what,
            judge: kind.judge,
            class,
            runs: runs.len(),
            never: 1.0 - firsts.len() as f64 / count,
            without_solution: runs.iter().map(|t| t.core.without_solution).sum::<f64>() / count,
            first_solution_s: (!firsts.is_empty()).then(|| median(firsts.into_iter())),
            kalman_lost: KalmanLost::new(runs),
            rows: (0..QUANTITIES.len())
                .filter_map(|quantity| Row::new(quantity, runs))
                .collect(),
        }
    }

    /// The quantity with the largest RMS of error over sigma.
    pub fn worst(&self) -> Option<&Row> {
        let stated = self.rows.iter().filter(|row| row.rms_ratio.is_some());
        let key = |row: &Row| row.rms_ratio.unwrap_or_default();
        stated.max_by(|a, b| f64::total_cmp(&key(a), &key(b)))
    }

    /// How often any quantity is stated as observable and wrong.
    pub fn wrong_and_sure(&self) -> usize {
        self.rows.iter().map(|row| row.wrong_and_sure).sum()
    }

    /// Quantities that are honest, of those with a sigma.
    pub fn honest(&self) -> (usize, usize) {
        let judged = || self.rows.iter().filter_map(Row::honest);
        (judged().filter(|honest| *honest).count(), judged().count())
    }

    /// RMS error over that of the Kalman filter, of each quantity that can be compared in at least half of
    /// the runs: a ratio of few runs is uncertain.
    pub fn over_kalman(&self) -> impl Iterator<Item = (&Row, f64)> {
        let over = |row: &Row| {
            let comparison = row.kalman.as_ref()?;
            (2 * comparison.runs >= self.runs).then_some(comparison.over)
        };
        self.rows
            .iter()
            .filter_map(move |row| Some((row, over(row)?)))
    }

    /// Quantities about as good as the Kalman filter's, of those that can be compared.
    pub fn near_kalman(&self) -> (usize, usize) {
        let near = |(_, over): &(&Row, f64)| *over <= NEAR_KALMAN;
        (
            self.over_kalman().filter(near).count(),
            self.over_kalman().count(),
        )
    }
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Totals {
    pub name: String,
    /// Kinds, each class apart.
    pub kinds: usize,
    /// Of them those with all quantities honest.
    pub honest_kinds: usize,
    /// Quantities of all kinds.
    pub quantities: usize,
    /// Of them honest ones.
    pub honest_quantities: usize,
    /// Estimates stated as observable.
    pub sure: f64,
    /// Of them those that are wrong.
    pub wrong_and_sure: usize,
    /// Mean fraction of the runs that never had a solution.
    pub never: f64,
    /// Mean fraction of the second half without a solution.
    pub without_solution: f64,
    /// Quantities of all kinds that can be compared with the Kalman filter.
    pub compared: usize,
    /// Of them those whose RMS error is at most `NEAR_KALMAN` times the filter's.
    pub near_kalman: usize,
    /// Geometric mean of RMS error over the filter's, where both are above zero.
    pub over_kalman: Option<f64>,
    /// Runs of the filter that cannot be compared.
    pub kalman_lost: usize,
}

impl Totals {
    /// `None` without results.
    pub fn new(name: &str, results: &[&Results]) -> Option<Self> {
        let count = results.len() as f64;
        let honest: Vec<(usize, usize)> = results.iter().map(|r| r.honest()).collect();
        let rows = results.iter().flat_map(|results| &results.rows);
        let stated = rows.filter(|row| row.rms_sigma.is_some());
        let lost = results.iter().filter_map(|results| results.kalman_lost);
        let over = results.iter().flat_map(|r| r.over_kalman());
        let both_err = over.filter(|(_, over)| *over > 0.0 && over.is_finite());
        let mean = |part: fn(&Results) -> f64| results.iter().map(|r| part(r)).sum::<f64>() / count;
        (!results.is_empty()).then(|| Self {
            name: name.to_owned(),
            kinds: results.len(),
            honest_kinds: honest.iter().filter(|h| h.1 > 0 && h.0 == h.1).count(),
            quantities: honest.iter().map(|(_, all)| all).sum(),
            honest_quantities: honest.iter().map(|(good, _)| good).sum(),
            sure: stated.map(Row::sure).sum(),
            wrong_and_sure: results.iter().map(|r| r.wrong_and_sure()).sum(),
            never: mean(|r| r.never),
            without_solution: mean(|r| r.without_solution),
            compared: results.iter().map(|r| r.near_kalman().1).sum(),
            near_kalman: results.iter().map(|r| r.near_kalman().0).sum(),
            over_kalman: geometric_mean(both_err.map(|(_, over)| over)),
            kalman_lost: lost.map(KalmanLost::runs).sum(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::conditions::all;

    fn run(error: f64, sigma: f64) -> Run {
        let heading = Check {
            quantity: index::HEADING,
            error,
            sigma: Some(sigma),
            observable: true,
        };
        Run {
            first_solution_s: Some(1.0),
            without_solution: 0.0,
            checks: vec![heading],
        }
    }

    fn unaligned() -> Run {
        Run {
            first_solution_s: None,
            checks: Vec::new(),
            ..run(0.0, 1.0)
        }
    }

    #[test]
    fn runs_that_cannot_be_compared_are_counted_and_do_not_enter_the_ratio() {
        let runs_of = |core: Run, kalman: Run| TrialRuns {
            core,
            kalman: Some(kalman),
        };
        let runs = [
            runs_of(run(3.0, 1.0), run(-2.0, 1.0)),
            runs_of(run(-3.0, 1.0), run(2.0, 1.0)),
            runs_of(run(50.0, 1.0), run(11.0, 1.0)),
            runs_of(run(60.0, 1.0), run(f64::NAN, 1.0)),
            runs_of(run(70.0, 1.0), unaligned()),
            runs_of(unaligned(), run(0.01, 1.0)),
        ];
        let kind = all().next().unwrap();
        let of =
            |runs: &[TrialRuns]| Results::new(kind, Grade::Mems, &runs.iter().collect::<Vec<_>>());
        let results = of(&runs);
        let lost = results.kalman_lost.unwrap();
        assert_eq!((lost.without_solution, lost.diverged), (1, 2));
        let comparison = results.rows[0].kalman.unwrap();
        assert_eq!((comparison.runs, comparison.core_rms_error), (2, 3.0));
        assert!((comparison.over - 1.5).abs() < 1e-12);
        // The core's own statistics include all of its runs.
        assert_eq!(results.rows[0].checks, 5);
        // Two of six are too few for a ratio that counts; two of four are enough.
        assert_eq!(results.near_kalman(), (0, 0));
        let results = of(&runs[..4]);
        assert_eq!(results.near_kalman(), (0, 1));
        let total = Totals::new("all", &[&results]).unwrap();
        assert!((total.over_kalman.unwrap() - 1.5).abs() < 1e-12);
        let counts = (total.near_kalman, total.compared, total.kalman_lost);
        assert_eq!(counts, (0, 1, 2));
    }

    #[test]
    fn lost_runs_of_the_filter_are_counted_beside_runs_without_one() {
        let with = |kalman: Option<Run>| TrialRuns {
            core: run(1.0, 1.0),
            kalman,
        };
        let runs = [
            with(None),
            with(Some(unaligned())),
            with(Some(run(1.0, 1.0))),
        ];
        let kind = all().next().unwrap();
        let results = Results::new(kind, Grade::Mems, &runs.iter().collect::<Vec<_>>());
        assert_eq!(results.kalman_lost.map(KalmanLost::runs), Some(1));
    }

    #[test]
    fn zero_errors_count_as_near_and_do_not_enter_the_mean() {
        let results = |core: f64, kalman: f64| {
            let trial = TrialRuns {
                core: run(core, 1.0),
                kalman: Some(run(kalman, 1.0)),
            };
            Results::new(all().next().unwrap(), Grade::Mems, &[&trial])
        };
        let each = [
            results(0.0, 0.0),
            results(0.0, 1.0),
            results(1.0, 0.0),
            results(3.0, 2.0),
            results(f64::NAN, 1.0),
        ];
        let near = each.each_ref().map(|results| results.near_kalman().0);
        assert_eq!(near, [1, 1, 0, 0, 0]);
        let total = Totals::new("all", &each.each_ref()).unwrap();
        assert_eq!((total.near_kalman, total.compared), (2, 5));
        assert!((total.over_kalman.unwrap() - 1.5).abs() < 1e-12);
    }

    #[test]
    fn without_a_filter_there_is_no_comparison() {
        let alone = TrialRuns {
            core: run(3.0, 1.0),
            kalman: None,
        };
        let results = Results::new(all().next().unwrap(), Grade::Mems, &[&alone]);
        assert_eq!((results.kalman_lost, results.rows[0].kalman), (None, None));
        let total = Totals::new("all", &[&results]).unwrap();
        assert_eq!((total.compared, total.over_kalman), (0, None));
    }
}
