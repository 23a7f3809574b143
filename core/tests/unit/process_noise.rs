//! An error that walks under a white noise of GNSS: how far it walks is found.
#![allow(clippy::disallowed_methods)]

use nalgebra::Vector2;

use super::ProcessNoise;
use crate::deviates::Deviates;

const RANGE: [f64; 2] = [0.1, 10.0];
/// Variance that comes in each second, beside a white one of 1 each 0.2 s: followed within 5 s.
const WALK: f64 = 0.01;
/// Half an hour.
const FIXES: usize = 9000;

/// What is found in half an hour of a walk `times` as strong as configured, against the configured
/// variance: geometric mean over some runs.
fn found(times: f64, runs: u64) -> f64 {
    let mut logarithms = 0.0;
    for run in 0..runs {
        let mut deviates = Deviates(run);
        let mut process = ProcessNoise::configured();
        let mut next = || f64::from(deviates.next());
        let (mut truth, mut estimate) = (Vector2::<f64>::zeros(), Vector2::<f64>::zeros());
        let mut variance = 1.0;
        for _ in 0..FIXES {
            truth += Vector2::new(next(), next()) * (times * f64::sqrt(0.2 * WALK));
            let came = 0.2 * WALK * process.ratio;
            process.add_noise(0.2, came);
            variance += came;
            let innovation = truth + Vector2::new(next(), next()) - estimate;
            let total = variance + 1.0;
            let gain = variance / total;
            estimate += innovation * gain;
            variance *= 1.0 - gain;
            process.corrected(&innovation, total, gain, gain * gain * total);
            process.adapt(variance, RANGE);
        }
        #[expect(clippy::cast_precision_loss)]
        let count = runs as f64;
        logarithms += process.ratio.ln() / count;
    }
    logarithms.exp()
}

/// One run remembers a fifth, in sigmas: ten of them are good to 7 % in the variance, and a
/// logarithm lies below that of the mean by half of the square of the fifth. Three sigmas of both.
#[test]
fn the_strength_is_found_from_above_and_below() {
    for times in [0.5, 1.0, 3.0, 8.0] {
        let off = found(times, 10) / (times * times);
        assert!((0.75..1.3).contains(&off), "{times}: {off}");
    }
}

#[test]
fn it_stays_within_the_bounds_of_the_user() {
    let strongest = found(30.0, 1);
    assert!((50.0..100.1).contains(&strongest), "{strongest}");
    let mut trusted = ProcessNoise::configured();
    trusted.add_noise(60.0, 1.0);
    trusted.corrected(&Vector2::new(100.0, 100.0), 1.0, 1.0, 0.5);
    trusted.adapt(0.5, [1.0, 1.0]);
    assert!((trusted.ratio - 1.0).abs() < 1e-12, "{trusted:?}");
}

/// A move that parameters explain, by what they add to its variance, says nothing of the noise.
#[test]
fn what_parameters_explain_teaches_little() {
    let mut process = ProcessNoise::configured();
    process.add_noise(60.0, 1.0);
    process.corrected(&Vector2::new(30.0, 30.0), 900.0, 1.0, 0.5);
    process.adapt(0.5, RANGE);
    assert!((process.ratio - 1.0).abs() < 1e-3, "{process:?}");
}
