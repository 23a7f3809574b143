//! Estimation of the strength and correlation time of correlated noise beside white noise.
#![allow(clippy::disallowed_methods, clippy::cast_precision_loss)]

use nalgebra::{Matrix2, Vector2};

use crate::channel::Markov;
use crate::config::Noise;
use crate::deviates::Deviates;
use crate::observer::coloured_noise::{ColouredNoise, CorrelationTime, FilterSensitivity};
use crate::time::Time;

const CONFIGURED: Noise = Noise {
    white: 1.0,
    correlated: 0.5,
    correlation_s: 2.0,
};
const RANGE: [f64; 2] = [0.1, 10.0];
const FIXES: usize = 4000;

/// Geometric mean of the estimated variance in the configured one, over the second half of 4000 fixes in
/// 800 s, of noise `factor` times as strong; `start_sigma` is that of a constant beside it.
fn strength_of(factor: f64, start_sigma: f64) -> f64 {
    let [strength, _] = noise_of(factor, 1.0, start_sigma, [1.0, 1.0]);
    strength
}

/// The same for a correlation time `time_ratio` times the configured one; estimated variance and correlation time.
fn noise_of(factor: f64, time_ratio: f64, start_sigma: f64, time_range: [f64; 2]) -> [f64; 2] {
    let mut deviates = Deviates(3);
    let mut correlation = CorrelationTime::default();
    let noise = Noise {
        correlation_s: time_ratio * CONFIGURED.correlation_s,
        ..CONFIGURED
    };
    let mut coloured = ColouredNoise::new(Time::default());
    let mut sensitivity = FilterSensitivity::default();
    let (mut truth, constant) = (0.0, start_sigma * f64::from(deviates.next()));
    let mut estimate = Vector2::zeros();
    let mut covariance = Matrix2::from_diagonal(&Vector2::new(start_sigma * start_sigma, 0.25));
    let observation = Vector2::new(1.0, 1.0);
    let mut logarithms = [0.0; 2];
    for fix in 0..FIXES {
        let true_noise = Markov::over(0.2, &noise, factor * factor);
        truth = true_noise.decay * truth + true_noise.variance.sqrt() * f64::from(deviates.next());
        let stretch = correlation.ratio_of(&coloured);
        let assumed = Markov::over(0.2 / stretch, &CONFIGURED, coloured.strength * stretch);
        let sigma2 = CONFIGURED.correlated * CONFIGURED.correlated * coloured.strength * stretch;
        let part = 0.2 / (CONFIGURED.correlation_s * stretch);
        let known = Vector2::new(estimate.y, 0.0);
        correlation.propagate(&assumed, part, sigma2, &known, covariance.m22);
        let decay = Matrix2::from_diagonal(&Vector2::new(1.0, assumed.decay));
        estimate = decay * estimate;
        covariance = decay * covariance * decay;
        covariance.m22 += assumed.variance;
        sensitivity.propagate(&assumed);
        let total = observation.dot(&(covariance * observation)) + 1.0;
        let measured = constant + truth + f64::from(deviates.next());
        let innovation = measured - observation.dot(&estimate);
        let gain = covariance * observation / total;
        estimate += gain * innovation;
        covariance -= gain * gain.transpose() * total;
        let innovation = Vector2::new(innovation, 0.0);
        coloured.learn(&sensitivity, &innovation, 1.0, total, RANGE);
        sensitivity.update(&innovation, total, 1.0);
        coloured.scale(1.0);
        correlation.learn(&innovation, total, time_range);
        correlation.update(&innovation, total, 1.0);
        if fix >= FIXES / 2 {
            let part = 1.0 / (FIXES / 2) as f64;
            logarithms[0] += part * (coloured.ratio * stretch).ln();
            logarithms[1] += part * correlation.ratio.ln();
        }
    }
    logarithms.map(f64::exp)
}

/// The data span 80 to 400 correlation times: both are accurate to a fifth at best, and limited by the memory.
#[test]
fn correlation_time_is_estimated() {
    for (factor, time_ratio) in [(1.0, 1.0), (1.0, 5.0), (2.0, 5.0)] {
        let [variance, time] = noise_of(factor, time_ratio, 0.0, RANGE);
        let ratio = [variance / (factor * factor), time / time_ratio];
        let in_range = ratio.iter().all(|ratio| (0.5..2.0).contains(ratio));
        assert!(in_range, "{factor} {time_ratio}: {ratio:?}");
    }
}

/// A memory of ten units of information: the variance is accurate to a third, and its mean over the second
/// half to somewhat better; three sigmas of that. The constant does not matter.
#[test]
fn strength_converges_from_above_and_below() {
    for start_sigma in [0.0, 100.0] {
        for factor in [0.7, 1.0, 2.0, 5.0] {
            let ratio = strength_of(factor, start_sigma) / (factor * factor);
            assert!((0.5..2.0).contains(&ratio), "{factor}: {ratio}");
        }
    }
}

#[test]
fn absent_noise_is_estimated_as_small() {
    let strength = strength_of(0.0, 100.0);
    // A tenth of the sigma is the lower bound, which is approached slowly.
    assert!((0.1..0.3).contains(&strength), "{strength}");
}

#[test]
fn strength_stays_within_the_configured_range() {
    let strongest = strength_of(20.0, 100.0);
    assert!((50.0..=100.0).contains(&strongest), "{strongest}");
}

#[test]
fn white_noise_stays_white() {
    let before = ColouredNoise::new(Time::default());
    let (mut after, mut sensitivity) = (before, FilterSensitivity::default());
    sensitivity.propagate(&Markov::over(1.0, &Noise::white(1.0), 1.0));
    after.learn(&sensitivity, &Vector2::new(3.0, 0.0), 1.0, 1.0, RANGE);
    sensitivity.update(&Vector2::new(3.0, 0.0), 1.0, 1.0);
    assert_eq!((after, sensitivity), (before, FilterSensitivity::default()));
    let now = Time::from_micros(1_000_000);
    let estimate = Vector2::new(1.0, 0.0);
    after.learn_from_state(now, &estimate, 1.0, 0.0, (&Noise::white(1.0), 1.0), RANGE);
    assert_eq!(after, before);
}

/// Geometric mean as above, estimated from the noise state, with a constant error of the INS.
fn strength_from_state(factor: f64, ins_error: f64) -> f64 {
    let mut deviates = Deviates(3);
    let mut coloured = ColouredNoise::new(Time::default());
    let (mut truth, mut estimate, mut variance) = (0.0, 0.0, 0.25);
    let mut logarithms = 0.0;
    for fix in 0..FIXES {
        let true_noise = Markov::over(0.2, &CONFIGURED, factor * factor);
        truth = true_noise.decay * truth + true_noise.variance.sqrt() * f64::from(deviates.next());
        let assumed = Markov::over(0.2, &CONFIGURED, coloured.strength);
        estimate *= assumed.decay;
        variance = assumed.decay * assumed.decay * variance + assumed.variance;
        let gain = variance / (variance + 1.0);
        estimate += gain * (ins_error + truth + f64::from(deviates.next()) - estimate);
        variance *= 1.0 - gain;
        let now = Time::from_seconds(0.2 * (fix + 1) as f64).unwrap_or_default();
        let noise_state = Vector2::new(estimate, 0.0);
        coloured.learn_from_state(now, &noise_state, 1.0, variance, (&CONFIGURED, 1.0), RANGE);
        coloured.scale(1.0);
        if fix >= FIXES / 2 {
            logarithms += coloured.ratio.ln() / (FIXES / 2) as f64;
        }
    }
    logarithms.exp()
}

/// A memory of twenty correlation times: the variance is accurate to a quarter, its mean over ten such
/// times to a tenth; three sigmas of that, and the bias of a filter instead of a smoother.
#[test]
fn strength_from_state_converges_from_above_and_below() {
    for factor in [0.7, 1.0, 2.0, 5.0] {
        let ratio = strength_from_state(factor, 0.0) / (factor * factor);
        assert!((0.7..1.5).contains(&ratio), "{factor}: {ratio}");
    }
}

#[test]
fn absent_noise_is_estimated_as_small_from_state() {
    let strength = strength_from_state(0.0, 0.0);
    assert!((0.01..0.1).contains(&strength), "{strength}");
}

#[test]
fn strength_from_state_stays_within_the_configured_range() {
    let strongest = strength_from_state(20.0, 0.0);
    assert!((50.0..=100.0).contains(&strongest), "{strongest}");
}

/// Five times the noise: taken for noise it would be 25 times as strong.
#[test]
fn a_constant_ins_error_is_not_estimated_as_noise() {
    let strength = strength_from_state(1.0, 5.0);
    assert!((0.7..1.5).contains(&strength), "{strength}");
}

/// Mean square of the position errors in their variance over forty runs of half an hour: random walk of the INS of
/// 0.03 m/sqrt(s), as with velocity aiding, correlated position noise of `sigma` and `time_s`, white noise of 0.5 m.
fn normalized_position_error_squared(sigma: f64, time_s: f64) -> f64 {
    const CONFIGURED: Noise = Noise {
        white: 0.5,
        correlated: 1.0,
        correlation_s: 60.0,
    };
    const RUNS: u32 = 40;
    const WALK: f64 = 9e-4;
    let white = CONFIGURED.white * CONFIGURED.white;
    let (mut deviates, mut squares) = (Deviates(5), 0.0);
    for _ in 0..RUNS {
        let mut coloured = ColouredNoise::new(Time::default());
        let position_noise = Noise {
            correlated: sigma,
            correlation_s: time_s,
            ..CONFIGURED
        };
        // Position and correlated receiver error.
        let mut truth = Vector2::new(0.0, sigma * f64::from(deviates.next()));
        let mut estimate = Vector2::zeros();
        let mut covariance = Matrix2::from_diagonal(&Vector2::new(100.0, 1.0));
        let observation = Vector2::new(1.0, 1.0);
        for second in 1..=1800 {
            let true_noise = Markov::over(1.0, &position_noise, 1.0);
            truth.x += WALK.sqrt() * f64::from(deviates.next());
            truth.y = true_noise.decay * truth.y
                + true_noise.variance.sqrt() * f64::from(deviates.next());
            let time_ratio = coloured.time_ratio();
            let assumed = Markov::over(
                1.0 / time_ratio,
                &CONFIGURED,
                coloured.strength * time_ratio,
            );
            let decay = Matrix2::from_diagonal(&Vector2::new(1.0, assumed.decay));
            estimate = decay * estimate;
            covariance = decay * covariance * decay
                + Matrix2::from_diagonal(&Vector2::new(WALK, assumed.variance));
            let total = observation.dot(&(covariance * observation)) + white;
            let measured = observation.dot(&truth) + white.sqrt() * f64::from(deviates.next());
            let gain = covariance * observation / total;
            estimate += gain * (measured - observation.dot(&estimate));
            covariance -= gain * gain.transpose() * total;
            let now = Time::from_seconds(f64::from(second)).unwrap_or_default();
            let noise_state = Vector2::new(estimate.y, 0.0);
            let noise = (&CONFIGURED, time_ratio);
            coloured.learn_from_state(now, &noise_state, 1.0, covariance.m22, noise, RANGE);
            coloured.scale(1.0);
        }
        let error = estimate.x - truth.x;
        squares += error * error / covariance.m11 / f64::from(RUNS);
    }
    squares
}

/// The kinds are indistinguishable, so some variances are too small and some too large; the mean is accurate to a
/// tenth, as of 160 squares. With the strength estimated from the driving noise it is 1.5, and 3.5 for the slowest.
#[test]
fn position_variance_with_slow_correlated_noise_covers_the_error() {
    let kinds = [(0.5, 30.0), (0.5, 150.0), (1.0, 60.0), (1.0, 300.0)];
    let squares = kinds.map(|(sigma, time_s)| normalized_position_error_squared(sigma, time_s));
    let mean = squares.iter().sum::<f64>() / 4.0;
    let in_range = squares.iter().all(|square| *square < 3.0);
    assert!(
        (0.7..1.3).contains(&mean) && in_range,
        "{mean}: {squares:?}"
    );
}
