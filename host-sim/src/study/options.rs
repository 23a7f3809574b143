//! Numbers that options of several studies take.

use std::ops::RangeInclusive;

/// Seeds are counted up from the first.
pub const MOST_SEED: u64 = u64::MAX / 2;

/// A number within a range, or what is wanted.
pub fn within(text: &str, range: RangeInclusive<f64>, wanted: &str) -> Result<f64, String> {
    let number = text.parse().ok();
    number
        .filter(|number| range.contains(number))
        .ok_or_else(|| wanted.to_owned())
}

pub fn minutes(text: &str) -> Result<f64, String> {
    within(text, 1.0..=1440.0, "minutes from 1 to 1440")
}
