//! Values with 95 % confidence intervals.

use super::maximum::bisection;
use crate::identify::free_inertial::known;
use crate::sim::noise::Random;
use ins_core::Estimate;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};

/// Probability of each tail.
const TAIL: f64 = 0.025;
/// Most of the information in an estimate that may be its prior's.
const MOST_PRIOR: f64 = 0.6;
/// Normal deviate of 95 %.
pub const NORMAL_95: f64 = 1.959_964;

/// An estimate and its 95 % confidence interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    pub value: f64,
    pub low: f64,
    /// Upper bound; infinite if the data give none.
    pub high: f64,
}

impl Interval {
    /// A sigma without any data.
    pub const UNKNOWN: Self = Self {
        value: 0.0,
        low: 0.0,
        high: f64::INFINITY,
    };

    /// Symmetric.
    fn around(value: f64, half: f64) -> Self {
        [value, value - half, value + half].into()
    }

    pub fn each(&self) -> [f64; 3] {
        [self.value, self.low, self.high]
    }

    /// Of an increasing function.
    #[must_use]
    pub fn map(&self, f: impl Fn(f64) -> f64) -> Self {
        self.each().map(f).into()
    }

    #[must_use]
    pub fn scaled(&self, by: f64) -> Self {
        self.map(|value| by * value)
    }

    /// Extended to the bounds of another one.
    #[must_use]
    pub fn hull(&self, other: &Self) -> Self {
        Self {
            value: self.value,
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    /// A random value of it: normal in the logarithm where it is above zero, the two sides with their
    /// own widths. A side without a bound keeps the value.
    #[must_use]
    pub fn drawn(&self, random: &mut Random) -> Self {
        let deviate = random.normal() / NORMAL_95;
        let bound = if deviate < 0.0 { self.low } else { self.high };
        let bound = if bound.is_finite() { bound } else { self.value };
        let value = if self.low > 0.0 {
            self.value * libm::pow(bound / self.value, deviate.abs())
        } else {
            self.value + deviate.abs() * (bound - self.value)
        };
        // A sigma stays non-negative.
        let signed = self.low < 0.0;
        Self::around(if signed { value } else { value.max(0.0) }, 0.0)
    }

    pub fn holds(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }

    /// Whether a sigma is bounded away from zero and from infinity.
    pub fn is_bounded(&self) -> bool {
        self.low > 0.0 && self.high.is_finite()
    }

    /// The value of a sigma if it is bounded, else zero.
    pub fn bounded_or_zero(&self) -> f64 {
        if self.is_bounded() { self.value } else { 0.0 }
    }
}

impl From<[f64; 3]> for Interval {
    fn from([value, low, high]: [f64; 3]) -> Self {
        Self { value, low, high }
    }
}

/// Quantiles of chi-square at both ends of 95 %.
fn chi_square(dof: f64) -> [f64; 2] {
    match ChiSquared::new(dof) {
        Ok(chi) => [TAIL, 1.0 - TAIL].map(|p| chi.inverse_cdf(p)),
        Err(_) => [0.0, f64::INFINITY],
    }
}

/// Two-sided 95 % deviate of Student's t.
pub fn student(dof: f64) -> f64 {
    StudentsT::new(0.0, 1.0, dof).map_or(f64::INFINITY, |t| t.inverse_cdf(1.0 - TAIL))
}

/// Standard deviation from a sum of squares of `dof` independent normals.
pub fn sigma_of_squares(sum: f64, dof: f64) -> Interval {
    let [few, many] = chi_square(dof);
    [dof, many, few].map(|by| (sum / by).sqrt()).into()
}

/// A value and the variance of its error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    pub value: f64,
    pub variance: f64,
}

impl Measured {
    /// An estimate, if observable.
    pub(super) fn of(estimate: &Estimate) -> Option<Self> {
        known(estimate).then_some(Self {
            value: estimate.value,
            variance: estimate.sigma * estimate.sigma,
        })
    }

    /// With its prior, zero mean of sigma `prior`, taken out; none if most of it is the prior.
    pub fn without_prior(&self, prior: f64) -> Option<Self> {
        let (before, after) = (1.0 / (prior * prior), 1.0 / self.variance);
        (after * MOST_PRIOR > before).then(|| Self {
            value: self.value * after / (after - before),
            variance: 1.0 / (after - before),
        })
    }
}

/// As [`true_sigma`]; none of an empty slice.
pub fn sigma_if_any(measured: &[Measured]) -> Option<Interval> {
    (!measured.is_empty()).then(|| true_sigma(measured))
}

/// Standard deviation about zero of the quantities measured, the errors of measurement taken out.
///
/// Exact: `sum x^2 / (sigma^2 + s^2)` is chi-square at the true sigma, and falls with it. If the values
/// scatter less than their errors, the upper bound is that of values as large as their errors.
pub fn true_sigma(measured: &[Measured]) -> Interval {
    let count = measured.len() as f64;
    let [few, many] = chi_square(count);
    let [value, low, high] = [count, many, few].map(|sum| sigma_at(measured, sum));
    let of_errors = |one: &Measured| Measured {
        value: one.variance.sqrt(),
        ..*one
    };
    let errors: Vec<_> = measured.iter().map(of_errors).collect();
    [value, low, high.max(sigma_at(&errors, few))].into()
}

/// The sigma at which the weighted sum of squares has a value; zero if it is below even there.
fn sigma_at(measured: &[Measured], wanted: f64) -> f64 {
    let sum = |sigma: f64| -> f64 {
        (measured.iter())
            .map(|m| m.value * m.value / (sigma * sigma + m.variance))
            .sum()
    };
    if sum(0.0) <= wanted {
        return 0.0;
    }
    let squares: f64 = measured.iter().map(|m| m.value * m.value).sum();
    let most = (squares / wanted).sqrt();
    bisection(|sigma| sum(sigma) - wanted, 0.0, most, 60)
}

/// Mean of measured values, weighted by the inverse of their stated variances.
struct WeightedMean {
    mean: f64,
    weight: f64,
    /// Weighted sum of squared deviations from the mean.
    scatter: f64,
    dof: f64,
}

impl WeightedMean {
    fn new(measured: &[Measured]) -> Self {
        let sum = |of: &dyn Fn(&Measured) -> f64| {
            let weighed = |m: &Measured| of(m) / m.variance;
            measured.iter().map(weighed).sum::<f64>()
        };
        let weight = sum(&|_| 1.0);
        let mean = sum(&|m| m.value) / weight;
        Self {
            mean,
            weight,
            scatter: sum(&|m| (m.value - mean) * (m.value - mean)),
            dof: measured.len() as f64 - 1.0,
        }
    }
}

/// Weighted mean, its interval from the scatter of the values: Student's t.
pub fn mean(measured: &[Measured]) -> Option<Interval> {
    let all = WeightedMean::new(measured);
    (all.dof >= 1.0).then(|| {
        let spread = (all.scatter / all.dof / all.weight).sqrt();
        Interval::around(all.mean, student(all.dof) * spread)
    })
}

/// The same of values of equal weight.
pub(crate) fn plain_mean(values: impl Iterator<Item = f64>) -> Option<Interval> {
    let variance = 1.0;
    let measured: Vec<Measured> = values.map(|value| Measured { value, variance }).collect();
    mean(&measured)
}

/// Weighted mean of one quantity, its interval from the stated errors.
pub fn common_value(measured: &[Measured]) -> Interval {
    let all = WeightedMean::new(measured);
    Interval::around(all.mean, NORMAL_95 / all.weight.sqrt())
}

/// Chi-square test whether all may be one and the same quantity, with errors as stated.
pub fn are_consistent(measured: &[Measured]) -> bool {
    let all = WeightedMean::new(measured);
    all.dof < 1.0 || all.scatter < chi_square(all.dof)[1]
}

/// Bounds of a uniform distribution from at least two draws, unbiased.
///
/// The distance of a bound from the outermost of n draws, over their range, exceeds t with the
/// probability `(1 + t)^(1 - n)`: exact.
pub fn uniform_bounds(values: &[f64]) -> [Interval; 2] {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (range, dof) = (most - least, values.len() as f64 - 1.0);
    let beyond = |chance: f64| range * (chance.powf(-1.0 / dof) - 1.0);
    let (near, best, far) = (beyond(1.0 - TAIL), range / dof, beyond(TAIL));
    [
        [least - best, least - far, least - near].into(),
        [most + best, most + near, most + far].into(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::noise::Random;

    const TRIALS: u32 = 2000;

    /// Of 2000 correct intervals 1900 +- 9.7 hold the truth; four standard deviations.
    fn assert_covers(name: &str, mut trial: impl FnMut(&mut Random) -> bool) {
        let mut random = Random::stream(11, name);
        let held = (0..TRIALS).filter(|_| trial(&mut random)).count();
        assert!((1861..=1939).contains(&held), "{name}: {held}");
    }

    #[test]
    fn intervals_hold_the_truth_as_often_as_they_say() {
        assert_covers("variance", |random| {
            let sum: f64 = (0..3).map(|_| (2.0 * random.normal()).powi(2)).sum();
            sigma_of_squares(sum, 3.0).holds(2.0)
        });
        assert_covers("spread behind errors", |random| {
            let measured: Vec<Measured> = (1..=6)
                .map(|n| {
                    let variance = 0.3 * f64::from(n);
                    let value = 2.0 * random.normal() + variance.sqrt() * random.normal();
                    Measured { value, variance }
                })
                .collect();
            true_sigma(&measured).holds(2.0)
        });
        assert_covers("mean", |random| {
            let measured: Vec<Measured> = (1..=5)
                .map(|n| {
                    let variance = f64::from(n);
                    let value = 7.0 + 3.0 * variance.sqrt() * random.normal();
                    Measured { value, variance }
                })
                .collect();
            mean(&measured).unwrap().holds(7.0)
        });
        for bound in [0, 1] {
            assert_covers("uniform", |random| {
                let values: Vec<f64> = (0..4).map(|_| random.uniform([0.05, 0.3])).collect();
                uniform_bounds(&values)[bound].holds([0.05, 0.3][bound])
            });
        }
    }

    #[test]
    fn no_spread_is_found_where_errors_explain_all() {
        let measured = [0.5, -0.8, 0.3].map(|value| Measured {
            value,
            variance: 1.0,
        });
        let sigma = true_sigma(&measured);
        assert!(sigma.value == 0.0 && sigma.low == 0.0 && sigma.high > 0.0);
        assert!(are_consistent(&measured) && !sigma.is_bounded());
    }

    #[test]
    fn draws_stay_within_as_often_as_intervals_say() {
        for drawn_from in [[2.0, 1.0, 8.0], [-0.1, -0.2, 0.3]].map(Interval::from) {
            assert_covers("drawn", |random| {
                drawn_from.holds(drawn_from.drawn(random).value)
            });
        }
        let mut random = Random::stream(3, "drawn");
        for _ in 0..1000 {
            // A sigma stays non-negative, and a side without a bound keeps the value.
            assert!(Interval::from([0.1, 0.0, 1.0]).drawn(&mut random).value >= 0.0);
            let open = Interval::from([1.0, 0.5, f64::INFINITY]).drawn(&mut random);
            assert!((0.1..=1.0).contains(&open.value));
        }
    }
}
