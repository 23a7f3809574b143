//! Root mean square with its confidence interval.

use serde::Serialize;

use crate::sim::noise::Random;
use crate::statistics::whole;
pub use crate::statistics::{median, rms};

const RESAMPLES: usize = 4000;
/// Of fewer values the percentiles of a bootstrap hold the RMS far less often than they say: three times in
/// four of five.
const FEWEST: usize = 10;

/// What many runs say of one error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figure {
    pub rms: f64,
    /// 95 % confidence interval of it: bootstrap, percentiles; narrow by some where values are few,
    /// so that it holds the RMS in 85 % of the cases of ten values, 90 % of thirty, 92 % of fifty.
    /// None of fewer.
    pub rms_95: Option<[f64; 2]>,
    pub median: f64,
}

impl Figure {
    /// Of at least one value. Squares of position errors are far from normal, and how far depends
    /// on what causes them: hence no chi-square.
    pub fn of(values: &[f64]) -> Self {
        let mut random = Random::stream(0, "bootstrap");
        let count = values.len();
        let mut draw = || values[whole(random.unit() * count as f64)];
        let mut resampled: Vec<f64> = (0..RESAMPLES)
            .map(|_| rms((0..count).map(|_| draw())))
            .collect();
        resampled.sort_by(f64::total_cmp);
        let tail = RESAMPLES / 40;
        Self {
            rms: rms(values.iter().copied()),
            rms_95: (count >= FEWEST).then(|| [resampled[tail], resampled[RESAMPLES - 1 - tail]]),
            median: median(values.iter().copied()),
        }
    }

    #[must_use]
    pub fn scaled(&self, by: f64) -> Self {
        Self {
            rms: by * self.rms,
            rms_95: self.rms_95.map(|bounds| bounds.map(|bound| by * bound)),
            median: by * self.median,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The interval holds the true RMS of normal errors about as often as it says.
    #[test]
    fn the_interval_covers_what_it_says() {
        let mut random = Random::stream(7, "coverage");
        let trials = 300;
        let covered = (0..trials)
            .filter(|_| {
                let values: Vec<f64> = (0..100).map(|_| random.normal()).collect();
                let [low, high] = Figure::of(&values).rms_95.unwrap();
                (low..high).contains(&1.0)
            })
            .count();
        // 95 % of 300 is 285 +- 3.8; percentile intervals of 100 values cover some 93 %.
        assert!((264..=297).contains(&covered), "{covered}");
    }

    #[test]
    fn a_few_values_have_no_interval() {
        assert_eq!(Figure::of(&[1.0; FEWEST - 1]).rms_95, None);
        assert!(Figure::of(&[1.0; FEWEST]).rms_95.is_some());
    }
}
