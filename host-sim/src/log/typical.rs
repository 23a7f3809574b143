//! Typical values, how far others are from them, and quantities over time.

use std::collections::BTreeMap;

use ins_core::Time;
use nalgebra::Vector2;

use crate::statistics::whole;

/// Alignment alone takes that long.
pub(super) const SHORT_S: f64 = 20.0;

/// Whether `value` is `reference` up to a factor.
pub(super) fn within(value: f64, reference: f64, factor: f64) -> bool {
    value < reference * factor && value > reference / factor
}

/// Logarithm of how many times one is the other.
fn apart(value: f64, reference: f64) -> f64 {
    (value / reference).ln().abs()
}

/// What a value most likely is, of some that are known; none if it is not near.
pub(super) fn likeliest<T>(
    known: impl IntoIterator<Item = (f64, T)>,
    value: f64,
    factor: f64,
) -> Option<T> {
    let off = |guess: &(f64, T)| apart(value, guess.0);
    let nearest = known.into_iter().min_by(|a, b| off(a).total_cmp(&off(b)))?;
    within(value, nearest.0, factor).then_some(nearest.1)
}

/// Median time from one to the next, s; zero of fewer than two.
pub(crate) fn median_interval_s(times: impl Iterator<Item = Time>) -> f64 {
    // However long the log, there are few different ones.
    let mut counts: BTreeMap<i64, usize> = BTreeMap::new();
    let mut last: Option<Time> = None;
    for time in times {
        let before = last.replace(time).map(Time::as_micros);
        if let Some(before) = before {
            let micros = time.as_micros().saturating_sub(before);
            *counts.entry(micros).or_default() += 1;
        }
    }
    let mut to_middle = counts.values().sum::<usize>() / 2;
    for (micros, count) in counts {
        if count > to_middle {
            return Time::from_micros(micros).seconds_since(Time::default());
        }
        to_middle -= count;
    }
    0.0
}

/// What is typical of a series: its median, of an even part where it is very long.
pub(super) struct Series {
    kept: Vec<f64>,
    /// One of so many is kept.
    every: usize,
    count: usize,
}

/// 44 min at 100 Hz.
const MOST_KEPT: usize = 1 << 18;

impl Default for Series {
    fn default() -> Self {
        Self {
            kept: Vec::new(),
            every: 1,
            count: 0,
        }
    }
}

impl Series {
    pub(super) fn push(&mut self, value: f64) {
        if self.count.is_multiple_of(self.every) {
            if self.kept.len() == MOST_KEPT {
                let mut index = 0;
                self.kept.retain(|_| {
                    index += 1;
                    index % 2 == 1
                });
                self.every *= 2;
            }
            if self.count.is_multiple_of(self.every) {
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

/// A quantity at equal steps of time, to be looked up fast.
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

    /// Goes on to a point that is later than the last.
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

    pub(super) fn reaches(&self, time_s: f64) -> bool {
        let step = (time_s - self.start_s) / Self::STEP_S;
        step >= 0.0 && step + 1.0 < self.values.len() as f64
    }

    /// What it changes by from one time to another, if both are within.
    pub(super) fn change(&self, from_s: f64, to_s: f64) -> Option<f64> {
        (self.reaches(from_s) && self.reaches(to_s)).then(|| self.at(to_s) - self.at(from_s))
    }

    pub(super) fn at(&self, time_s: f64) -> f64 {
        let step = (time_s - self.start_s) / Self::STEP_S;
        let index = whole(step).min(self.values.len() - 2);
        let (a, b) = (self.values[index], self.values[index + 1]);
        a + (b - a) * (step - index as f64)
    }
}

/// Ends of successive intervals of a second or so, among what comes in order of time, s; where
/// nothing comes for three seconds there is none.
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

/// Angle from one vector to the next, counter-clockwise.
pub(super) fn turned(from: Vector2<f64>, to: Vector2<f64>) -> f64 {
    from.perp(&to).atan2(from.dot(&to))
}
