//! Inputs that a port may feed and that no recording contains.
#![allow(clippy::disallowed_methods, clippy::unwrap_used, clippy::expect_used)] // Reference values.

use std::cell::Cell;
use std::f64::consts::TAU;

use ins_core::config::HeadingSource;
use ins_core::earth::{Geodetic, LatLon, wrap_pi};
use ins_core::{
    Config, ConfigError, FixSigma, GnssFix, GnssOutcome, Heading, ImuOutcome, ImuOutput, ImuSample,
    Navigator, Phase, SolutionSigma, Time,
};
use nalgebra::{Vector2, Vector3};

const GRAVITY_MPS2: f64 = 9.8;
const STEP_S: f64 = 0.01;

/// Speed and acceleration, rate of turn.
type Drive = fn(f64) -> (f64, f64, f64);

/// Ten seconds at rest, a start, then bends and changes of speed.
fn bends(time_s: f64) -> (f64, f64, f64) {
    let t = (time_s - 10.0).max(0.0);
    let started = (t / 8.0).min(1.0);
    let start = 12.0 * (started - (TAU * started).sin() / TAU);
    let push = 1.5 * (1.0 - (TAU * started).cos());
    let turn = if t > 8.0 { 0.2 * (0.35 * t).sin() } else { 0.0 };
    (
        start + 2.0 * (0.25 * t).sin() * started,
        push + 0.5 * (0.25 * t).cos() * started,
        turn,
    )
}

/// A vehicle on a flat Earth that does not turn.
#[derive(Clone)]
struct Car {
    drive: Drive,
    count: u32,
    heading_rad: f64,
    travelled_m: Vector2<f64>,
    /// Part of the right acceleration that the up accelerometer reads.
    cross_axis: f64,
    /// Bias of the up accelerometer, m/s^2, and its rate of change, m/s^3.
    up_bias_mps2: f64,
    bias_rate: f64,
    /// Offset of the clock of the inertial sensors, s.
    clock_s: f64,
    navigator: Navigator,
}

impl Car {
    fn new(drive: Drive) -> Self {
        Self {
            drive,
            count: 0,
            heading_rad: 0.4,
            travelled_m: Vector2::zeros(),
            cross_axis: 0.0,
            up_bias_mps2: 0.0,
            bias_rate: 0.0,
            clock_s: 0.0,
            navigator: Navigator::new(Config::mems()).unwrap(),
        }
    }

    fn time_s(&self) -> f64 {
        STEP_S * f64::from(self.count)
    }

    fn time(&self) -> Time {
        Time::from_seconds(self.time_s()).unwrap()
    }

    fn velocity_mps(&self) -> Vector2<f64> {
        let (speed, ..) = (self.drive)(self.time_s());
        speed * Vector2::new(self.heading_rad.sin(), self.heading_rad.cos())
    }

    /// The current fix, rounded as by a receiver.
    fn fix(&self) -> GnssFix {
        let round = |v: f64| (v * 20.0).round() / 20.0;
        let velocity_mps = self.velocity_mps().map(round);
        GnssFix {
            time: self.time(),
            velocity_en_mps: Some(velocity_mps),
            ..GnssFix::default()
        }
        .at(&Geodetic {
            latitude_rad: self.travelled_m.y / 6.336e6,
            longitude_rad: self.travelled_m.x / 6.378e6,
            // All zeros would be ignored.
            height_m: 1.0,
        })
    }

    /// Runs until a time with five fixes a second, filtered by `of`.
    fn run_until(&mut self, time_s: f64, sampled: bool, of: impl Fn(GnssFix) -> Option<GnssFix>) {
        while self.time_s() < time_s {
            self.count += 1;
            let (speed, accel, turn) = (self.drive)(self.time_s());
            self.heading_rad += STEP_S * turn;
            self.travelled_m += STEP_S * self.velocity_mps();
            if sampled {
                let up_bias_mps2 = self.up_bias_mps2 + self.bias_rate * self.time_s();
                let up_error_mps2 = self.cross_axis * speed * turn + up_bias_mps2;
                let _ = self.navigator.on_imu(&ImuSample {
                    time: self.time().plus_seconds(self.clock_s),
                    gyro: Vector3::new(2e-3, -3e-3, 4e-3 - turn),
                    accel: Vector3::new(speed * turn, accel, GRAVITY_MPS2 + up_error_mps2),
                });
            }
            if self.count.is_multiple_of(20)
                && let Some(fix) = of(self.fix())
            {
                let _ = self.navigator.on_gnss(&fix);
            }
        }
    }

    fn error_m(&self) -> Vector3<f64> {
        let own = self.navigator.solution().unwrap().position;
        own.enu_from(&self.fix().geodetic_or(0.0).unwrap())
    }
}

#[test]
fn height_before_the_first_position_is_used() {
    let mut car = Car::new(bends);
    car.run_until(1.0, true, |fix| {
        Some(GnssFix {
            height_m: Some(2500.0),
            position: None,
            velocity_en_mps: None,
            ..fix
        })
    });
    car.run_until(60.0, true, |fix| {
        Some(GnssFix {
            height_m: None,
            ..fix
        })
    });
    assert_eq!(car.navigator.phase(), Phase::Navigating);
    let error_m = car.error_m().z - 2500.0;
    assert!(error_m.abs() < 100.0, "{error_m}");
}

#[test]
fn sigmas_after_a_gap_cover_the_errors() {
    // A short gap while coasting, and a long one just after a fix.
    for (coasting_until_s, gap_until_s) in [(100.0, 103.0), (90.0, 150.0)] {
        let mut car = Car::new(bends);
        car.run_until(90.0, true, Some);
        car.run_until(coasting_until_s, true, |_| None);
        car.run_until(gap_until_s, false, |_| None);
        for since_s in [0.1, 7.0, 27.0, 57.0] {
            car.run_until(gap_until_s + since_s, true, |_| None);
            let (error_m, sigma) = (car.error_m(), car.navigator.sigma().unwrap());
            let components = error_m.iter().zip(&sigma.position_m);
            assert!(
                components
                    .into_iter()
                    .all(|(off, sigma)| off.abs() < 3.0 * sigma),
                "{error_m} {sigma:?}"
            );
        }
        car.run_until(gap_until_s + 59.0, true, Some);
        assert!(car.navigator.sigma().unwrap().position_m.x < 40.0);
    }
}

#[test]
fn a_reading_that_may_be_clipped_is_noise_unless_it_is_refused() {
    let mut car = Car::new(bends);
    car.run_until(90.0, true, Some);
    let clipped = |time_s: f64| ImuSample {
        time: Time::from_seconds(time_s).unwrap(),
        gyro: Vector3::zeros(),
        accel: Vector3::new(1.05 * Config::mems().sensors.accel_range_mps2, 0.0, 0.0),
    };
    let before = car.navigator.sigma();
    // After a gap that nothing bridges, and after none.
    for (time_s, outcome) in [(91.0, ImuOutcome::Gap), (90.01, ImuOutcome::Accepted)] {
        assert_eq!(car.navigator.sigma(), before);
        assert_eq!(car.navigator.on_imu(&clipped(time_s)), outcome);
    }
    assert!(car.navigator.sigma().unwrap().velocity_mps.x > 2.0 * before.unwrap().velocity_mps.x);
}

#[test]
fn a_fix_of_before_tells_nothing_of_a_clipped_reading() {
    let mut car = Car::new(bends);
    car.run_until(89.9, true, Some);
    car.run_until(90.0, true, |_| None);
    let late = car.fix();
    let _ = car.navigator.on_imu(&ImuSample {
        time: Time::from_seconds(90.01).unwrap(),
        gyro: Vector3::zeros(),
        accel: Vector3::new(1.05 * Config::mems().sensors.accel_range_mps2, 0.0, 0.0),
    });
    car.run_until(90.1, true, |_| None);
    let before = car.navigator.sigma().unwrap();
    assert_eq!(car.navigator.on_gnss(&late), GnssOutcome::Queued);
    car.run_until(91.3, true, |_| None);
    let taken = car.navigator.health().last_fix.unwrap();
    assert_eq!(
        (taken.time, taken.outcome),
        (late.time, GnssOutcome::Accepted)
    );
    let after = car.navigator.sigma().unwrap();
    assert!(
        after.velocity_mps.x > 0.9 * before.velocity_mps.x,
        "{before:?} {after:?}"
    );
}

#[test]
fn an_increment_of_a_time_already_filled_is_noise() {
    let config = Config {
        imu_output: ImuOutput::Increments,
        heading: HeadingSource::Given(0.0),
        ..Config::mems()
    };
    let mut navigator = <Navigator>::new(config).unwrap();
    // A hundred samples a second at rest; the last but one is stamped almost as late as the last.
    for count in 1..=6000 {
        let late_s = if count == 5999 { 0.008 } else { 0.0 };
        let time = Time::from_seconds(STEP_S * f64::from(count) + late_s).unwrap();
        let outcome = navigator.on_imu(&ImuSample {
            time,
            gyro: Vector3::zeros(),
            accel: Vector3::new(0.0, 0.0, GRAVITY_MPS2 * STEP_S),
        });
        assert!(
            matches!(outcome, ImuOutcome::Accepted | ImuOutcome::Bridged),
            "{count}"
        );
        if count % 20 == 0 && count < 5900 {
            let _ = navigator.on_gnss(&GnssFix {
                time,
                velocity_en_mps: Some(Vector2::zeros()),
                velocity_up_mps: Some(0.0),
                ..GnssFix::default().at(&Geodetic {
                    latitude_rad: 0.9,
                    longitude_rad: 0.1,
                    height_m: 100.0,
                })
            });
        }
    }
    let (up_mps, sigma) = (
        navigator.solution().unwrap().velocity_enu_mps.z,
        navigator.sigma().unwrap(),
    );
    assert!(up_mps > 0.06, "{up_mps}");
    assert!(up_mps < 2.0 * sigma.velocity_mps.z, "{up_mps} {sigma:?}");
}

#[test]
fn a_heading_in_a_gap_is_refused() {
    let mut car = Car::new(bends);
    car.run_until(90.0, true, Some);
    car.run_until(91.0, false, |_| None);
    car.run_until(92.0, true, |_| None);
    let [in_gap, after, long_ago] = [90.5, 91.9, 80.0].map(|time_s| {
        car.navigator.on_heading(&Heading {
            time: Time::from_seconds(time_s).unwrap(),
            heading_rad: car.heading_rad,
            sigma_rad: 0.5,
        })
    });
    assert_eq!(in_gap, GnssOutcome::NoInertialData);
    assert_eq!(after, GnssOutcome::Accepted);
    assert_eq!(long_ago, GnssOutcome::TooOld);
}

#[test]
fn samples_without_gaps_need_no_bridge() {
    let mut car = Car::new(bends);
    let config = |max_gap_s| Config {
        max_gap_s,
        ..Config::mems()
    };
    car.navigator = Navigator::new(config(1e-3)).unwrap();
    car.run_until(60.0, true, Some);
    assert_eq!(car.navigator.phase(), Phase::Navigating);
    let too_long = <Navigator>::new(config(3600.0)).err();
    assert_eq!(too_long, Some(ConfigError::BeyondAMinute("max_gap_s")));
}

/// Rest, a start, and steady turns without vibration.
fn steady_turns(time_s: f64) -> (f64, f64, f64) {
    let (speed, accel, _) = bends(time_s.min(18.0));
    let turn = if (30.0..60.0).contains(&time_s) {
        0.2
    } else {
        0.0
    };
    if time_s < 90.0 {
        return (speed, if time_s < 18.0 { accel } else { 0.0 }, turn);
    }
    let (speed_now, accel, turn) = bends(time_s - 72.0);
    (speed_now, accel, turn)
}

#[test]
fn a_steady_turn_without_gnss_is_not_estimated_as_gyro_bias() {
    let mut car = Car::new(steady_turns);
    car.run_until(9.0, true, Some);
    car.run_until(80.0, true, |_| None);
    let known = car.navigator.estimates().gyro_bias_radps[2];
    assert!((known.value - 4e-3).abs() < 3.0 * known.sigma, "{known:?}");
    car.run_until(140.0, true, Some);
    let heading_rad = car.navigator.solution().unwrap().euler().heading_rad;
    let error_rad = wrap_pi(heading_rad - car.heading_rad);
    assert!(error_rad.abs() < 0.05, "{error_rad}");
}

#[test]
fn tilt_sigma_covers_motion_hidden_in_gaps() {
    let mut car = Car::new(bends);
    for start_s in [100.0, 137.0, 174.0, 211.0] {
        car.run_until(start_s, true, Some);
        car.run_until(start_s + 1.9, false, Some);
        car.run_until(start_s + 2.0, true, Some);
        for tenth in 1..200 {
            car.run_until(start_s + 2.0 + 0.1 * f64::from(tenth), true, Some);
            let euler = car.navigator.solution().unwrap().euler();
            let tilt_rad = euler.roll_rad.hypot(euler.pitch_rad);
            let sigma_rad = car.navigator.sigma().unwrap().attitude_rad.x;
            assert!(
                tilt_rad < 5.0 * sigma_rad,
                "{} {tilt_rad} {sigma_rad}",
                car.time_s()
            );
        }
    }
    assert_eq!(car.navigator.health().samples.bridged, 4);
}

/// Braking hidden by a gap is bridged; a mount that has slipped in it needs a new level and heading.
#[test]
fn a_slip_in_a_gap_aligns_anew() {
    let slipped = |angle_rad: f64| {
        let (sin, cos) = angle_rad.sin_cos();
        GRAVITY_MPS2 * Vector3::new(sin, 0.0, cos)
    };
    let braking = |accel_mps2: f64| Vector3::new(0.0, -accel_mps2, GRAVITY_MPS2);
    for (accel, missing_s, bridged) in [
        (slipped(0.9), 0.3, false),
        (slipped(-1.2), 0.3, false),
        (slipped(TAU / 2.0 - 0.1), 0.28, false),
        (slipped(0.6), 0.3, true),
        (braking(8.0), 0.45, true),
        // Vibration.
        (slipped(0.9), 0.1, true),
    ] {
        let mut car = Car::new(bends);
        // Between two bends.
        car.run_until(135.7, true, Some);
        // Beyond a gap it takes a few samples to start anew.
        let outcomes: [_; 10] = std::array::from_fn(|count| {
            let seconds = missing_s + STEP_S * f64::from(u8::try_from(count).unwrap());
            car.navigator.on_imu(&ImuSample {
                time: car.time().plus_seconds(seconds),
                gyro: Vector3::zeros(),
                accel,
            })
        });
        let navigates = car.navigator.phase() == Phase::Navigating;
        let expected = if bridged {
            ImuOutcome::Bridged
        } else {
            ImuOutcome::Gap
        };
        assert_eq!(
            (outcomes[0], navigates),
            (expected, bridged),
            "{accel:?} {missing_s}"
        );
    }
}

#[test]
fn a_latency_jump_is_estimated_again() {
    let mut car = Car::new(bends);
    car.run_until(100.0, true, Some);
    for late_s in [0.5, -0.3] {
        let until_s = car.time_s() + 60.0;
        car.run_until(until_s, true, |fix| {
            Some(GnssFix {
                time: fix.time.plus_seconds(late_s),
                ..fix
            })
        });
        let found = car.navigator.estimates().gnss_latency_s.value;
        assert!((found - late_s).abs() < 0.05, "{found} {late_s}");
    }
    assert_eq!(car.navigator.health().restarts, 0);
}

/// Until the jump is detected, the position error is the distance travelled in half a second.
#[test]
fn position_recovers_after_a_latency_jump() {
    let mut car = Car::new(bends);
    car.run_until(100.0, true, Some);
    for late_s in [-0.5, 0.4] {
        let until_s = car.time_s() + 100.0;
        car.run_until(until_s, true, |fix| {
            let time = fix.time.plus_seconds(late_s);
            Some(GnssFix { time, ..fix })
        });
        let (error_m, sigma) = (car.error_m().xy(), car.navigator.sigma().unwrap());
        assert!(
            error_m.norm() < 2.0 * sigma.position_m.x,
            "{error_m} {sigma:?}"
        );
    }
}

#[test]
fn parameter_variances_grow_over_a_long_gap() {
    let mut car = Car::new(bends);
    car.run_until(100.0, true, Some);
    let known = car.navigator.estimates().gyro_bias_radps;
    car.run_until(4100.0, false, |_| None);
    car.run_until(4103.0, true, |_| None);
    assert_ne!(car.navigator.phase(), Phase::Navigating);
    let walked = Config::mems().sensors.gyro_bias_walk.powi(2) * 3600.0;
    for (before, now) in known.iter().zip(car.navigator.estimates().gyro_bias_radps) {
        let expected = before.sigma.powi(2) + walked;
        assert!((now.sigma.powi(2) / expected - 1.0).abs() < 0.01, "{now:?}");
    }
}

#[test]
fn bursts_of_wrong_heights_cause_no_restart() {
    let mut car = Car::new(bends);
    car.run_until(100.0, true, Some);
    let known = car.navigator.estimates().gyro_bias_radps[0].sigma;
    for start_s in [100.0, 135.0] {
        car.run_until(start_s + 10.0, true, |fix| {
            Some(GnssFix {
                height_m: fix.height_m.map(|height_m| height_m + 60.0),
                ..fix
            })
        });
        car.run_until(start_s + 35.0, true, Some);
        let error_m = car.error_m().z;
        assert!(error_m.abs() < 2.0, "{error_m}");
    }
    assert_eq!(car.navigator.health().restarts, 0);
    assert!(car.navigator.estimates().gyro_bias_radps[0].sigma <= known);
}

#[test]
fn repeated_positions_are_not_used() {
    let mut car = Car::new(bends);
    // Some receivers write each position five times a second.
    let last = Cell::new(None);
    car.run_until(120.0, true, |fix| {
        if fix.time.as_seconds().fract() < 0.1 {
            last.set(fix.position);
        }
        Some(GnssFix {
            velocity_en_mps: None,
            position: last.get(),
            ..fix
        })
    });
    let fixes = car.navigator.health().fixes;
    // Four of five, once navigating.
    assert!(fixes.repeated > 250, "{fixes:?}");
    assert_eq!(car.navigator.health().restarts, 0);
}

#[test]
fn a_heading_may_arrive_before_the_sample_of_its_time() {
    let mut car = Car::new(bends);
    car.run_until(90.0, true, Some);
    for _ in 0..50 {
        let until_s = car.time_s() + 0.2;
        car.run_until(until_s, true, Some);
        let (_, _, turn) = (car.drive)(car.time_s());
        let outcome = car.navigator.on_heading(&Heading {
            time: car.time().plus_seconds(0.02),
            heading_rad: car.heading_rad + 0.02 * turn,
            sigma_rad: 1e-3,
        });
        assert_eq!(outcome, GnssOutcome::Accepted);
    }
    let heading_rad = car.navigator.solution().unwrap().euler().heading_rad;
    let error_rad = wrap_pi(heading_rad - car.heading_rad);
    // Ignoring the time stamp of a heading would cause 4e-3.
    assert!(error_rad.abs() < 2e-3, "{error_rad}");
}

#[test]
fn overdamped_loops_are_stable() {
    let mut car = Car::new(bends);
    let mut config = Config::mems();
    config.damping.horizontal.damping_ratio = 20.0;
    config.damping.vertical.damping_ratio = 20.0;
    car.navigator = Navigator::new(config).unwrap();
    car.run_until(150.0, true, Some);
    let error_mps =
        car.navigator.mechanization().unwrap().velocity_enu_mps.xy() - car.velocity_mps();
    assert!(error_mps.norm() < 0.2, "{error_mps}");
}

/// Some receivers always state tens of metres a second.
#[test]
fn heading_is_found_whatever_sigma_the_receiver_states() {
    let mut car = Car::new(bends);
    car.run_until(60.0, true, |fix| {
        Some(GnssFix {
            sigma: FixSigma {
                velocity_mps: Some(50.0),
                ..FixSigma::default()
            },
            ..fix
        })
    });
    assert_eq!(car.navigator.phase(), Phase::Navigating);
}

/// A factor of 1e30, by a mistake of units: its square overflows single precision.
#[test]
fn too_large_configuration_values_are_rejected() {
    let set: [fn(&mut Config); 4] = [
        |config| config.sensors.gyro_bias_walk = 1e30,
        |config| config.sensors.accel_bias_mps2 = 1e30,
        |config| config.gnss.lever_arm_m[0] = -1e30,
        |config| config.gnss.noise_range[1] = 1e30,
    ];
    for set in set {
        let mut config = Config::mems();
        set(&mut config);
        assert!(Navigator::new(config).is_err(), "{config:?}");
    }
}

#[test]
fn each_fix_is_counted_once_through_a_realignment() {
    let mut car = Car::new(bends);
    car.run_until(90.0, true, Some);
    // Fixes continue while samples are missing.
    for tenth in 1..100 {
        let sampled = !(30..70).contains(&tenth);
        car.run_until(90.0 + 0.1 * f64::from(tenth), sampled, |_| None);
        let fix = GnssFix {
            time: car.time().plus_seconds(0.4),
            ..car.fix()
        };
        let _ = car.navigator.on_gnss(&fix);
    }
    let health = car.navigator.health();
    assert_eq!(health.restarts, 1);
    let counts = health.fixes;
    let settled = counts.accepted + counts.too_old + counts.too_far_ahead + counts.outlier;
    let others = counts.no_inertial_data + counts.time_not_increasing + counts.repeated;
    assert_eq!(settled + others, 450 + 99, "{counts:?}");
}

#[test]
fn coasting_with_heights_alone() {
    let mut car = Car::new(bends);
    car.run_until(90.0, true, Some);
    car.run_until(100.0, true, |fix| {
        Some(GnssFix {
            position: None,
            velocity_en_mps: None,
            ..fix
        })
    });
    let since_s = car.navigator.health().coasting_since.unwrap().as_seconds();
    assert!((90.0..91.0).contains(&since_s), "{since_s}");
}

/// Rest, a start, and circles.
fn circles(time_s: f64) -> (f64, f64, f64) {
    let (speed, accel, _) = bends(time_s);
    (speed, accel, if time_s < 18.0 { 0.0 } else { 0.25 })
}

#[test]
fn a_negative_sigma_is_ignored() {
    let drive = |sigma: Option<f64>| {
        let mut car = Car::new(bends);
        let sigma = FixSigma {
            position_m: sigma,
            height_m: sigma,
            velocity_mps: sigma,
            velocity_up_mps: sigma,
        };
        car.run_until(100.0, true, |fix| Some(GnssFix { sigma, ..fix }));
        (car.navigator.solution().unwrap(), car.navigator.sigma())
    };
    let silent = drive(None);
    assert_eq!(drive(Some(-1.0)), silent);
    assert_ne!(drive(Some(1.0)), silent);
}

/// While aligning, where only the square of the sigma is used, it is ignored too.
#[test]
fn a_large_negative_sigma_is_ignored_while_aligning() {
    let mut car = Car::new(bends);
    car.run_until(60.0, true, Some);
    // Longer than is bridged: aligned anew.
    car.run_until(64.0, false, |_| None);
    let sigma = FixSigma {
        position_m: Some(-1e200),
        height_m: Some(-9999.0),
        ..FixSigma::default()
    };
    car.run_until(66.0, true, |fix| Some(GnssFix { sigma, ..fix }));
    assert_ne!(car.navigator.phase(), Phase::Navigating);
    let stated = car.navigator.sigma().unwrap();
    assert!(stated.position_m.max() < 50.0, "{stated:?}");
}

/// As after a cold start: a large error, which the receiver states, until it has a fix.
#[test]
fn positions_with_large_stated_sigmas_are_weighted_by_them() {
    for (error_m, sigma_m) in [(1e3, 1e3), (2e4, 1e4), (6.4e6, 4.3e6)] {
        let mut config = Config::mems();
        config.heading = HeadingSource::Given(0.4);
        let mut car = Car::new(|_| (0.0, 0.0, 0.0));
        car.navigator = Navigator::new(config).unwrap();
        let cold = |mut fix: GnssFix| {
            if let Some(position) = fix.position.as_mut() {
                position.longitude_rad += error_m / 6.378e6;
            }
            fix.sigma.position_m = Some(sigma_m);
            Some(fix)
        };
        car.run_until(30.0, true, cold);
        if sigma_m < 1e5 {
            let stated_m = car.navigator.sigma().unwrap().position_m.x;
            assert!(stated_m > 0.4 * sigma_m, "{stated_m} m, stated {sigma_m} m");
        }
        car.run_until(40.0, true, Some);
        let (error_m, sigma) = (car.error_m(), car.navigator.sigma().unwrap());
        assert!(error_m.norm() < 10.0, "{error_m} m, stated {sigma:?}");
    }
}

/// A stored position of another place, without a stated sigma.
#[test]
fn a_wrong_initial_position_is_corrected() {
    for error_m in [2e3, 1e4, 1e5] {
        let mut config = Config::mems();
        config.heading = HeadingSource::Given(0.4);
        let mut car = Car::new(|t| bends(t - 60.0));
        car.navigator = Navigator::new(config).unwrap();
        let displaced = |mut fix: GnssFix| {
            if let Some(position) = fix.position.as_mut() {
                position.longitude_rad += error_m / 6.378e6;
            }
            Some(fix)
        };
        car.run_until(30.0, true, displaced);
        assert!(car.error_m().norm() > 0.9 * error_m);
        // At two fixes a second: a divergence is suspected after three, and certain after fifteen seconds.
        car.run_until(33.0, true, Some);
        while car.time_s() < 150.0 {
            car.run_until(car.time_s() + 0.5, true, Some);
            let (error_m, sigma) = (car.error_m(), car.navigator.sigma().unwrap().position_m);
            let overconfident = error_m.norm() > 5.0 * sigma.norm();
            assert!(
                !overconfident,
                "at {} s {error_m} m, stated {sigma} m",
                car.time_s()
            );
            if car.time_s() > 60.0 {
                assert!(error_m.norm() < 30.0, "at {} s {error_m} m", car.time_s());
            }
        }
    }
}

/// The largest number of millimetres, which receivers write as sigma if they have no fix.
#[test]
fn a_component_with_the_largest_sigma_is_ignored() {
    let largest = Some(4_294_967.0);
    let mut car = Car::new(bends);
    car.run_until(50.0, true, Some);
    let mut other = car.navigator.clone();
    let mut fix = car.fix();
    fix.sigma.position_m = largest;
    let without = GnssFix {
        position: None,
        sigma: FixSigma::default(),
        ..fix
    };
    assert_eq!(car.navigator.on_gnss(&fix), other.on_gnss(&without));
    assert_eq!(car.navigator, other);
    fix.sigma = FixSigma {
        position_m: largest,
        height_m: largest,
        velocity_mps: largest,
        velocity_up_mps: largest,
    };
    assert_eq!(car.navigator.on_gnss(&fix), GnssOutcome::Empty);
}

/// Gap too long to bridge: the stopgap solution continues at the last velocity.
#[test]
fn position_is_extrapolated_over_a_gap() {
    let mut car = Car::new(|t| {
        let (speed, accel, turn) = bends(t);
        (4.0 * speed, 4.0 * accel, 0.2 * turn)
    });
    car.run_until(100.0, true, Some);
    assert_eq!(car.navigator.phase(), Phase::Navigating);
    car.run_until(104.0, false, |_| None);
    car.run_until(104.2, true, |_| None);
    assert_ne!(car.navigator.phase(), Phase::Navigating);
    let place = car.navigator.solution().unwrap().position;
    let error_m = place
        .enu_from(&car.fix().geodetic_or(0.0).unwrap())
        .xy()
        .norm();
    let sigma_m = car.navigator.sigma().unwrap().position_m.x;
    assert!(error_m < 2.0 * sigma_m, "{error_m} {sigma_m}");
}

#[test]
fn sigmas_do_not_shrink_when_the_clock_is_set_back() {
    let mut car = Car::new(bends);
    car.run_until(100.0, true, Some);
    car.run_until(160.0, true, |_| None);
    let before_m = car.navigator.sigma().unwrap().position_m.x;
    for count in 0..200 {
        let time = Time::from_seconds(STEP_S * f64::from(count)).unwrap();
        let _ = car.navigator.on_imu(&ImuSample {
            time,
            gyro: Vector3::new(2e-3, -3e-3, 4e-3),
            accel: Vector3::new(0.0, 0.0, GRAVITY_MPS2),
        });
    }
    assert_ne!(car.navigator.phase(), Phase::Navigating);
    let after_m = car.navigator.sigma().unwrap().position_m.x;
    assert!(after_m > before_m, "{after_m} {before_m}");
}

/// Positions alone, a vehicle in motion, and a given heading.
#[test]
fn initial_velocity_comes_from_position_differences() {
    let mut car = Car::new(|_| (20.0, 0.0, 0.0));
    car.navigator = Navigator::new(Config {
        heading: HeadingSource::Given(car.heading_rad),
        ..Config::mems()
    })
    .unwrap();
    let without_velocity = |fix: GnssFix| {
        Some(GnssFix {
            velocity_en_mps: None,
            ..fix
        })
    };
    while car.navigator.phase() != Phase::Navigating {
        assert!(car.time_s() < 60.0);
        let until_s = car.time_s() + STEP_S;
        car.run_until(until_s, true, without_velocity);
    }
    let velocity_mps = car.navigator.solution().unwrap().velocity_enu_mps.xy();
    let error_mps = (velocity_mps - car.velocity_mps()).norm();
    let sigma_mps = car.navigator.sigma().unwrap().velocity_mps.x;
    assert!(error_mps < 3.0 * sigma_mps, "{error_mps} {sigma_mps}");
}

/// Two antennas: one heading per second, each 0.1 s late.
#[test]
fn late_headings_at_one_hertz_end_the_search() {
    let mut car = Car::new(|_| (0.0, 0.0, 0.0));
    car.run_until(30.0, true, Some);
    assert_eq!(car.navigator.phase(), Phase::FindingHeading);
    while car.navigator.phase() != Phase::Navigating {
        assert!(car.time_s() < 50.0, "{:?}", car.navigator.phase());
        let heading = Heading {
            time: car.time(),
            heading_rad: car.heading_rad,
            sigma_rad: 0.02,
        };
        let second_s = car.time_s() + 1.0;
        car.run_until(second_s - 0.9, true, Some);
        let _ = car.navigator.on_heading(&heading);
        car.run_until(second_s, true, Some);
    }
}

/// In a turn from the beginning, with each measured heading 0.8 s late.
#[test]
fn late_headings_are_propagated_by_the_gyros_during_levelling() {
    let mut car = Car::new(|_| (6.0, 0.0, 0.3));
    let mut headings = Vec::new();
    while car.navigator.phase() != Phase::Navigating {
        assert!(car.time_s() < 60.0, "{:?}", car.navigator.phase());
        let until_s = car.time_s() + 0.1;
        car.run_until(until_s, true, Some);
        headings.push(Heading {
            time: car.time(),
            heading_rad: wrap_pi(car.heading_rad),
            sigma_rad: 0.01,
        });
        if let Some(late) = headings.iter().rev().nth(8) {
            let _ = car.navigator.on_heading(late);
        }
    }
    let error_rad =
        wrap_pi(car.navigator.solution().unwrap().euler().heading_rad - car.heading_rad);
    assert!(error_rad.abs() < 0.05, "{error_rad}");
}

#[test]
fn cross_axis_sensitivity_in_circles_is_within_the_bias_sigma() {
    let mut car = Car::new(circles);
    car.cross_axis = 0.01;
    car.run_until(200.0, true, Some);
    let known = car.navigator.estimates().accel_bias_mps2[2];
    assert!(known.value.abs() < 4.0 * known.sigma, "{known:?}");
}

/// The antenna baseline is misaligned by three degrees, or the antennas are swapped.
#[test]
fn headings_inconsistent_with_manoeuvres_are_rejected() {
    for (error_rad, sigma_rad, least_s) in [(0.05, 0.01, 200.0), (3.1, 0.01, 80.0)] {
        let mut car = Car::new(bends);
        while car.time_s() < 300.0 {
            let until_s = car.time_s() + 0.2;
            car.run_until(until_s, true, Some);
            let heading_rad = wrap_pi(car.heading_rad + error_rad);
            let _ = car.navigator.on_heading(&Heading {
                time: car.time(),
                heading_rad,
                sigma_rad,
            });
            if let Some(solution) = car.navigator.solution()
                && car.time_s() > least_s
            {
                let error_rad = wrap_pi(solution.euler().heading_rad - car.heading_rad);
                let sigma_rad = car.navigator.sigma().unwrap().attitude_rad.z;
                let is_covered = error_rad.abs() < 4.5 * sigma_rad;
                assert!(is_covered, "{} {error_rad} {sigma_rad}", car.time_s());
            }
        }
        assert_eq!(car.navigator.phase(), Phase::Navigating);
    }
}

/// A bias that changes faster than configured makes innovations correlated.
#[test]
fn correlated_innovations_inflate_the_variance() {
    let mut car = Car::new(bends);
    car.bias_rate = 1e-3;
    let mut worst: f64 = 0.0;
    while car.time_s() < 300.0 {
        let until_s = car.time_s() + 1.0;
        car.run_until(until_s, true, Some);
        if car.time_s() > 60.0 {
            let up_mps = car.navigator.solution().unwrap().velocity_enu_mps.z;
            let sigma_mps = car.navigator.sigma().unwrap().velocity_mps.z;
            worst = worst.max(up_mps.abs() / sigma_mps);
        }
    }
    // A bias that walks ten times as fast as configured; 13 with the variance for white innovations.
    assert!(worst < 8.0, "{worst}");
}

#[test]
fn tilting_in_a_gap_invalidates_the_attitude() {
    // While navigating, and in a renewed heading search.
    for before in [vec![], vec![92.5, 94.0]] {
        let mut car = Car::new(bends);
        car.run_until(90.0, true, Some);
        let mut samples = false;
        for until_s in before {
            car.run_until(until_s, samples, |_| None);
            samples = true;
        }
        assert!(car.navigator.solution().is_some());
        car.run_until(car.time_s() + 2.5, false, Some);
        assert!(car.navigator.body_motion().is_some());
        // The unit is on its side.
        for count in 0..50 {
            let time = car.time().plus_seconds(STEP_S * f64::from(count));
            let outcome = car.navigator.on_imu(&ImuSample {
                time,
                gyro: Vector3::new(2e-3, -3e-3, 4e-3),
                accel: Vector3::new(GRAVITY_MPS2, 0.0, 0.0),
            });
            // Motion from before the gap is not reported as current.
            let motion = car.navigator.body_motion();
            assert!(
                motion.is_none_or(|motion| outcome == ImuOutcome::Accepted || motion.time < time)
            );
        }
        assert_eq!(car.navigator.health().restarts, 1);
        assert!(car.navigator.solution().is_none());
    }
}

#[test]
fn levelling_uses_no_rest_from_before_unaided_motion() {
    let config = Config {
        heading: HeadingSource::Given(0.0),
        ..Config::mems()
    };
    let mut navigator = Navigator::new(config).unwrap();
    let mut pitch_rad = 0.0_f64;
    for count in 0..5000 {
        let time_s = STEP_S * f64::from(count);
        // Rest, transport up a ramp, and rest again.
        let rate_radps = if (10.0..20.0).contains(&time_s) {
            0.03 * (1.0 + 5.0 * (20.0 * time_s).sin())
        } else {
            0.0
        };
        pitch_rad += STEP_S * rate_radps;
        let _ = navigator.on_imu(&ImuSample {
            time: Time::from_seconds(time_s).unwrap(),
            gyro: Vector3::new(rate_radps, 0.0, 0.0),
            accel: GRAVITY_MPS2 * Vector3::new(0.0, pitch_rad.sin(), pitch_rad.cos()),
        });
        if time_s > 22.0 && count % 50 == 0 {
            let _ = navigator.on_gnss(&GnssFix {
                time: Time::from_seconds(time_s).unwrap(),
                position: Some(LatLon::default()),
                height_m: Some(1.0),
                velocity_en_mps: Some(Vector2::zeros()),
                velocity_up_mps: Some(0.0),
                sigma: FixSigma::default(),
            });
        }
        if let Some(solution) = navigator.solution() {
            let error_rad = solution.euler().pitch_rad - pitch_rad;
            assert!(error_rad.abs() < 0.02, "{error_rad} at {time_s} s");
        }
    }
    assert_eq!(navigator.phase(), Phase::Navigating);
}

#[test]
fn an_assumed_vertical_velocity_is_not_counted_as_an_accepted_fix() {
    let mut car = Car::new(bends);
    let level = |fix| GnssFix {
        height_m: None,
        velocity_up_mps: None,
        ..fix
    };
    let wrong = |fix: GnssFix| GnssFix {
        velocity_en_mps: (fix.velocity_en_mps).map(|mps| mps + Vector2::new(100.0, -200.0)),
        position: None,
        ..level(fix)
    };
    car.run_until(90.0, true, |fix| Some(level(fix)));
    // Fixes still in the queue.
    car.run_until(90.5, true, |fix| Some(wrong(fix)));
    let before = car.navigator.health().fixes;
    // Too short for a reset.
    car.run_until(101.0, true, |fix| Some(wrong(fix)));
    let after = car.navigator.health().fixes;
    assert!(after.outlier > before.outlier + 45, "{after:?}");
    assert_eq!(after.accepted, before.accepted);
}

#[test]
fn longitudes_from_zero_to_360_degrees_are_accepted() {
    let [plain, odd] = [false, true].map(|odd| {
        let of = |mut fix: GnssFix| {
            if odd {
                fix.position = fix.position.map(|place| LatLon {
                    longitude_rad: place.longitude_rad.rem_euclid(TAU),
                    ..place
                });
            }
            Some(fix)
        };
        let mut car = Car::new(bends);
        car.travelled_m.x = -1e4;
        car.run_until(60.0, true, of);
        let navigating = car.navigator.solution().unwrap().position;
        car.run_until(63.0, false, of);
        // Up to a fix, without a later sample.
        car.run_until(63.4, true, of);
        [navigating, car.navigator.solution().unwrap().position]
    });
    for (plain, odd) in plain.iter().zip(&odd) {
        assert!(plain.longitude_rad < 0.0);
        assert!(plain.enu_from(odd).norm() < 1e-3, "{plain:?} {odd:?}");
        assert!((plain.longitude_rad - odd.longitude_rad).abs() < 1e-9);
    }
}

#[test]
fn one_large_innovation_after_an_outage_causes_no_reset() {
    let mut car = Car::new(bends);
    car.run_until(200.0, true, Some);
    car.run_until(260.0, true, |_| None);
    let sigma = car.navigator.sigma().unwrap().velocity_mps;
    let error_mps = Vector2::new(6.0 * sigma.x, 0.0);
    car.run_until(260.2, true, |fix| {
        Some(GnssFix {
            velocity_en_mps: fix.velocity_en_mps.map(|velocity| velocity + error_mps),
            ..fix
        })
    });
    car.run_until(263.0, true, Some);
    let health = car.navigator.health();
    assert_eq!(
        (health.last_reset, health.restarts),
        (None, 0),
        "{health:?}"
    );
}

/// Rest, a right turn of 1.5 rad, and rest again before the first fix.
fn turning_before_the_first_fix(time_s: f64) -> (f64, f64, f64) {
    let turns = (4.0..14.0).contains(&time_s);
    (0.0, 0.0, if turns { 0.15 } else { 0.0 })
}

#[test]
fn a_given_heading_is_propagated_through_a_turn_before_levelling() {
    for first_fix_s in [16.0, 40.0] {
        let mut car = Car::new(turning_before_the_first_fix);
        car.navigator = Navigator::new(Config {
            heading: HeadingSource::Given(car.heading_rad),
            ..Config::mems()
        })
        .unwrap();
        car.run_until(60.0, true, |fix| {
            (fix.time >= Time::from_seconds(first_fix_s).unwrap()).then_some(fix)
        });
        let solution = car.navigator.solution().unwrap();
        let error_rad = wrap_pi(solution.euler().heading_rad - car.heading_rad);
        assert!(error_rad.abs() < 0.1, "{error_rad}");
    }
}

/// Out of a garage with a turn, and a gap before the first fix.
#[test]
fn a_given_heading_is_uncertain_after_a_turn_and_a_gap() {
    let mut car = Car::new(turning_before_the_first_fix);
    car.navigator = Navigator::new(Config {
        heading: HeadingSource::Given(car.heading_rad),
        ..Config::mems()
    })
    .unwrap();
    car.run_until(14.5, true, |_| None);
    car.run_until(17.0, false, |_| None);
    for count in 1700..6000 {
        car.run_until(STEP_S * f64::from(count), true, Some);
        if let Some(solution) = car.navigator.solution() {
            let error_rad = wrap_pi(solution.euler().heading_rad - car.heading_rad);
            let sigma_rad = car.navigator.sigma().unwrap().attitude_rad.z;
            assert!(error_rad.abs() < 3.0 * sigma_rad, "{error_rad} {sigma_rad}");
        }
    }
}

/// A receiver without vertical velocity, or one that writes zero for it, on a vehicle that climbs as
/// navigation begins.
#[test]
fn an_unmeasured_initial_climb_is_within_the_sigma() {
    assert_start_in_a_climb(|_| (20.0, 0.0, 0.0), None);
    assert_start_in_a_climb(|_| (0.8, 0.0, 0.0), Some(0.0));
}

fn assert_start_in_a_climb(drive: Drive, written: Option<f64>) {
    let mut car = Car::new(drive);
    car.navigator = Navigator::new(Config {
        heading: HeadingSource::Given(car.heading_rad),
        ..Config::mems()
    })
    .unwrap();
    let climbs_mps = 8.0;
    let climbing = |fix: GnssFix| {
        Some(GnssFix {
            velocity_up_mps: written,
            height_m: Some(climbs_mps * fix.time.seconds_since(Time::default())),
            ..fix
        })
    };
    for count in 1..3000 {
        car.run_until(STEP_S * f64::from(count), true, climbing);
        let Some(solution) = car.navigator.solution() else {
            continue;
        };
        let error_mps = solution.velocity_enu_mps.z - climbs_mps;
        let sigma_mps = car.navigator.sigma().unwrap().velocity_mps.z;
        assert!(error_mps.abs() < 4.0 * sigma_mps, "{error_mps} {sigma_mps}");
    }
    assert_eq!(car.navigator.phase(), Phase::Navigating);
}

#[test]
fn no_coasting_at_the_start_of_aided_navigation() {
    let mut car = Car::new(bends);
    for count in 1..10_000 {
        car.run_until(STEP_S * f64::from(count), true, Some);
        assert_eq!(car.navigator.health().coasting_since, None);
    }
    assert_eq!(car.navigator.phase(), Phase::Navigating);
}

#[test]
fn a_warm_start_corrects_from_the_first_sample_on() {
    let mut car = Car::new(|_| (0.0, 0.0, 0.0));
    let mut calibration = car.navigator.calibration();
    calibration.accel_bias_mps2[2].value = 0.2;
    calibration.accel_bias_mps2[2].sigma = 0.01;
    let config = Config {
        heading: HeadingSource::Given(car.heading_rad),
        ..Config::mems()
    };
    car.navigator = Navigator::warm(config, &calibration).unwrap();
    for count in 2..2000 {
        car.run_until(STEP_S * f64::from(count), true, Some);
        let force_mps2 = car.navigator.body_motion().unwrap().force_mps2.z;
        let error_mps2 = force_mps2 - (GRAVITY_MPS2 - 0.2);
        assert!(error_mps2.abs() < 0.05, "{error_mps2} after {count}");
    }
    assert_eq!(car.navigator.phase(), Phase::Navigating);
}

#[test]
fn a_calibration_may_lack_parameters_that_are_configured() {
    let calibration = Navigator::new(Config::mems()).unwrap().calibration();
    let mut config = Config::mems();
    config.gnss.latency_sigma_s = 0.0;
    let mut without = calibration;
    without.gnss_latency_s.sigma = 0.0;
    assert!(Navigator::warm(config, &without).is_ok());
    // Nor parameters that the configuration of the calibration did not estimate.
    let warm = Navigator::warm(Config::mems(), &without).unwrap();
    assert_eq!(
        warm.calibration().gnss_latency_s,
        calibration.gnss_latency_s
    );
    without.gnss_latency_s.sigma = -1.0;
    assert!(Navigator::warm(Config::mems(), &without).is_err());
}

/// A receiver without heights, and a gap with a realignment.
#[test]
fn unknown_height_stays_unknown_after_a_gap() {
    let mut car = Car::new(bends);
    let without_height = |fix| {
        Some(GnssFix {
            height_m: None,
            ..fix
        })
    };
    car.run_until(100.0, true, without_height);
    car.run_until(105.0, false, |_| None);
    for count in 1..600 {
        car.run_until(105.0 + 0.1 * f64::from(count), true, without_height);
        let height_m = car.navigator.sigma().unwrap().position_m.z;
        assert!(height_m > 1000.0, "{height_m}");
    }
    assert_eq!(car.navigator.health().restarts, 1);
}

/// One position at first, and velocities alone after it.
#[test]
fn position_is_propagated_by_velocities_during_alignment() {
    let straight_at_first: Drive = |time_s| {
        let t = (time_s - 40.0).max(0.0);
        let push = if t > 0.0 { 0.5 * (0.25 * t).cos() } else { 0.0 };
        (20.0 + 2.0 * (0.25 * t).sin(), push, 0.2 * (0.35 * t).sin())
    };
    for gap_s in [0.0, 20.0] {
        let mut car = Car::new(straight_at_first);
        let mut position_given = false;
        while car.navigator.phase() != Phase::Navigating {
            assert!(car.time_s() < 200.0);
            let (until_s, time_s) = (car.time_s() + 0.2, car.time_s());
            let hidden = (30.0..30.0 + gap_s).contains(&time_s);
            car.run_until(until_s, true, |fix| {
                (!hidden).then_some(GnssFix {
                    position: fix.position.filter(|_| !position_given),
                    ..fix
                })
            });
            position_given |= time_s > 1.0;
        }
        assert!(car.travelled_m.norm() > 700.0);
        let (error_m, sigma_m) = (
            car.error_m().xy(),
            car.navigator.sigma().unwrap().position_m.x,
        );
        assert!(error_m.norm() < 3.0 * sigma_m, "{error_m} {sigma_m}");
        assert!(gap_s > 0.0 || error_m.norm() < 30.0, "{error_m}");
    }
}

/// At 200 m/s a latency error of 0.1 s is 20 m, and the latency is not yet observable.
#[test]
fn position_sigma_covers_an_unknown_latency_from_the_start() {
    for late_s in [0.3, -0.1] {
        let mut car = Car::new(|time_s| {
            let phase = 0.25 * time_s;
            (
                200.0 + 8.0 * phase.sin(),
                2.0 * phase.cos(),
                0.02 * phase.sin(),
            )
        });
        let late = |fix: GnssFix| {
            let time = fix.time.plus_seconds(late_s);
            Some(GnssFix { time, ..fix })
        };
        while car.navigator.phase() != Phase::Navigating {
            assert!(car.time_s() < 200.0);
            car.run_until(car.time_s() + 0.1, true, late);
        }
        for _ in 0..50 {
            car.run_until(car.time_s() + 0.1, true, late);
            let (error_m, sigma) = (car.error_m(), car.navigator.sigma().unwrap());
            for (error_m, sigma_m) in error_m.iter().zip(&sigma.position_m) {
                assert!(error_m.abs() < 3.0 * sigma_m, "{error_m} {sigma:?}");
            }
        }
    }
}

/// A turn that slows to a third after 100 s.
fn slowing_turn(time_s: f64) -> (f64, f64, f64) {
    let (speed, accel, turn) = steady_turns(time_s.min(89.0));
    let turn = match time_s {
        ..90.0 => turn,
        ..100.4 => 0.3,
        _ => 0.1,
    };
    (speed, accel, turn)
}

/// 0.8 s of a turn are lost, without GNSS.
#[test]
fn heading_sigma_covers_motion_hidden_by_a_clock_set_back() {
    for motion in [steady_turns, slowing_turn] {
        covers_motion_hidden_by_a_clock_set_back(motion);
    }
}

fn covers_motion_hidden_by_a_clock_set_back(motion: fn(f64) -> (f64, f64, f64)) {
    let mut car = Car::new(motion);
    car.run_until(100.0, true, Some);
    let before_rad = car.navigator.sigma().unwrap().attitude_rad.z;
    car.clock_s = -0.8;
    car.run_until(100.9, true, |_| None);
    let after_rad = car.navigator.sigma().unwrap().attitude_rad.z;
    let hidden_rad = car.heading_rad - car.navigator.solution().unwrap().euler().heading_rad;
    assert!(after_rad > 10.0 * before_rad, "{before_rad} {after_rad}");
    assert!(
        wrap_pi(hidden_rad).abs() < 3.0 * after_rad,
        "{hidden_rad} {after_rad}"
    );
    let level_error_m = |car: &Car| {
        let sigma_m = car.navigator.sigma().unwrap().position_m;
        (car.error_m().xy().norm(), sigma_m.x)
    };
    let (error_m, sigma_m) = level_error_m(&car);
    assert!(error_m < 2.0 * sigma_m, "{error_m} {sigma_m}");
    // And fixes, on the same clock, put it right.
    car.run_until(130.0, true, |fix| {
        let time = fix.time.plus_seconds(-0.8);
        Some(GnssFix { time, ..fix })
    });
    let (error_m, sigma_m) = level_error_m(&car);
    assert!(
        error_m < 3.0 && error_m < 3.0 * sigma_m,
        "{error_m} {sigma_m}"
    );
}

/// Ten velocities a second, and late positions in fixes between them.
#[test]
fn the_delay_of_separate_position_fixes_is_estimated() {
    let mut car = Car::new(bends);
    let late = 40_u8;
    let late_s = STEP_S * f64::from(late);
    let (mut delayed_fixes, mut count) = (std::collections::VecDeque::new(), 0);
    while car.time_s() < 300.0 {
        let until_s = car.time_s() + STEP_S;
        car.run_until(until_s, true, |_| None);
        delayed_fixes.push_back(car.fix());
        if delayed_fixes.len() > 1 + usize::from(late) {
            delayed_fixes.pop_front();
        }
        count += 1;
        let fix = match count % 20 {
            0 | 10 => GnssFix {
                position: None,
                height_m: None,
                ..car.fix()
            },
            5 => GnssFix {
                velocity_en_mps: None,
                velocity_up_mps: None,
                time: car.time(),
                ..*delayed_fixes.front().unwrap()
            },
            _ => continue,
        };
        let _ = car.navigator.on_gnss(&fix);
    }
    let delay = car.navigator.estimates().gnss_position_delay_s;
    assert!(
        (delay.value - late_s).abs() < 4.0 * delay.sigma,
        "{delay:?}"
    );
    let (error_m, sigma_m) = (car.error_m(), car.navigator.sigma().unwrap().position_m.x);
    assert!(error_m.xy().norm() < 3.0 * sigma_m, "{error_m} {sigma_m}");
}

/// Without heights: the decrease of gravity with height must not be used to estimate height.
#[test]
fn unknown_height_does_not_drift() {
    let mut car = Car::new(bends);
    car.up_bias_mps2 = 0.2;
    car.run_until(300.0, true, |fix| {
        Some(GnssFix {
            height_m: None,
            // All zeros would be ignored.
            velocity_up_mps: Some(0.0004 * fix.velocity_enu_mps().x),
            ..fix
        })
    });
    let height_m = car.navigator.solution().unwrap().position.height_m;
    assert!(height_m.abs() < 200.0, "{height_m}");
    assert!(car.navigator.sigma().unwrap().position_m.z > 5000.0);
}

/// A turn since the last fix rotates the velocity with the error of the heading.
#[test]
fn velocity_sigma_includes_the_heading_error_since_the_last_fix() {
    let mut car = Car::new(bends);
    car.run_until(60.0, true, Some);
    let [before, after] = [0.0, 0.8].map(|seconds| {
        let mut car = car.clone();
        car.drive = |_| (12.0, 0.0, 1.5);
        car.run_until(60.0 + seconds, true, |_| None);
        car.navigator.sigma().unwrap()
    });
    // By 1.2 rad: a chord of 13.6 m/s.
    let turned_mps = 13.6 * before.attitude_rad.z;
    let square = |sigma: &SolutionSigma| sigma.velocity_mps.xy().norm_squared();
    let grown = square(&after) - square(&before);
    assert!(grown > turned_mps * turned_mps, "{before:?} {after:?}");
}
