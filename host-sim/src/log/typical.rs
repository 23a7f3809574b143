//! Typical values, and how far others are from them.

use std::collections::BTreeMap;

use ins_core::Time;

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
