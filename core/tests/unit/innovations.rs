//! Gate of the fixes, estimation of their noise, and detection of a diverged INS.
#![allow(clippy::cast_precision_loss)]
#![allow(clippy::disallowed_methods, clippy::panic)]

use crate::Time;
use crate::config::Noise;
use crate::innovations::{GateResult, Innovations, NisTest, Resets, ratio_to_configured};
use nalgebra::Vector2;

const RANGE: [f64; 2] = [0.1, 10.0];
/// Noise of the fixes, m/s, and variance of the INS.
const SIGMA: f64 = 0.1;
const PREDICTED: f64 = 0.05 * 0.05;

fn gate(innovations: &mut Innovations, at_s: f64, innovation: Vector2<f64>) -> GateResult {
    let now = Time::default().plus_seconds(at_s);
    innovations.gate(now, &innovation, 2.0, PREDICTED, SIGMA * SIGMA)
}

const WRONG: Vector2<f64> = Vector2::new(4.0, -3.0);

/// A burst of a second, as by multipath.
#[test]
fn a_burst_of_wrong_fixes_is_rejected() {
    let mut innovations = Innovations::default();
    for k in 0..10 {
        let at_s = 0.1 * f64::from(k);
        assert_eq!(
            gate(&mut innovations, at_s, WRONG),
            GateResult::Rejected,
            "{k}"
        );
    }
    let good = Vector2::new(0.1, -0.05);
    assert_eq!(
        gate(&mut innovations, 1.0, good),
        GateResult::Accepted(SIGMA * SIGMA)
    );
    // An accepted fix ends the burst: another one has to last as long.
    for k in 0..149 {
        let at_s = 1.1 + 0.1 * f64::from(k);
        assert_eq!(
            gate(&mut innovations, at_s, WRONG),
            GateResult::Rejected,
            "{k}"
        );
    }
}

#[test]
fn fixes_consistent_for_15_s_indicate_divergence() {
    for interval_s in [0.1, 1.0] {
        let mut innovations = Innovations::default();
        let (mut at_s, mut count) = (0.0, 0);
        let result = loop {
            // Consistent within noise.
            let sign = if at_s % (2.0 * interval_s) < interval_s {
                1.0
            } else {
                -1.0
            };
            // One of five is an additional outlier.
            count += 1;
            let outlier = if count % 5 == 3 {
                3.0 * sign
            } else {
                0.1 * sign
            };
            match gate(&mut innovations, at_s, WRONG + Vector2::repeat(outlier)) {
                GateResult::Rejected => at_s += interval_s,
                other => break other,
            }
            assert!(at_s < 30.0);
        };
        assert!((at_s - 15.0).abs() <= interval_s, "{at_s}");
        let GateResult::Diverged(error) = result else {
            panic!("{result:?}")
        };
        assert!((error - WRONG).norm() < 0.1 * WRONG.norm(), "{error}");
        // The next burst starts from zero.
        assert_eq!(
            gate(&mut innovations, at_s + 0.1, WRONG),
            GateResult::Rejected
        );
    }
}

/// A tilted INS diverges from all fixes: between two by more than noise explains.
#[test]
fn a_growing_innovation_indicates_divergence() {
    let mut innovations = Innovations::default();
    for k in 0..150 {
        let at_s = 0.1 * f64::from(k);
        let result = gate(&mut innovations, at_s, WRONG * (1.0 + at_s));
        assert_eq!(result, GateResult::Rejected, "{k}");
    }
    let now = Time::default().plus_seconds(14.9);
    let [offset_mps, rate_mps2] = innovations.rejected_offset(now);
    assert_eq!(offset_mps, WRONG * 15.9);
    assert_eq!(rate_mps2, offset_mps * (2.0 / 14.9));
    let result = gate(&mut innovations, 15.1, WRONG * 16.1);
    assert!(matches!(result, GateResult::Diverged(_)), "{result:?}");
}

#[test]
fn inconsistent_wrong_fixes_do_not_indicate_divergence() {
    let mut innovations = Innovations::default();
    for k in 0..1000 {
        let angle = 0.7 * f64::from(k);
        let outlier = 5.0 * Vector2::new(angle.cos(), angle.sin());
        let result = gate(&mut innovations, 0.1 * f64::from(k), outlier);
        assert_eq!(result, GateResult::Rejected, "{k}");
    }
}

/// Huber weights: the correction is that of three sigmas at most.
#[test]
fn large_innovations_are_limited_to_three_sigmas() {
    let total = 2.0 * (PREDICTED + SIGMA * SIGMA);
    let mut innovations = Innovations::default();
    for sigmas in [0.5, 2.9] {
        let size = sigmas * f64::sqrt(total);
        let result = gate(&mut innovations, 0.0, Vector2::new(size, 0.0));
        assert_eq!(result, GateResult::Accepted(SIGMA * SIGMA));
    }
    for sigmas in [4.0, 7.9] {
        let size = sigmas * f64::sqrt(total);
        let result = gate(&mut innovations, 0.0, Vector2::new(0.0, size));
        let GateResult::Accepted(white) = result else {
            panic!("{result:?}")
        };
        assert!((white / (SIGMA * sigmas / 3.0).powi(2) - 1.0).abs() < 1e-12);
    }
    let refused = gate(
        &mut innovations,
        0.0,
        Vector2::new(8.1 * f64::sqrt(total), 0.0),
    );
    assert_eq!(refused, GateResult::Rejected);
}

/// Approximately normal numbers of unit variance: sums of three uniform ones.
fn noise(count: usize) -> impl Iterator<Item = Vector2<f64>> {
    let mut state = 1_u64;
    let mut uniform = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut normal = move || 2.0 * (uniform() + uniform() + uniform() - 1.5);
    (0..count).map(move |_| Vector2::new(normal(), normal()))
}

#[test]
fn noise_scale_is_learnt_within_its_range() {
    for (true_scale, learnt) in [
        (1.0, 1.0),
        (9.0, 9.0),
        (0.25, 0.25),
        (1e4, 100.0),
        (1e-4, 0.01),
    ] {
        let mut innovations = Innovations::default();
        let mut mean = 0.0;
        for (k, sigmas) in noise(20_000).enumerate() {
            let square = true_scale / innovations.scale * sigmas.norm_squared() / 2.0;
            innovations.learn(square, 1.0, &sigmas, RANGE);
            if k >= 4000 {
                mean += innovations.scale / 16_000.0;
            }
        }
        // With a memory of 400 pairs it scatters by a twentieth; squares are limited to nine.
        assert!((mean / learnt - 1.0).abs() < 0.03, "{true_scale}: {mean}");
        // White noise has no correlation.
        assert!(innovations.inflation() < 1.3, "{}", innovations.inflation());
    }
}

/// If three quarters of the variance are due to the INS, learning takes sixteen times as long, and the result is
/// still that of the noise alone.
#[test]
fn an_uncertain_ins_slows_noise_learning() {
    let mut innovations = Innovations::default();
    for (k, sigmas) in noise(20_000).enumerate() {
        let total = 3.0 + innovations.scale;
        let square = (3.0 + 0.25) / total * sigmas.norm_squared() / 2.0;
        innovations.learn(square, innovations.scale / total, &sigmas, RANGE);
        if k == 100 {
            assert!(innovations.scale > 0.6, "{}", innovations.scale);
        }
    }
    assert!(
        (0.1..0.5).contains(&innovations.scale),
        "{}",
        innovations.scale
    );
}

#[test]
fn correlation_is_estimated() {
    // First-order Markov with 0.6 and unit variance.
    let mut innovations = Innovations::default();
    let mut coloured = Vector2::zeros();
    for new in noise(5000) {
        coloured = 0.6 * coloured + 0.8 * new;
        innovations.learn(coloured.norm_squared() / 2.0, 1.0, &coloured, RANGE);
    }
    // The variance of a mean is (1 + 0.6) / (1 - 0.6) times that of white numbers; 200 pairs give 0.6 to
    // within 0.06.
    let inflation = innovations.inflation();
    assert!((2.8..5.6).contains(&inflation), "{inflation}");
}

#[test]
fn one_outlier_hardly_changes_the_noise_scale() {
    let mut innovations = Innovations::default();
    innovations.learn(1e12, 1.0, &Vector2::repeat(1e6), RANGE);
    assert!(innovations.scale < 1.3, "{}", innovations.scale);
    assert!(innovations.inflation().is_finite());
}

#[test]
fn stated_sigmas_are_relative_to_their_average_or_to_the_configuration() {
    let mut stated = Innovations::default();
    for _ in 0..100 {
        assert!((stated.ratio_to_average(0.4 * 0.4) - 1.0).abs() < 1e-12);
    }
    assert!((stated.ratio_to_average(1.2 * 1.2) - 9.0).abs() < 1e-9);
    assert!((stated.ratio_to_average(1e18) - 100.0).abs() < 1e-9);
    let noise = Noise {
        white: 3.0,
        correlated: 4.0,
        correlation_s: 60.0,
    };
    let [least, _] = RANGE;
    assert!((ratio_to_configured(100.0, &noise, least) - 4.0).abs() < 1e-12);
    assert!((ratio_to_configured(1e10, &noise, least) - 4e8).abs() < 1e-3);
    assert!((ratio_to_configured(0.0, &noise, least) - 0.01).abs() < 1e-12);
}

#[test]
fn repeated_resets_exceed_the_limit() {
    let mut resets = Resets::default();
    for at_s in [0.0, 50.0, 120.0, 170.0] {
        resets.add(Time::default().plus_seconds(at_s));
        assert!(!resets.is_exceeded(), "{at_s}");
    }
    resets.add(Time::default().plus_seconds(220.0));
    assert!(resets.is_exceeded());
}

/// Nor does a corrected jump.
#[test]
fn old_resets_do_not_count() {
    let mut resets = Resets::default();
    for at_s in [0.0, 50.0] {
        resets.add(Time::default().plus_seconds(at_s));
    }
    resets.note(Time::default().plus_seconds(600.0));
    resets.add(Time::default().plus_seconds(630.0));
    assert!(!resets.is_exceeded());
}

#[test]
fn nis_test_requires_a_lasting_excess() {
    let mut nis = NisTest::default();
    for _ in 0..600 {
        nis.add(2.0, 0.1);
    }
    assert!(nis.exceeded_s <= 0.0);
    for k in 0..200 {
        nis.add(25.0, 0.1);
        assert!(nis.exceeded_s <= 0.1 * f64::from(k + 1) + 1e-9);
    }
    // From a mean of 2 to one of 9, of 25: 10 s ln(23 / 16), 3.6 s.
    assert!((nis.exceeded_s - 16.4).abs() < 0.3, "{}", nis.exceeded_s);
    for _ in 0..100 {
        nis.add(1.0, 0.1);
    }
    assert!(nis.exceeded_s <= 0.0);
}
