//! A lever arm learnt from the steps of a walker through a receiver that smooths, against the variance stated.
#![allow(clippy::disallowed_methods)]

use core::f64::consts::TAU;

use nalgebra::Vector3;

use super::{SkewedArm, skew_mps};
use crate::math::{single, singles};
use crate::parameters::{COUNT, index};

const STEPS: f64 = TAU;
const SWAY_MPS: f64 = 0.1;
const YAW_RADPS: f64 = 0.3;
/// Ten fixes a second, out of step with the walk, for a quarter of an hour.
const FIX_S: f64 = 0.1007;
const FIXES: u32 = 9000;

/// Error of the arm by which the receiver's lag is left unexplained, m, and the sigma stated for it, with
/// a first-order low pass of this time constant, its mean lag and its variance known, or unknown by as much.
fn arm_error_and_sigma(memory_s: f64, known: bool) -> (f64, f64) {
    let s2 = memory_s * memory_s;
    let (smoothing_s2, sigma_s2) = if known { (s2, 0.0) } else { (0.0, s2) };
    let (phase, mut arm) = (STEPS * memory_s, SkewedArm::default());
    let (mut product, mut square) = (0.0, 0.0);
    for fix in 0..FIXES {
        let (sin, cos) = (STEPS * FIX_S * f64::from(fix)).sin_cos();
        // Sway to the right, and a turn a quarter of a period behind: forward motion of the antenna is that
        // of an arm to the right.
        let accel = Vector3::new(SWAY_MPS * STEPS * cos, 0.0, 0.0);
        let snap = -STEPS * STEPS * accel;
        let effect = -YAW_RADPS * cos;
        let mut partials = [[0.0; 2]; COUNT];
        partials[index::LEVER_ARM + 1] = [single(effect), 0.0];
        arm.add(
            &partials,
            &singles(&skew_mps(&accel, &snap, smoothing_s2, sigma_s2)),
        );
        // What the low pass shows later than by its mean lag.
        let left = SWAY_MPS * (sin - lagging(phase, sin, cos));
        product += effect * left;
        square += effect * effect;
    }
    (product / square, f64::from(arm.variances()[1]).sqrt())
}

/// Sine of a swing, low-passed and advanced by the mean lag.
fn lagging(phase: f64, sin: f64, cos: f64) -> f64 {
    let (ahead_sin, ahead_cos) = (phase - phase.atan()).sin_cos();
    (sin * ahead_cos + cos * ahead_sin) / phase.hypot(1.0)
}

#[test]
fn an_arm_learnt_from_steps_is_no_surer_than_the_smoothing_lets_it() {
    for known in [true, false] {
        for memory_s in [0.03, 0.1, 0.2, 0.45] {
            let (error_m, sigma_m) = arm_error_and_sigma(memory_s, known);
            let ratio = error_m.abs() / sigma_m;
            // Equal for a short smoothing; of a long one the series sees more than there is.
            assert!(
                ratio > 0.1 && ratio < 1.05,
                "{memory_s}: {error_m} {sigma_m}"
            );
            assert!(memory_s > 0.05 || ratio > 0.95, "{error_m} {sigma_m}");
        }
    }
}

#[test]
fn what_shows_no_arm_costs_none() {
    let unseen = SkewedArm::default().variances();
    assert!(unseen.iter().all(|variance| *variance <= 0.0), "{unseen:?}");
    let (_, sigma_m) = arm_error_and_sigma(0.0, true);
    assert!(sigma_m <= 0.0, "{sigma_m}");
}

#[test]
fn what_a_tape_has_measured_is_not_doubted() {
    let mut arm = SkewedArm::known(&Vector3::repeat(0.01), 0.05);
    let mut partials = [[0.0; 2]; COUNT];
    partials[index::LEVER_ARM] = [0.1, 0.0];
    // A hundred fixes, which show the arm to 5 cm and are wrong by 0.2 m: what they have of the mean.
    for _ in 0..100 {
        arm.add(&partials, &Vector3::new(0.02, 0.0, 0.0));
    }
    let off_m = f64::from(arm.variances()[0]).sqrt();
    let share = 0.01_f64.powi(2) / (0.01_f64.powi(2) + 0.05_f64.powi(2));
    assert!((off_m / (0.2 * share) - 1.0).abs() < 1e-4, "{off_m}");
}
