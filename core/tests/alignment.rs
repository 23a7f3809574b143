//! Alignment from motion: heading, tilt and latency at hand-over are within their stated sigmas.
#![allow(clippy::cast_precision_loss)]
#![allow(clippy::disallowed_methods, clippy::unwrap_used, clippy::expect_used)] // Reference values.

use std::f64::consts::{PI, TAU};

use ins_core::attitude::{Euler, from_euler, matrix};
use ins_core::config::HeadingSource;
use ins_core::earth::Geodetic;
use ins_core::{Config, GnssFix, ImuSample, Navigator, Phase, Time};
use nalgebra::{UnitQuaternion, Vector2, Vector3};

const GRAVITY_MPS2: f64 = 9.8;
const STEP_S: f64 = 0.01;

/// Heading and speed of a vehicle on the ground, with their derivatives, at a time.
type Drive = fn(f64) -> (f64, f64, f64, f64);

/// Ten seconds at rest, a start northward, then bends and changes of speed.
fn from_rest(time_s: f64) -> (f64, f64, f64, f64) {
    let t = (time_s - 10.0).max(0.0);
    if t < 6.0 {
        let speed = 5.0 * (t / 6.0 - (TAU * t / 6.0).sin() / TAU);
        return (
            0.0,
            0.0,
            2.0 * speed,
            5.0 / 3.0 * (1.0 - (TAU * t / 6.0).cos()),
        );
    }
    bends(t - 6.0)
}

/// In motion from the beginning.
fn bends(t: f64) -> (f64, f64, f64, f64) {
    let heading = 0.6 * (1.0 - (0.35 * t).cos());
    let rate = 0.6 * 0.35 * (0.35 * t).sin();
    let speed = 10.0 + 3.0 * (0.25 * t).sin();
    (heading, rate, speed, 0.75 * (0.25 * t).cos())
}

struct Simulation {
    drive: Drive,
    mount: UnitQuaternion<f64>,
    gyro_bias_radps: Vector3<f64>,
    latency_s: f64,
    arrival_s: f64,
    fix_s: f64,
    velocity: bool,
    /// Time stamps of wrong velocities, s.
    wrong_s: std::ops::Range<f64>,
}

impl Simulation {
    fn new(drive: Drive) -> Self {
        Self {
            drive,
            mount: UnitQuaternion::identity(),
            gyro_bias_radps: Vector3::new(2e-3, -3e-3, 4e-3),
            latency_s: 0.1,
            arrival_s: 0.0,
            fix_s: 0.2,
            velocity: true,
            wrong_s: 0.0..0.0,
        }
    }

    fn attitude(&self, time_s: f64) -> UnitQuaternion<f64> {
        let (heading_rad, ..) = (self.drive)(time_s);
        let level = from_euler(&Euler {
            heading_rad,
            ..Euler::default()
        });
        level * self.mount
    }

    fn velocity(&self, time_s: f64) -> Vector2<f64> {
        let (heading, _, speed, _) = (self.drive)(time_s);
        speed * Vector2::new(heading.sin(), heading.cos())
    }

    fn sample(&self, time_s: f64) -> ImuSample {
        let (_, rate, speed, accel) = (self.drive)(time_s);
        let force = Vector3::new(speed * rate, accel, GRAVITY_MPS2);
        let turn = Vector3::new(0.0, 0.0, -rate);
        ImuSample {
            time: Time::from_seconds(time_s).unwrap(),
            gyro: self.mount.inverse() * turn + self.gyro_bias_radps,
            accel: self.mount.inverse() * force,
        }
    }

    /// A fix with rounding errors only.
    fn fix(&self, stamp_s: f64, travelled_m: Vector2<f64>) -> GnssFix {
        let round = |v: f64| (v * 20.0).round() / 20.0;
        let position = Geodetic {
            latitude_rad: travelled_m.y / 6.336e6,
            longitude_rad: travelled_m.x / 6.378e6,
            height_m: 0.0,
        };
        let velocity_mps = if self.wrong_s.contains(&stamp_s) {
            Vector2::new(-12.0, 5.0)
        } else {
            self.velocity(stamp_s - self.latency_s).map(round)
        };
        GnssFix {
            time: Time::from_seconds(stamp_s).unwrap(),
            velocity_en_mps: self.velocity.then_some(velocity_mps),
            ..GnssFix::default()
        }
        .at(&position)
    }

    /// Runs until navigation begins; errors and sigmas of heading, tilt and latency.
    fn align(&self, limit_s: f64) -> Option<[(f64, f64); 3]> {
        let config = Config {
            heading: HeadingSource::Motion,
            ..Config::mems()
        };
        let mut navigator = Navigator::new(config).unwrap();
        let mut travelled_m = Vector2::zeros();
        let mut fixes = std::collections::VecDeque::new();
        let mut next_fix_s = 0.0;
        let mut count = 0.0;
        while count * STEP_S < limit_s {
            let time_s = count * STEP_S;
            travelled_m += STEP_S * self.velocity(time_s - self.latency_s);
            if time_s >= next_fix_s {
                next_fix_s += self.fix_s;
                fixes.push_back((time_s + self.arrival_s, self.fix(time_s, travelled_m)));
            }
            let _ = navigator.on_imu(&self.sample(time_s));
            while let Some((_, fix)) = fixes.pop_front_if(|(arrives_s, _)| *arrives_s <= time_s) {
                let _ = navigator.on_gnss(&fix);
            }
            if navigator.phase() == Phase::Navigating {
                return Some(self.errors_and_sigmas(&navigator, time_s));
            }
            count += 1.0;
        }
        None
    }

    fn errors_and_sigmas(&self, navigator: &Navigator, time_s: f64) -> [(f64, f64); 3] {
        let ins = navigator.mechanization().unwrap();
        let error = matrix(&ins.attitude) * matrix(&self.attitude(time_s)).transpose();
        let estimates = navigator.estimates();
        let latency = estimates.gnss_latency_s;
        [
            (
                error.m21.atan2(error.m11),
                estimates.azimuth_error_rad.sigma,
            ),
            (
                error.m33.min(1.0).acos(),
                navigator.tilt_sigma_rad().unwrap(),
            ),
            (latency.value - self.latency_s, latency.sigma),
        ]
    }
}

fn assert_errors_within_sigmas(simulation: &Simulation, limit_s: f64) {
    let found = simulation.align(limit_s).expect("must align");
    for ((error, sigma), largest) in found.into_iter().zip([0.4, 0.2, 0.6]) {
        assert!(error.abs() < 3.0 * sigma && sigma < largest, "{found:?}");
    }
}

#[test]
fn aligns_from_rest_and_in_motion() {
    assert_errors_within_sigmas(&Simulation::new(from_rest), 60.0);
    assert_errors_within_sigmas(&Simulation::new(bends), 60.0);
}

#[test]
fn aligns_in_any_mounting() {
    for (roll_rad, pitch_rad, heading_rad) in
        [(PI, 0.0, 0.0), (0.5 * PI, 0.3, 1.0), (0.2, -0.7, 3.0)]
    {
        let mount = from_euler(&Euler {
            roll_rad,
            pitch_rad,
            heading_rad,
        });
        for drive in [from_rest as Drive, bends] {
            assert_errors_within_sigmas(
                &Simulation {
                    mount,
                    ..Simulation::new(drive)
                },
                90.0,
            );
        }
    }
}

#[test]
fn aligns_with_any_latency_and_late_arrival() {
    for latency_s in [-0.9, -0.5, 0.5, 0.9] {
        for arrival_s in [0.0, 0.9] {
            let simulation = Simulation {
                latency_s,
                arrival_s,
                ..Simulation::new(from_rest)
            };
            assert_errors_within_sigmas(&simulation, 60.0);
        }
    }
}

#[test]
fn aligns_in_motion_with_gyro_biases_of_degrees_per_second() {
    for bias in [[0.05, -0.03, 0.04], [-0.04, 0.06, -0.05]] {
        let simulation = Simulation {
            gyro_bias_radps: bias.into(),
            ..Simulation::new(bends)
        };
        assert_errors_within_sigmas(&simulation, 90.0);
    }
}

/// A straight road with four seconds of braking every half minute, and bends from 100 s on.
fn motorway(time_s: f64) -> (f64, f64, f64, f64) {
    let t = time_s - 100.0;
    if t > 0.0 {
        let (heading, rate, ..) = bends(t);
        return (0.3 + heading, rate, 27.0, 0.0);
    }
    let phase = 0.5 * PI * (time_s % 30.0).min(4.0);
    (0.3, 0.0, 26.3 + 0.7 * phase.cos(), -0.35 * PI * phase.sin())
}

/// A receiver fault of half a second: GNSS velocity changes in a way that no heading explains. Treated as noise,
/// such fixes gave heading errors of 25 to 150 degrees with a sigma of 5.
#[test]
fn aligns_despite_a_burst_of_wrong_velocities() {
    for start_s in [6.0, 15.0, 36.0, 40.0, 50.0] {
        let simulation = Simulation {
            wrong_s: start_s..start_s + 0.5,
            ..Simulation::new(motorway)
        };
        assert_errors_within_sigmas(&simulation, 150.0);
    }
}

#[test]
fn aligns_with_one_fix_per_second_and_without_velocities() {
    for velocity in [true, false] {
        let simulation = Simulation {
            velocity,
            fix_s: 1.0,
            ..Simulation::new(from_rest)
        };
        assert_errors_within_sigmas(&simulation, 150.0);
    }
}

/// Heading is unobservable then; alignment must not guess one.
#[test]
fn no_heading_in_steady_motion() {
    let simulation = Simulation::new(|_| (0.3, 0.0, 15.0, 0.0));
    assert_eq!(simulation.align(300.0), None);
    let stationary = Simulation::new(|_| (0.3, 0.0, 0.0, 0.0));
    assert_eq!(stationary.align(300.0), None);
}
