//! Medians, ratios to known values, and quantities over time.

use std::collections::BTreeMap;

use ins_core::Time;
use nalgebra::Vector2;

use crate::statistics::whole;

/// Duration of alignment, s.
pub(super) const ALIGNMENT_S: f64 = 20.0;

/// Whether `value` is `reference` up to a factor.
pub(super) fn within(value: f64, reference: f64, factor: f64) -> bool {
    value < reference * factor && value > reference / factor
}

/// Absolute logarithm of the ratio.
fn log_ratio(value: f64, reference: f64) -> f64 {
    (value / reference).ln().abs()
}

/// What the nearest of some known values stands for; none if its ratio to the value is beyond a factor.
pub(super) fn nearest_known<T>(
    known: impl IntoIterator<Item = (f64, T)>,
    value: f64,
    factor: f64,
) -> Option<T> {
    let distance = |candidate: &(f64, T)| log_ratio(value, candidate.0);
    let nearest = known
        .into_iter()
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    within(value, nearest.0, factor).then_some(nearest.1)
}

/// Median interval, s; zero of fewer than two times.
pub(crate) fn median_interval_s(times: impl Iterator<Item = Time>) -> f64 {
    // A histogram: even a long log has few different intervals.
    let mut counts: BTreeMap<i64, usize> = BTreeMap::new();
    let mut last: Option<Time> = None;
    for time in times {
        let before = last.replace(time).map(Time::as_micros);
        if let Some(before) = before {
            let micros = time.as_micros().saturating_sub(before);
            *counts.entry(micros).or_default() += 1;
        }
    }
    let mut before_median = counts.values().sum::<usize>() / 2;
    for (micros, count) in counts {
        if count > before_median {
            return Time::from_micros(micros).seconds_since(Time::default());
        }
        before_median -= count;
    }
    0.0
}

/// A series for its median, decimated where it is very long.
pub(super) struct Series {
    kept: Vec<f64>,
    /// One value of so many is kept.
    decimation: usize,
    count: usize,
}

/// 44 min at 100 Hz.
const MOST_KEPT: usize = 1 << 18;

impl Default for Series {
    fn default() -> Self {
        Self {
            kept: Vec::new(),
            decimation: 1,
            count: 0,
        }
    }
}

impl Series {
    pub(super) fn push(&mut self, value: f64) {
        if self.count.is_multiple_of(self.decimation) {
            if self.kept.len() == MOST_KEPT {
                let mut index = 0;
                self.kept.retain(|_| {
                    index += 1;
                    index % 2 == 1
                });
                self.decimation *= 2;
            }
            if self.count.is_multiple_of(self.decimation) {
                self.kept.push(value);
            }
        }
        self.count += 1;
    }

    /// Median; zero of nothing.
    pub(super) fn median(self) -> f64 {
        median(self.kept.into_iter())
    }
}

/// Median; zero of nothing.
pub(crate) fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// A quantity resampled at a fixed interval, for fast interpolation.
#[derive(Default)]
pub(super) struct Curve {
    start_s: f64,
    values: Vec<f64>,
    last: Option<(f64, f64)>,
}

impl Curve {
    /// Finer than any manoeuvre.
    const STEP_S: f64 = 0.02;

    /// Interpolates between points in order of time.
    pub(super) fn new(points: impl Iterator<Item = (f64, f64)>) -> Self {
        let mut curve = Self::default();
        for (time_s, value) in points {
            curve.push(time_s, value);
        }
        curve
    }

    /// Appends a point that is later than the last.
    pub(super) fn push(&mut self, to_s: f64, b: f64) {
        let (from_s, a) = self.last.replace((to_s, b)).unwrap_or_else(|| {
            self.start_s = to_s;
            (to_s, b)
        });
        loop {
            let time_s = self.start_s + Self::STEP_S * self.values.len() as f64;
            if time_s >= to_s {
                break;
            }
            self.values
                .push(a + (b - a) * (time_s - from_s) / (to_s - from_s));
        }
    }

    pub(super) fn covers(&self, time_s: f64) -> bool {
        let step = (time_s - self.start_s) / Self::STEP_S;
        step >= 0.0 && step + 1.0 < self.values.len() as f64
    }

    /// Change from one time to another, if both are covered.
    pub(super) fn change(&self, from_s: f64, to_s: f64) -> Option<f64> {
        (self.covers(from_s) && self.covers(to_s)).then(|| self.at(to_s) - self.at(from_s))
    }

    pub(super) fn at(&self, time_s: f64) -> f64 {
        let step = (time_s - self.start_s) / Self::STEP_S;
        let index = whole(step).min(self.values.len() - 2);
        let (a, b) = (self.values[index], self.values[index + 1]);
        a + (b - a) * (step - index as f64)
    }
}

/// Ends, s, of successive intervals of about a second in a time series; gaps of three seconds are left
/// out.
pub(super) fn intervals<T: Copy>(all: impl Iterator<Item = (f64, T)>) -> Vec<[(f64, T); 2]> {
    let mut intervals = Vec::new();
    let mut start: Option<(f64, T)> = None;
    for next in all {
        let from = *start.get_or_insert(next);
        let seconds = next.0 - from.0;
        if seconds < 0.95 {
            continue;
        }
        if seconds < 3.0 {
            intervals.push([from, next]);
        }
        start = Some(next);
    }
    intervals
}

/// Angle from one vector to another, counter-clockwise positive.
pub(super) fn signed_angle(from: Vector2<f64>, to: Vector2<f64>) -> f64 {
    from.perp(&to).atan2(from.dot(&to))
}
