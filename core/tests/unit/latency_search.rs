//! A latency a step off is found from a walk, a right one is confirmed, and noise finds nothing.
#![allow(clippy::cast_precision_loss)]
#![allow(clippy::disallowed_methods)] // Reference values.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::{Found, LatencySearch, MOST, STEP_S};
use crate::config::Config;
use crate::deviates::Deviates;
use crate::earth::GRAVITY_EQUATOR_MPS2;
use crate::history::{History, SPACING_S, Span, Vibration};
use crate::samples::GnssFix;
use crate::time::Time;

/// Two steps a second, of a unit that rolls with them under a pole.
const STEPS_RADPS: f64 = 12.0;
const PERIOD_S: f64 = core::f64::consts::TAU / STEPS_RADPS;
const POLE_M: Vector3<f64> = Vector3::new(0.0, 0.0, 1.8);
const HEAVE_MPS: f64 = 0.15;
const LATENCY_S: f64 = 0.2;
const NOISE_MPS: f64 = 0.03;
/// Interval of fixes, s, and steps of work for an entry of the ring.
const FIX_S: f64 = 0.2;
const WORK: u32 = 10;

struct Walk {
    /// Amplitude of the roll, rad, and speed in the bends, m/s.
    roll_rad: f64,
    bends_mps: f64,
}

impl Walk {
    fn roll_rad(&self, t: f64) -> f64 {
        self.roll_rad * (STEPS_RADPS * t).sin()
    }

    fn attitude(&self, t: f64) -> Matrix3<f64> {
        Rotation3::from_axis_angle(&Vector3::y_axis(), self.roll_rad(t)).into_inner()
    }

    /// Bends, of no common period, and the heave of the steps.
    fn velocity_mps(&self, t: f64) -> Vector3<f64> {
        Vector3::new(
            self.bends_mps * (0.53 * t).sin(),
            2.0 + self.bends_mps * (0.37 * t).sin(),
            HEAVE_MPS * (STEPS_RADPS * t).sin(),
        )
    }

    fn span(&self, from: f64) -> Span {
        // Simpson's rule.
        let mean = |of: &dyn Fn(f64) -> Matrix3<f64>| {
            let middle = from + 0.5 * SPACING_S;
            (of(from) + 4.0 * of(middle) + of(from + SPACING_S)) / 6.0
        };
        let to = from + SPACING_S;
        let gained = self.velocity_mps(to) - self.velocity_mps(from);
        let lift = Vector3::z() * (SPACING_S * GRAVITY_EQUATOR_MPS2);
        Span {
            seconds: SPACING_S,
            force_mps: gained + lift,
            attitude_s: SPACING_S * mean(&|t| self.attitude(t)),
            angle_rad: Vector3::y() * (self.roll_rad(to) - self.roll_rad(from)),
            way_m: self.velocity_mps(from + 0.5 * SPACING_S) * SPACING_S,
            ..Span::default()
        }
    }

    /// Velocity of the antenna, by a difference over a millisecond.
    fn antenna_mps(&self, t: f64) -> Vector3<f64> {
        let swung = (self.attitude(t + 5e-4) - self.attitude(t - 5e-4)) * POLE_M / 1e-3;
        self.velocity_mps(t) + swung
    }

    /// What is found in ten minutes at most, and the search after it.
    fn search(&self, believed_s: f64, seed: u64) -> (Option<Found>, LatencySearch) {
        let mut history = History::<24>::default();
        let (mut search, mut noise) = (LatencySearch::EMPTY, Deviates(seed));
        let mut next_fix_s = 0.0;
        for entry in 0..6000 {
            let t = f64::from(entry) * SPACING_S;
            let span = self.span(t - SPACING_S);
            let mean_mps = span.way_m / SPACING_S;
            history.push(
                Time::default().plus_seconds(t),
                &mean_mps,
                &span,
                &Vibration::default(),
            );
            if t >= next_fix_s {
                let seen = self.antenna_mps(next_fix_s - LATENCY_S);
                let mut noisy = || NOISE_MPS * f64::from(noise.next());
                let fix = GnssFix {
                    time: Time::default().plus_seconds(next_fix_s),
                    velocity_en_mps: Some(seen.xy().map(|seen| seen + noisy())),
                    ..GnssFix::default()
                };
                search.on_fix(&fix, &history, &Config::mems());
                next_fix_s += FIX_S;
            }
            for _ in 0..WORK {
                let found = search.work(&history, believed_s);
                if found.is_some() {
                    return (found, search);
                }
            }
        }
        (None, search)
    }
}

const WALK: Walk = Walk {
    roll_rad: 0.1,
    bends_mps: 0.6,
};

#[test]
fn a_latency_a_step_off_is_found_with_the_arm() {
    for off_s in [-PERIOD_S, -0.5 * PERIOD_S, 0.5 * PERIOD_S, PERIOD_S] {
        let (found, _) = WALK.search(LATENCY_S + off_s, 1);
        // A latency off by half of what is tried turns a swing by 0.5 rad.
        let is_right = found.is_some_and(|found| {
            (found.latency_s - LATENCY_S).abs() < STEP_S
                && (found.arm_m.z - POLE_M.z).abs() < 0.2 * POLE_M.z
        });
        assert!(is_right, "{off_s} {found:?}");
    }
}

#[test]
fn a_right_latency_is_confirmed_and_the_search_ends() {
    let (found, search) = WALK.search(LATENCY_S, 2);
    assert_eq!(found, None);
    assert_eq!(search.probes, MOST);
    assert_eq!(search.probe, None);
}

/// Steps that show nothing: the best latency is as much better than the others as noise has it.
#[test]
fn noise_finds_no_latency() {
    const STRAIGHT: Walk = Walk {
        roll_rad: 0.0,
        bends_mps: 0.0,
    };
    for seed in 0..10 {
        let (found, search) = STRAIGHT.search(LATENCY_S, seed);
        assert_eq!(found, None, "{seed}");
        assert!(search.probes > 100 && search.convincing < 1, "{seed}");
    }
}
