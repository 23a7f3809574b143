//! Ranges of the numerical options of several studies.

use std::ops::RangeInclusive;

/// Largest first seed: the others follow.
pub const MOST_SEED: u64 = u64::MAX / 2;

/// Parses a number within a range; `wanted` is the error.
pub fn within(text: &str, range: RangeInclusive<f64>, wanted: &str) -> Result<f64, String> {
    let number = text.parse().ok();
    number
        .filter(|number| range.contains(number))
        .ok_or_else(|| wanted.to_owned())
}

pub fn minutes(text: &str) -> Result<f64, String> {
    within(text, 1.0..=1440.0, "minutes from 1 to 1440")
}
