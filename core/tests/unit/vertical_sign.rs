//! Sign of vertical velocity from climbs and descents with noisy heights, and from accelerometers.
#![allow(clippy::disallowed_methods)]

use proptest::prelude::*;

use super::{AVERAGING_S, VerticalSign, sign_variance};
use crate::{Config, GnssFix, Time};

/// State after a minute of climbing at `climb_mps`, measured with a sign, and the variance added to the last fix.
fn after_a_minute(
    climb_mps: f64,
    sign: f64,
    height_noise_m: &[f64],
) -> (VerticalSign, Option<f64>) {
    let mut variance = None;
    let mut state = VerticalSign::default();
    for (k, noise_m) in (0_u32..).zip(height_noise_m) {
        let at_s = f64::from(k) * 0.2;
        let fix = GnssFix {
            time: Time::default().plus_seconds(at_s),
            height_m: Some(100.0 + climb_mps * at_s + noise_m),
            velocity_up_mps: Some(sign * climb_mps),
            ..GnssFix::default()
        };
        variance = state.take(&fix, &Config::mems());
    }
    (state, variance)
}

proptest! {
    /// Height noise as of the preset; climbs of 3 m/s and more for a minute.
    #[test]
    fn a_climb_determines_the_sign(
        climb in prop_oneof![-8.0..-3.0, 3.0..8.0],
        noise in prop::collection::vec(-5.0..5.0, 300),
    ) {
        prop_assert_eq!(after_a_minute(climb, 1.0, &noise).1, Some(0.0));
        prop_assert_eq!(after_a_minute(climb, -1.0, &noise).1, None);
    }

    /// One height in twenty is off by 30 m or more.
    #[test]
    fn wrong_heights_do_not_invert_the_sign(
        climb in prop_oneof![-3.0..-0.3, 0.3..3.0],
        noise in prop::collection::vec(-5.0..5.0, 300),
        wrong in prop::collection::vec((0..300_usize, -100.0..100.0_f64), 15),
    ) {
        let mut heights = noise;
        for (which, by) in wrong {
            if let Some(height) = heights.get_mut(which) {
                *height += by + 30.0 * by.signum();
            }
        }
        prop_assert!(!after_a_minute(climb, 1.0, &heights).0.is_wrong());
    }

    /// A walker's heave, ten fixes a second without height: accelerations decide.
    #[test]
    fn accelerometers_determine_the_sign(
        noise in prop::collection::vec(-0.1..0.1, 60),
        sign in prop_oneof![Just(1.0), Just(-1.0)],
    ) {
        let mut state = VerticalSign::default();
        let mut last = [0.0; 2];
        for (k, noise_mps) in (0_u32..).zip(&noise) {
            let up_mps = 0.3 * (f64::from(k) * 1.3).sin();
            let now = [sign * up_mps + noise_mps, up_mps];
            let [change_mps, accel_change_mps] = [now[0] - last[0], now[1] - last[1]];
            state.test_accel(change_mps, accel_change_mps, 0.02, 1e-4);
            last = now;
        }
        let fix = GnssFix {
            velocity_up_mps: Some(last[0]),
            ..GnssFix::default()
        };
        let expected = (sign > 0.0).then_some(0.0);
        prop_assert_eq!(state.take(&fix, &Config::mems()), expected);
    }

    /// The added variance stays as before: half the velocity over a manoeuvre of ten seconds, not per fix.
    #[test]
    fn level_motion_decides_nothing(noise in prop::collection::vec(-5.0..5.0, 300)) {
        for sign in [1.0, -1.0] {
            let (_, variance) = after_a_minute(0.01, sign, &noise);
            let per_manoeuvre = variance.map(|variance| variance / (10.0 / AVERAGING_S));
            let half = 0.4 * 0.01..0.6 * 0.01;
            prop_assert!(per_manoeuvre.is_some_and(|square| half.contains(&square.sqrt())), "{variance:?}");
        }
    }
}

/// Wrong in one receiver of twenty: a sign of mean 0.9 and variance 0.19 gives a relative error of `sqrt(0.19) / 0.9`.
#[test]
fn variance_of_an_unknown_sign_is_half_the_velocity() {
    for height_m in [Some(100.0), None] {
        let fix = GnssFix {
            height_m,
            velocity_up_mps: Some(-5.0),
            ..GnssFix::default()
        };
        let variance = VerticalSign::default().take(&fix, &Config::mems());
        assert_eq!(variance, Some(sign_variance(-5.0)));
        let ratio = variance.unwrap_or_default().sqrt() / 5.0;
        assert!((ratio - 0.19_f64.sqrt() / 0.9).abs() < 0.02, "{ratio}");
    }
}

/// The sigma is larger than the change.
#[test]
fn uncertain_accelerations_decide_nothing() {
    let mut state = VerticalSign::default();
    for _ in 0..1000 {
        state.test_accel(-0.2, 0.2, 0.02, 0.01);
    }
    assert!(!state.is_known());
}
