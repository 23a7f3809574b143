//! Estimation of the strength of a random walk beside white GNSS noise.
#![allow(clippy::disallowed_methods)]

use nalgebra::Vector2;

use super::ProcessNoise;
use crate::deviates::Deviates;

const RANGE: [f64; 2] = [0.1, 10.0];
/// Variance of the walk per second; the white noise has one of 1 every 0.2 s, so it is tracked within 5 s.
const WALK: f64 = 0.01;
/// Half an hour.
const FIXES: usize = 9000;

/// Estimated variance in the configured one after half an hour of a walk `factor` times as strong: geometric
/// mean over some runs.
fn estimated_ratio(factor: f64, runs: u64) -> f64 {
    let mut logarithms = 0.0;
    for run in 0..runs {
        let mut deviates = Deviates(run);
        let mut process = ProcessNoise::configured();
        let mut next = || f64::from(deviates.next());
        let (mut truth, mut estimate) = (Vector2::<f64>::zeros(), Vector2::<f64>::zeros());
        let mut variance = 1.0;
        for _ in 0..FIXES {
            truth += Vector2::new(next(), next()) * (factor * f64::sqrt(0.2 * WALK));
            let process_noise = 0.2 * WALK * process.ratio;
            process.add_noise(0.2, process_noise);
            variance += process_noise;
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

/// One run is accurate to a fifth, ten runs to 7 %; the mean of logarithms is lower by half the square of a
/// fifth. Three sigmas of both.
#[test]
fn strength_converges_from_above_and_below() {
    for factor in [0.5, 1.0, 3.0, 8.0] {
        let ratio_error = estimated_ratio(factor, 10) / (factor * factor);
        assert!(
            (0.75..1.3).contains(&ratio_error),
            "{factor}: {ratio_error}"
        );
    }
}

#[test]
fn strength_stays_within_the_configured_range() {
    let strongest = estimated_ratio(30.0, 1);
    assert!((50.0..100.1).contains(&strongest), "{strongest}");
    let mut trusted = ProcessNoise::configured();
    trusted.add_noise(60.0, 1.0);
    trusted.corrected(&Vector2::new(100.0, 100.0), 1.0, 1.0, 0.5);
    trusted.adapt(0.5, [1.0, 1.0]);
    assert!((trusted.ratio - 1.0).abs() < 1e-12, "{trusted:?}");
}

#[test]
fn corrections_explained_by_parameters_are_not_noise() {
    let mut process = ProcessNoise::configured();
    process.add_noise(60.0, 1.0);
    process.corrected(&Vector2::new(30.0, 30.0), 900.0, 1.0, 0.5);
    process.adapt(0.5, RANGE);
    assert!((process.ratio - 1.0).abs() < 1e-3, "{process:?}");
}
