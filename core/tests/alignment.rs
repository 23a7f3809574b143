//! Alignment from motion: what is handed over is right within the spread that is handed over.
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

struct Ride {
    drive: Drive,
    mount: UnitQuaternion<f64>,
    gyro_bias_radps: Vector3<f64>,
    latency_s: f64,
    arrival_s: f64,
    fix_s: f64,
    velocity: bool,
    /// Velocities that are wrong, by their stamps, s.
    wrong_s: std::ops::Range<f64>,
}

impl Ride {
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

    /// A fix whose errors are those of a rounded receiver, not of a random one.
    fn fix(&self, stamp_s: f64, way_m: Vector2<f64>) -> GnssFix {
        let round = |v: f64| (v * 20.0).round() / 20.0;
        let place = Geodetic {
            latitude_rad: way_m.y / 6.336e6,
            longitude_rad: way_m.x / 6.378e6,
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
        .at(&place)
    }

    /// Runs until it navigates; heading error and its spread, tilt error and its spread, latency
    /// error and its spread.
    fn align(&self, limit_s: f64) -> Option<[(f64, f64); 3]> {
        let config = Config {
            heading: HeadingSource::Motion,
            ..Config::mems()
        };
        let mut navigator = Navigator::new(config).unwrap();
        let mut way_m = Vector2::zeros();
        let mut fixes = std::collections::VecDeque::new();
        let mut next_fix_s = 0.0;
        let mut count = 0.0;
        while count * STEP_S < limit_s {
            let time_s = count * STEP_S;
            way_m += STEP_S * self.velocity(time_s - self.latency_s);
            if time_s >= next_fix_s {
                next_fix_s += self.fix_s;
                fixes.push_back((time_s + self.arrival_s, self.fix(time_s, way_m)));
            }
            let _ = navigator.on_imu(&self.sample(time_s));
            while let Some((_, fix)) = fixes.pop_front_if(|(arrives_s, _)| *arrives_s <= time_s) {
                let _ = navigator.on_gnss(&fix);
            }
            if navigator.phase() == Phase::Navigating {
                return Some(self.judge(&navigator, time_s));
            }
            count += 1.0;
        }
        None
    }

    fn judge(&self, navigator: &Navigator, time_s: f64) -> [(f64, f64); 3] {
        let ins = navigator.mechanization().unwrap();
        let off = matrix(&ins.attitude) * matrix(&self.attitude(time_s)).transpose();
        let estimates = navigator.estimates();
        let latency = estimates.gnss_latency_s;
        [
            (off.m21.atan2(off.m11), estimates.azimuth_error_rad.sigma),
            (off.m33.min(1.0).acos(), navigator.tilt_sigma_rad().unwrap()),
            (latency.value - self.latency_s, latency.sigma),
        ]
    }
}

fn assert_honest(ride: &Ride, limit_s: f64) {
    let found = ride.align(limit_s).expect("must align");
    for ((off, sigma), largest) in found.into_iter().zip([0.4, 0.2, 0.6]) {
        assert!(off.abs() < 3.0 * sigma && sigma < largest, "{found:?}");
    }
}

#[test]
fn from_rest_and_in_motion() {
    assert_honest(&Ride::new(from_rest), 60.0);
    assert_honest(&Ride::new(bends), 60.0);
}

#[test]
fn in_any_mount() {
    for (roll_rad, pitch_rad, heading_rad) in
        [(PI, 0.0, 0.0), (0.5 * PI, 0.3, 1.0), (0.2, -0.7, 3.0)]
    {
        let mount = from_euler(&Euler {
            roll_rad,
            pitch_rad,
            heading_rad,
        });
        for drive in [from_rest as Drive, bends] {
            assert_honest(
                &Ride {
                    mount,
                    ..Ride::new(drive)
                },
                90.0,
            );
        }
    }
}

#[test]
fn with_any_latency_and_late_arrival() {
    for latency_s in [-0.9, -0.5, 0.5, 0.9] {
        for arrival_s in [0.0, 0.9] {
            let ride = Ride {
                latency_s,
                arrival_s,
                ..Ride::new(from_rest)
            };
            assert_honest(&ride, 60.0);
        }
    }
}

#[test]
fn with_gyro_biases_of_degrees_a_second_in_motion() {
    for bias in [[0.05, -0.03, 0.04], [-0.04, 0.06, -0.05]] {
        let ride = Ride {
            gyro_bias_radps: bias.into(),
            ..Ride::new(bends)
        };
        assert_honest(&ride, 90.0);
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

/// A receiver on other satellites for half a second: GNSS velocity changes as the INS does not, whatever the
/// heading. Taken for noisy measurements, they led to headings 25 to 150 degrees off with a sigma of 5.
#[test]
fn with_a_burst_of_wrong_velocities() {
    for start_s in [6.0, 15.0, 36.0, 40.0, 50.0] {
        let ride = Ride {
            wrong_s: start_s..start_s + 0.5,
            ..Ride::new(motorway)
        };
        assert_honest(&ride, 150.0);
    }
}

#[test]
fn from_positions_alone_and_one_fix_a_second() {
    for velocity in [true, false] {
        let ride = Ride {
            velocity,
            fix_s: 1.0,
            ..Ride::new(from_rest)
        };
        assert_honest(&ride, 150.0);
    }
}

/// It is said to be unknown, not guessed.
#[test]
fn steady_motion_shows_no_heading() {
    let ride = Ride::new(|_| (0.3, 0.0, 15.0, 0.0));
    assert_eq!(ride.align(300.0), None);
    let still = Ride::new(|_| (0.3, 0.0, 0.0, 0.0));
    assert_eq!(still.align(300.0), None);
}
