//! The ring of past moments: exact for a steadily changing acceleration, and honest at its ends.
#![allow(clippy::unwrap_used)]

use ins_core::Time;
use ins_core::earth::GRAVITY_EQUATOR_MPS2;
use ins_core::history::{History, Missing, Moment};
use nalgebra::{Matrix3, Vector3};

const ACCEL: Vector3<f64> = Vector3::new(1.5, -0.7, 0.2);
const JERK: Vector3<f64> = Vector3::new(-3.0, 2.0, 1.0);

fn velocity(t: f64) -> Vector3<f64> {
    t * ACCEL + 0.5 * t * t * JERK
}

/// A vehicle whose acceleration grows steadily; its totals are those of `t`.
fn moment(t: f64) -> Moment {
    let mut moment = Moment::start(Time::default().plus_seconds(t));
    moment.force_mps = velocity(t) + Vector3::z() * (t * GRAVITY_EQUATOR_MPS2);
    // `C` grows by this a second.
    moment.attitude_s = 0.5 * t * t * Matrix3::from_diagonal(&Vector3::new(1.0, 2.0, 3.0));
    moment.turn_rad = 0.4 * t;
    moment
}

fn filled(times: &[f64]) -> History {
    let mut history = History::default();
    for t in times {
        assert!(history.wants(Time::default().plus_seconds(*t)));
        history.push(moment(*t), velocity(*t));
    }
    history
}

#[test]
fn a_past_moment_is_exact_for_a_steady_jerk() {
    // Unequal steps, as samples come.
    let times = [0.0, 0.12, 0.25, 0.37, 0.5, 0.62];
    let history = filled(&times);
    for t in [0.12, 0.133, 0.25, 0.31, 0.449, 0.5, 0.62] {
        let past = history.at(Time::default().plus_seconds(t)).unwrap();
        assert!((past.velocity_mps - velocity(t)).norm() < 1e-12, "{t}");
        assert!((past.accel_mps2 - (ACCEL + t * JERK)).norm() < 1e-10, "{t}");
        let rate = past.attitude_rate.diagonal() - Vector3::new(1.0, 2.0, 3.0);
        assert!(rate.norm() < 1e-10, "{t}");
        assert!((past.moment.turn_rad - 0.4 * t).abs() < 1e-12, "{t}");
        assert_eq!(past.moment.time, Time::default().plus_seconds(t));
    }
}

#[test]
fn what_lies_outside_is_not_invented() {
    let at = |history: &History, t: f64| history.at(Time::default().plus_seconds(t));
    assert_eq!(at(&History::default(), 0.0), Err(Missing::Future));
    // The first interval has none before it.
    assert_eq!(at(&filled(&[0.0, 0.12]), 0.05), Err(Missing::TooOld));
    let times: Vec<f64> = (0..100).map(|k| f64::from(k) * 0.12).collect();
    let history = filled(&times);
    assert_eq!(at(&history, 11.89), Err(Missing::Future));
    assert!(at(&history, 11.87).is_ok());
    // Some half a second is kept.
    assert!(at(&history, 11.41).is_ok());
    assert_eq!(at(&history, 11.39), Err(Missing::TooOld));
    assert!(!history.wants(Time::default().plus_seconds(11.98)));
}
