//! Consistency of the corrections of an estimate with the decrease of its variance.
#![allow(clippy::disallowed_methods)]

use crate::deviates::Deviates;
use crate::observer::consistency::Consistency;

/// RMS of error over sigma, and mean sigma, of 400 estimates of a value with a random walk of `walk` per second,
/// by an estimator that assumes a constant, from a measurement per second with unit noise over ten minutes;
/// `correlation` is that of successive measurements.
fn normalized_error_and_sigma(walk: f32, correlation: f32, checked: bool) -> (f32, f32) {
    let mut deviates = Deviates(7);
    let (mut squares, mut sigmas) = (0.0, 0.0);
    for _ in 0..400 {
        let (mut truth, mut estimate, mut variance, mut noise) = (0.0, 0.0, 100.0_f32, 0.0);
        let mut consistency = Consistency::NEW;
        for second in 0..600 {
            truth += walk * deviates.next();
            noise =
                correlation * noise + (1.0 - correlation * correlation).sqrt() * deviates.next();
            let gain = variance / (variance + 1.0);
            let correction = gain * (truth + noise - estimate);
            estimate += correction;
            variance *= 1.0 - gain;
            consistency.on_correction(correction);
            if checked && second % 5 == 4 {
                let added = consistency.check(variance);
                variance += added;
                consistency.on_walk(added);
            }
        }
        #[allow(clippy::cast_possible_truncation)]
        let stated = variance * consistency.inflation() as f32;
        squares += (estimate - truth) * (estimate - truth) / stated / 400.0;
        sigmas += stated.sqrt() / 400.0;
    }
    (squares.sqrt(), sigmas)
}

/// The RMS of 400 estimates is accurate to 4 %; four sigmas of that.
#[test]
fn a_constant_keeps_its_accuracy() {
    let (without_check, sigma_without_check) = normalized_error_and_sigma(0.0, 0.0, false);
    assert!((without_check - 1.0).abs() < 0.15, "{without_check}");
    let (with_check, sigma) = normalized_error_and_sigma(0.0, 0.0, true);
    assert!((with_check - 1.0).abs() < 0.15, "{with_check}");
    assert!(
        sigma < 1.05 * sigma_without_check,
        "{sigma} {sigma_without_check}"
    );
}

/// A correlation of 0.5 makes a mean worse by a factor of 1.7, of 0.8 by 3.
#[test]
fn coloured_noise_inflates_the_variance() {
    for (correlation, unchecked_error) in [(0.5, 1.5), (0.8, 2.5)] {
        let (without_check, _) = normalized_error_and_sigma(0.0, correlation, false);
        assert!(
            without_check > unchecked_error,
            "{correlation}: {without_check}"
        );
        let (with_check, _) = normalized_error_and_sigma(0.0, correlation, true);
        assert!(
            (0.7..1.6).contains(&with_check),
            "{correlation}: {with_check}"
        );
    }
}

/// An unmodelled walk shows late: it is tracked better than without the check, not as well as if modelled.
#[test]
fn variance_of_a_walking_value_is_raised() {
    for walk in [0.1, 0.3] {
        let (without_check, _) = normalized_error_and_sigma(walk, 0.0, false);
        let (with_check, sigma) = normalized_error_and_sigma(walk, 0.0, true);
        assert!(
            without_check > 20.0 && with_check < 0.3 * without_check,
            "{walk}: {without_check} {with_check}"
        );
        assert!(sigma < 20.0 * walk, "{walk}: {sigma}");
    }
}

/// While the variance is halved, small steps add up to a correction of some sigmas of the decrease.
#[test]
fn small_moves_in_one_direction_add_up() {
    let variance_added = |sigmas: f32| {
        let mut consistency = Consistency::NEW;
        let mut added = consistency.check(1.0);
        for step in 1..=50_u16 {
            consistency.on_correction(sigmas * 0.5_f32.sqrt() / 50.0);
            added += consistency.check(1.0 - f32::from(step) / 100.0);
        }
        added
    };
    assert!(variance_added(1.9) <= 0.0);
    assert!((variance_added(2.5) - 0.5 * (2.5 * 2.5 / 4.0 - 1.0)).abs() < 1e-3);
    assert!((variance_added(5.0) - 0.5).abs() < 1e-3);
}
