//! Statistical checks of seeded samples, for tests here and in src/sim.

/// Probability of a false alarm 6e-5 per check; seeds are fixed, so results are reproducible.
const SIGMAS: f64 = 4.0;

pub fn mean(samples: &[f64]) -> f64 {
    samples.iter().sum::<f64>() / samples.len() as f64
}

/// Mean product of two zero-mean samples.
pub fn covariance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / a.len().min(b.len()) as f64
}

/// The mean of independent samples of standard deviation `sigma`.
pub fn assert_mean(samples: &[f64], expected: f64, sigma: f64) {
    let bound = SIGMAS * sigma / (samples.len() as f64).sqrt();
    let error = mean(samples) - expected;
    assert!(error.abs() < bound, "mean error {error:e}, bound {bound:e}");
}

/// The variance of independent zero-mean normal samples: chi-square, near normal for 500 and
/// more, with a relative standard deviation of sqrt(2/n).
pub fn assert_sigma(samples: &[f64], expected: f64) {
    assert!(samples.len() >= 500);
    let ratio = covariance(samples, samples) / (expected * expected);
    let bound = SIGMAS * (2.0 / samples.len() as f64).sqrt();
    assert!(
        (ratio - 1.0).abs() < bound,
        "variance {ratio} of {expected}^2, bound {bound}"
    );
}

/// The correlation of two normal samples; its standard deviation is (1 - r^2)/sqrt(n).
pub fn assert_correlation(a: &[f64], b: &[f64], expected: f64) {
    let r = covariance(a, b) / (covariance(a, a) * covariance(b, b)).sqrt();
    let bound = SIGMAS * (1.0 - expected * expected) / (a.len().min(b.len()) as f64).sqrt();
    assert!(
        (r - expected).abs() < bound,
        "correlation {r} for {expected}, bound {bound}"
    );
}
