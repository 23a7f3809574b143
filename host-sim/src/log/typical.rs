//! Typical values, and how far others are from them.

/// Alignment alone takes that long.
pub(super) const SHORT_S: f64 = 20.0;

/// Whether `value` is `reference` up to a factor.
pub(super) fn within(value: f64, reference: f64, factor: f64) -> bool {
    value < reference * factor && value > reference / factor
}

/// Logarithm of how many times one is the other.
pub(super) fn apart(value: f64, reference: f64) -> f64 {
    (value / reference).ln().abs()
}

/// Median time from one to the next, s; zero of fewer than two.
pub(crate) fn median_interval_s(times: impl Iterator<Item = ins_core::Time>) -> f64 {
    let times: Vec<_> = times.collect();
    median(times.windows(2).map(|pair| pair[1].seconds_since(pair[0])))
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
