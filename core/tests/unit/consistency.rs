//! An estimate whose moves are held against what it has become known by.
#![allow(clippy::disallowed_methods)]

use crate::deviates::Deviates;
use crate::observer::consistency::Consistency;

/// Mean square of error over sigma, and mean sigma, of 400 estimates of a value that walks by
/// `walk` a second, from a measurement a second with white noise of one for ten minutes, by an
/// estimator that takes the value for a constant; `correlation` is what a measurement keeps of the noise
/// of the last.
fn honesty(walk: f32, correlation: f32, looks: bool) -> (f32, f32) {
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
            let move_by = gain * (truth + noise - estimate);
            estimate += move_by;
            variance *= 1.0 - gain;
            consistency.on_correction(move_by);
            if looks && second % 5 == 4 {
                let more = consistency.check(variance);
                variance += more;
                consistency.on_walk(more);
            }
        }
        #[allow(clippy::cast_possible_truncation)]
        let stated = variance * consistency.inflation() as f32;
        squares += (estimate - truth) * (estimate - truth) / stated / 400.0;
        sigmas += stated.sqrt() / 400.0;
    }
    (squares.sqrt(), sigmas)
}

/// Of 400 estimates the root mean square is good to 4 %; four sigmas of that.
#[test]
fn what_is_a_constant_is_known_as_well_as_before() {
    let (alone, sigma_alone) = honesty(0.0, 0.0, false);
    assert!((alone - 1.0).abs() < 0.15, "{alone}");
    let (watched, sigma) = honesty(0.0, 0.0, true);
    assert!((watched - 1.0).abs() < 0.15, "{watched}");
    assert!(sigma < 1.05 * sigma_alone, "{sigma} {sigma_alone}");
}

/// Neighbours that are alike by half make a mean of many worse by 1.7, by 0.8 by 3.
#[test]
fn what_coloured_noise_tells_is_worth_less() {
    for (correlation, off) in [(0.5, 1.5), (0.8, 2.5)] {
        let (alone, _) = honesty(0.0, correlation, false);
        assert!(alone > off, "{correlation}: {alone}");
        let (watched, _) = honesty(0.0, correlation, true);
        assert!((0.7..1.6).contains(&watched), "{correlation}: {watched}");
    }
}

/// A walk that no one has told of shows only late: it is followed better, not as well as one that is
/// known.
#[test]
fn what_walks_is_let_go() {
    for walk in [0.1, 0.3] {
        let (alone, _) = honesty(walk, 0.0, false);
        let (watched, sigma) = honesty(walk, 0.0, true);
        assert!(
            alone > 20.0 && watched < 0.3 * alone,
            "{walk}: {alone} {watched}"
        );
        assert!(sigma < 20.0 * walk, "{walk}: {sigma}");
    }
}

/// A variance that halves is as much as was learnt: a move of three sigmas of that shows, in steps
/// that are each less than a sigma of what a step tells.
#[test]
fn small_moves_in_one_direction_add_up() {
    let given_back = |sigmas: f32| {
        let mut consistency = Consistency::NEW;
        let mut given = consistency.check(1.0);
        for step in 1..=50_u16 {
            consistency.on_correction(sigmas * 0.5_f32.sqrt() / 50.0);
            given += consistency.check(1.0 - f32::from(step) / 100.0);
        }
        given
    };
    assert!(given_back(1.9) <= 0.0);
    assert!((given_back(2.5) - 0.5 * (2.5 * 2.5 / 4.0 - 1.0)).abs() < 1e-3);
    assert!((given_back(5.0) - 0.5).abs() < 1e-3);
}
