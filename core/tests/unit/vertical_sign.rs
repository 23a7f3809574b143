//! Climbs and descents with noisy heights: the sign is found, and none is found where there is none.
#![allow(clippy::disallowed_methods)]

use proptest::prelude::*;

use super::{AVERAGING_S, VerticalSign, sign_variance};
use crate::{Config, GnssFix, Time};

/// A minute of climbing at `climb_mps`, stated with a sign; and what becomes of the last fix.
fn after_a_minute(
    climb_mps: f64,
    sign: f64,
    height_noise_m: &[f64],
) -> (VerticalSign, Option<f64>) {
    let mut verdict = None;
    let mut state = VerticalSign::default();
    for (k, noise_m) in (0_u32..).zip(height_noise_m) {
        let at_s = f64::from(k) * 0.2;
        let fix = GnssFix {
            time: Time::default().plus_seconds(at_s),
            height_m: Some(100.0 + climb_mps * at_s + noise_m),
            velocity_up_mps: Some(sign * climb_mps),
            ..GnssFix::default()
        };
        verdict = state.take(&fix, &Config::mems());
    }
    (state, verdict)
}

proptest! {
    /// Height noise of 3 m is that of the preset; a climb of 3 m/s is plain within a minute.
    #[test]
    fn a_climb_shows_the_sign(
        climb in prop_oneof![-8.0..-3.0, 3.0..8.0],
        noise in prop::collection::vec(-5.0..5.0, 300),
    ) {
        prop_assert_eq!(after_a_minute(climb, 1.0, &noise).1, Some(0.0));
        prop_assert_eq!(after_a_minute(climb, -1.0, &noise).1, None);
    }

    /// Heights that are 30 m and more off, one of twenty, do not turn it around.
    #[test]
    fn wrong_heights_do_not_turn_a_sign_around(
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

    /// A walker's heave, ten fixes a second and no height: what is felt decides.
    #[test]
    fn accelerometers_tell_which_way_is_up(
        noise in prop::collection::vec(-0.1..0.1, 60),
        sign in prop_oneof![Just(1.0), Just(-1.0)],
    ) {
        let mut state = VerticalSign::default();
        let mut last = [0.0; 2];
        for (k, noise_mps) in (0_u32..).zip(&noise) {
            let up_mps = 0.3 * (f64::from(k) * 1.3).sin();
            let now = [sign * up_mps + noise_mps, up_mps];
            let [change_mps, felt_mps] = [now[0] - last[0], now[1] - last[1]];
            state.test_accel(change_mps, felt_mps, 0.02, 1e-4);
            last = now;
        }
        let fix = GnssFix {
            velocity_up_mps: Some(last[0]),
            ..GnssFix::default()
        };
        let expected = (sign > 0.0).then_some(0.0);
        prop_assert_eq!(state.take(&fix, &Config::mems()), expected);
    }

    /// On the level nothing is decided, and what is measured counts as before: a climb for half of itself in
    /// the ten seconds of a manoeuvre, and not for less with each fix.
    #[test]
    fn no_climb_shows_nothing(noise in prop::collection::vec(-5.0..5.0, 300)) {
        for sign in [1.0, -1.0] {
            let (_, variance) = after_a_minute(0.01, sign, &noise);
            let of_manoeuvre = variance.map(|variance| variance / (10.0 / AVERAGING_S));
            let half = 0.4 * 0.01..0.6 * 0.01;
            prop_assert!(of_manoeuvre.is_some_and(|square| half.contains(&square.sqrt())), "{variance:?}");
        }
    }
}

/// One of twenty: `s v` with a sign `s` of mean 0.9 and variance 0.19 tells `v` to `sqrt(0.19) / 0.9` of it.
#[test]
fn until_it_is_known_a_velocity_counts_for_less_by_half_of_itself() {
    for height_m in [Some(100.0), None] {
        let fix = GnssFix {
            height_m,
            velocity_up_mps: Some(-5.0),
            ..GnssFix::default()
        };
        let variance = VerticalSign::default().take(&fix, &Config::mems());
        assert_eq!(variance, Some(sign_variance(-5.0)));
        let part = variance.unwrap_or_default().sqrt() / 5.0;
        assert!((part - 0.19_f64.sqrt() / 0.9).abs() < 0.02, "{part}");
    }
}

/// What is felt less surely than it moves decides nothing.
#[test]
fn what_is_not_felt_for_sure_tells_nothing() {
    let mut state = VerticalSign::default();
    for _ in 0..1000 {
        state.test_accel(-0.2, 0.2, 0.02, 0.01);
    }
    assert!(!state.is_known());
}
