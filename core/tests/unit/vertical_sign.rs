//! Climbs and descents with noisy heights: the sign is found, and none is found where there is none.
#![allow(clippy::disallowed_methods)]

use proptest::prelude::*;

use super::VerticalSign;
use crate::{Config, GnssFix, Time};

/// What becomes of the last fix of a minute of climbing at `climb_mps`, stated with a sign.
fn after_a_minute(climb_mps: f64, sign: f64, height_noise_m: &[f64]) -> Option<f64> {
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
    verdict
}

proptest! {
    /// Height noise of 3 m is that of the preset; a climb of 3 m/s is plain within a minute.
    #[test]
    fn a_climb_shows_the_sign(
        climb in prop_oneof![-8.0..-3.0, 3.0..8.0],
        noise in prop::collection::vec(-5.0..5.0, 300),
    ) {
        prop_assert_eq!(after_a_minute(climb, 1.0, &noise), Some(0.0));
        prop_assert_eq!(after_a_minute(climb, -1.0, &noise), None);
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
        prop_assert!(after_a_minute(climb, 1.0, &heights).is_some());
    }

    /// On the level nothing is decided, and what is measured counts as before.
    #[test]
    fn no_climb_shows_nothing(noise in prop::collection::vec(-5.0..5.0, 300)) {
        prop_assert_eq!(after_a_minute(0.01, 1.0, &noise), Some(0.0));
        prop_assert_eq!(after_a_minute(0.01, -1.0, &noise), Some(0.0));
    }
}

#[test]
fn until_it_is_known_the_velocity_counts_for_less_than_twice_itself() {
    let mut state = VerticalSign::default();
    let fix = GnssFix {
        height_m: Some(100.0),
        velocity_up_mps: Some(-5.0),
        ..GnssFix::default()
    };
    let variance = state.take(&fix, &Config::mems()).unwrap_or_default();
    assert!((8.0..=10.0).contains(&variance.sqrt()), "{variance}");
    // Without heights there is nothing to hold it against.
    let alone = GnssFix {
        height_m: None,
        ..fix
    };
    assert_eq!(
        VerticalSign::default().take(&alone, &Config::mems()),
        Some(0.0)
    );
}
