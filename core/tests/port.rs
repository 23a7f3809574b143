//! What a port feeds, and no recording holds.
#![allow(clippy::disallowed_methods, clippy::unwrap_used, clippy::expect_used)] // Reference values.

use std::cell::Cell;
use std::f64::consts::TAU;

use ins_core::config::HeadingSource;
use ins_core::earth::{Geodetic, LatLon, wrap_pi};
use ins_core::{
    Config, FixSigma, GnssFix, GnssOutcome, Heading, ImuOutcome, ImuSample, Navigator, Phase,
    SolutionSigma, Time,
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
    way_m: Vector2<f64>,
    /// What the upper accelerometer reads of the right one.
    askew: f64,
    /// Its bias, and how fast that grows, m/s^2 and m/s^3.
    up_bias_mps2: f64,
    warming: f64,
    /// What the clock of the inertial sensors is set to beyond the time, s.
    clock_s: f64,
    navigator: Navigator,
}

impl Car {
    fn new(drive: Drive) -> Self {
        Self {
            drive,
            count: 0,
            heading_rad: 0.4,
            way_m: Vector2::zeros(),
            askew: 0.0,
            up_bias_mps2: 0.0,
            warming: 0.0,
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

    /// A fix of now, rounded as receivers do.
    fn fix(&self) -> GnssFix {
        let round = |v: f64| (v * 20.0).round() / 20.0;
        let velocity_mps = self.velocity_mps().map(round);
        GnssFix {
            time: self.time(),
            velocity_en_mps: Some(velocity_mps),
            ..GnssFix::default()
        }
        .at(&Geodetic {
            latitude_rad: self.way_m.y / 6.336e6,
            longitude_rad: self.way_m.x / 6.378e6,
            // A row of zeros would be none.
            height_m: 1.0,
        })
    }

    /// Drives on until a time, with five fixes a second of those parts that `of` leaves.
    fn until(&mut self, time_s: f64, sampled: bool, of: impl Fn(GnssFix) -> Option<GnssFix>) {
        while self.time_s() < time_s {
            self.count += 1;
            let (speed, accel, turn) = (self.drive)(self.time_s());
            self.heading_rad += STEP_S * turn;
            self.way_m += STEP_S * self.velocity_mps();
            if sampled {
                let warmed = self.up_bias_mps2 + self.warming * self.time_s();
                let up_off_mps2 = self.askew * speed * turn + warmed;
                let _ = self.navigator.on_imu(&ImuSample {
                    time: self.time().plus_seconds(self.clock_s),
                    gyro: Vector3::new(2e-3, -3e-3, 4e-3 - turn),
                    accel: Vector3::new(speed * turn, accel, GRAVITY_MPS2 + up_off_mps2),
                });
            }
            if self.count.is_multiple_of(20)
                && let Some(fix) = of(self.fix())
            {
                let _ = self.navigator.on_gnss(&fix);
            }
        }
    }

    fn off_m(&self) -> Vector3<f64> {
        let own = self.navigator.solution().unwrap().position;
        own.enu_from(&self.fix().geodetic_or(0.0).unwrap())
    }
}

#[test]
fn a_height_may_be_known_before_the_position() {
    let mut car = Car::new(bends);
    car.until(1.0, true, |fix| {
        Some(GnssFix {
            height_m: Some(2500.0),
            position: None,
            velocity_en_mps: None,
            ..fix
        })
    });
    car.until(60.0, true, |fix| {
        Some(GnssFix {
            height_m: None,
            ..fix
        })
    });
    assert_eq!(car.navigator.phase(), Phase::Navigating);
    let off_m = car.off_m().z - 2500.0;
    assert!(off_m.abs() < 100.0, "{off_m}");
}

#[test]
fn what_is_left_after_a_hole_is_less_known_with_time() {
    // A short one while coasting, and a long one just after a fix.
    for (coasts_until_s, hole_until_s) in [(100.0, 103.0), (90.0, 150.0)] {
        let mut car = Car::new(bends);
        car.until(90.0, true, Some);
        car.until(coasts_until_s, true, |_| None);
        car.until(hole_until_s, false, |_| None);
        for since_s in [0.1, 7.0, 27.0, 57.0] {
            car.until(hole_until_s + since_s, true, |_| None);
            let (off_m, sigma) = (car.off_m(), car.navigator.sigma().unwrap());
            let honest = off_m.iter().zip(&sigma.position_m);
            assert!(
                honest
                    .into_iter()
                    .all(|(off, sigma)| off.abs() < 3.0 * sigma),
                "{off_m} {sigma:?}"
            );
        }
        car.until(hole_until_s + 59.0, true, Some);
        assert!(car.navigator.sigma().unwrap().position_m.x < 40.0);
    }
}

/// Stands, starts, and drives in even bends on a smooth road.
fn even_bends(time_s: f64) -> (f64, f64, f64) {
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
fn an_even_turn_that_no_fix_sees_is_no_gyro_bias() {
    let mut car = Car::new(even_bends);
    car.until(9.0, true, Some);
    car.until(80.0, true, |_| None);
    let known = car.navigator.estimates().gyro_bias_radps[2];
    assert!((known.value - 4e-3).abs() < 3.0 * known.sigma, "{known:?}");
    car.until(140.0, true, Some);
    let heading_rad = car.navigator.solution().unwrap().euler().heading_rad;
    let off_rad = wrap_pi(heading_rad - car.heading_rad);
    assert!(off_rad.abs() < 0.05, "{off_rad}");
}

#[test]
fn what_a_hole_hides_is_doubted_where_it_was() {
    let mut car = Car::new(bends);
    for start_s in [100.0, 137.0, 174.0, 211.0] {
        car.until(start_s, true, Some);
        car.until(start_s + 1.9, false, Some);
        car.until(start_s + 2.0, true, Some);
        for tenth in 1..200 {
            car.until(start_s + 2.0 + 0.1 * f64::from(tenth), true, Some);
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

#[test]
fn a_latency_that_jumps_is_found_again() {
    let mut car = Car::new(bends);
    car.until(100.0, true, Some);
    for late_s in [0.5, -0.3] {
        let until_s = car.time_s() + 60.0;
        car.until(until_s, true, |fix| {
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

#[test]
fn what_is_known_grows_old_where_nothing_is_seen() {
    let mut car = Car::new(bends);
    car.until(100.0, true, Some);
    let known = car.navigator.estimates().gyro_bias_radps;
    car.until(4100.0, false, |_| None);
    car.until(4103.0, true, |_| None);
    assert_ne!(car.navigator.phase(), Phase::Navigating);
    let walked = Config::mems().sensors.gyro_bias_walk.powi(2) * 3600.0;
    for (before, now) in known.iter().zip(car.navigator.estimates().gyro_bias_radps) {
        let expected = before.sigma.powi(2) + walked;
        assert!((now.sigma.powi(2) / expected - 1.0).abs() < 0.01, "{now:?}");
    }
}

#[test]
fn bursts_of_wrong_heights_throw_nothing_away() {
    let mut car = Car::new(bends);
    car.until(100.0, true, Some);
    let known = car.navigator.estimates().gyro_bias_radps[0].sigma;
    for start_s in [100.0, 135.0] {
        car.until(start_s + 10.0, true, |fix| {
            Some(GnssFix {
                height_m: fix.height_m.map(|height_m| height_m + 60.0),
                ..fix
            })
        });
        car.until(start_s + 35.0, true, Some);
        let off_m = car.off_m().z;
        assert!(off_m.abs() < 2.0, "{off_m}");
    }
    assert_eq!(car.navigator.health().restarts, 0);
    assert!(car.navigator.estimates().gyro_bias_radps[0].sigma <= known);
}

#[test]
fn a_position_that_is_given_again_measures_nothing() {
    let mut car = Car::new(bends);
    // As some write five lines of each second.
    let last = Cell::new(None);
    car.until(120.0, true, |fix| {
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
    // Four of five, since it navigates.
    assert!(fixes.repeated > 250, "{fixes:?}");
    assert_eq!(car.navigator.health().restarts, 0);
}

#[test]
fn a_heading_may_come_before_the_sample_of_its_moment() {
    let mut car = Car::new(bends);
    car.until(90.0, true, Some);
    for _ in 0..50 {
        let until_s = car.time_s() + 0.2;
        car.until(until_s, true, Some);
        let (_, _, turn) = (car.drive)(car.time_s());
        let outcome = car.navigator.on_heading(&Heading {
            time: car.time().plus_seconds(0.02),
            heading_rad: car.heading_rad + 0.02 * turn,
            sigma_rad: 1e-3,
        });
        assert_eq!(outcome, GnssOutcome::Accepted);
    }
    let heading_rad = car.navigator.solution().unwrap().euler().heading_rad;
    let off_rad = wrap_pi(heading_rad - car.heading_rad);
    // Fifty of 1e-3 are known to that; a stamp that is not believed makes 4e-3.
    assert!(off_rad.abs() < 2e-3, "{off_rad}");
}

#[test]
fn loops_of_any_damping_are_stable() {
    let mut car = Car::new(bends);
    let mut config = Config::mems();
    config.damping.horizontal.damping_ratio = 20.0;
    config.damping.vertical.damping_ratio = 20.0;
    car.navigator = Navigator::new(config).unwrap();
    car.until(150.0, true, Some);
    let off_mps = car.navigator.mechanization().unwrap().velocity_enu_mps.xy() - car.velocity_mps();
    assert!(off_mps.norm() < 0.2, "{off_mps}");
}

/// Some state tens of metres a second, always.
#[test]
fn what_a_receiver_states_does_not_keep_the_heading_from_being_found() {
    let mut car = Car::new(bends);
    car.until(60.0, true, |fix| {
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

/// A factor of 1e30, by a slip of units: its square is more than single precision holds.
#[test]
fn what_is_too_large_to_reckon_with_is_refused() {
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
fn each_fix_has_an_outcome_when_it_is_aligned_anew() {
    let mut car = Car::new(bends);
    car.until(90.0, true, Some);
    // Fixes go on while samples are missing.
    for tenth in 1..100 {
        let sampled = !(30..70).contains(&tenth);
        car.until(90.0 + 0.1 * f64::from(tenth), sampled, |_| None);
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
fn with_heights_alone_the_level_coasts() {
    let mut car = Car::new(bends);
    car.until(90.0, true, Some);
    car.until(100.0, true, |fix| {
        Some(GnssFix {
            position: None,
            velocity_en_mps: None,
            ..fix
        })
    });
    let since_s = car.navigator.health().coasting_since.unwrap().as_seconds();
    assert!((90.0..91.0).contains(&since_s), "{since_s}");
}

/// Stands, starts, and drives in circles.
fn circles(time_s: f64) -> (f64, f64, f64) {
    let (speed, accel, _) = bends(time_s);
    (speed, accel, if time_s < 18.0 { 0.0 } else { 0.25 })
}

#[test]
fn a_sigma_of_minus_one_states_nothing() {
    let drive = |sigma: Option<f64>| {
        let mut car = Car::new(bends);
        let sigma = FixSigma {
            position_m: sigma,
            height_m: sigma,
            velocity_mps: sigma,
            velocity_up_mps: sigma,
        };
        car.until(100.0, true, |fix| Some(GnssFix { sigma, ..fix }));
        (car.navigator.solution().unwrap(), car.navigator.sigma())
    };
    let silent = drive(None);
    assert_eq!(drive(Some(-1.0)), silent);
    assert_ne!(drive(Some(1.0)), silent);
}

/// As after a cold start: far off, as the receiver says, until it has a fix.
#[test]
fn positions_that_say_they_are_far_off_are_believed_as_far() {
    for (off_m, sigma_m) in [(1e3, 1e3), (2e4, 1e4), (6.4e6, 4.3e6)] {
        let mut config = Config::mems();
        config.heading = HeadingSource::Given(0.4);
        let mut car = Car::new(|_| (0.0, 0.0, 0.0));
        car.navigator = Navigator::new(config).unwrap();
        let cold = |mut fix: GnssFix| {
            if let Some(position) = fix.position.as_mut() {
                position.longitude_rad += off_m / 6.378e6;
            }
            fix.sigma.position_m = Some(sigma_m);
            Some(fix)
        };
        car.until(30.0, true, cold);
        if sigma_m < 1e5 {
            let stated_m = car.navigator.sigma().unwrap().position_m.x;
            assert!(stated_m > 0.4 * sigma_m, "{stated_m} m, stated {sigma_m} m");
        }
        car.until(40.0, true, Some);
        let (off_m, sigma) = (car.off_m(), car.navigator.sigma().unwrap());
        assert!(off_m.norm() < 10.0, "{off_m} m, stated {sigma:?}");
    }
}

/// As of a memory that remembers another town, and does not say so.
#[test]
fn an_ins_that_was_put_elsewhere_is_put_right() {
    for off_m in [2e3, 1e4, 1e5] {
        let mut config = Config::mems();
        config.heading = HeadingSource::Given(0.4);
        let mut car = Car::new(|t| bends(t - 60.0));
        car.navigator = Navigator::new(config).unwrap();
        let elsewhere = |mut fix: GnssFix| {
            if let Some(position) = fix.position.as_mut() {
                position.longitude_rad += off_m / 6.378e6;
            }
            Some(fix)
        };
        car.until(30.0, true, elsewhere);
        assert!(car.off_m().norm() > 0.9 * off_m);
        // Two a second count: after three they are in dispute, after fifteen seconds believed.
        car.until(33.0, true, Some);
        while car.time_s() < 150.0 {
            car.until(car.time_s() + 0.5, true, Some);
            let (off_m, sigma) = (car.off_m(), car.navigator.sigma().unwrap().position_m);
            let sure = off_m.norm() > 5.0 * sigma.norm();
            assert!(!sure, "at {} s {off_m} m, stated {sigma} m", car.time_s());
            if car.time_s() > 60.0 {
                assert!(off_m.norm() < 30.0, "at {} s {off_m} m", car.time_s());
            }
        }
    }
}

/// What receivers write where they have no fix: the largest number of millimetres.
#[test]
fn a_part_that_may_be_anything_is_missing() {
    let nothing = Some(4_294_967.0);
    let mut car = Car::new(bends);
    car.until(50.0, true, Some);
    let mut other = car.navigator.clone();
    let mut fix = car.fix();
    fix.sigma.position_m = nothing;
    let without = GnssFix {
        position: None,
        sigma: FixSigma::default(),
        ..fix
    };
    assert_eq!(car.navigator.on_gnss(&fix), other.on_gnss(&without));
    assert_eq!(car.navigator, other);
    fix.sigma = FixSigma {
        position_m: nothing,
        height_m: nothing,
        velocity_mps: nothing,
        velocity_up_mps: nothing,
    };
    assert_eq!(car.navigator.on_gnss(&fix), GnssOutcome::Empty);
}

/// What is given meanwhile has gone on over a hole that is too long to bridge.
#[test]
fn a_hole_is_gone_through_at_the_speed_before_it() {
    let mut car = Car::new(|t| {
        let (speed, accel, turn) = bends(t);
        (4.0 * speed, 4.0 * accel, 0.2 * turn)
    });
    car.until(100.0, true, Some);
    assert_eq!(car.navigator.phase(), Phase::Navigating);
    car.until(104.0, false, |_| None);
    car.until(104.2, true, |_| None);
    assert_ne!(car.navigator.phase(), Phase::Navigating);
    let place = car.navigator.solution().unwrap().position;
    let off_m = place
        .enu_from(&car.fix().geodetic_or(0.0).unwrap())
        .xy()
        .norm();
    let sigma_m = car.navigator.sigma().unwrap().position_m.x;
    assert!(off_m < 2.0 * sigma_m, "{off_m} {sigma_m}");
}

/// Coasting, and then on another clock, it is known no better than before.
#[test]
fn a_clock_that_is_set_back_makes_nothing_younger() {
    let mut car = Car::new(bends);
    car.until(100.0, true, Some);
    car.until(160.0, true, |_| None);
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

/// A receiver of positions alone, on a vehicle that is under way and whose heading is given.
#[test]
fn a_speed_that_positions_show_is_begun_with() {
    let mut car = Car::new(|_| (20.0, 0.0, 0.0));
    car.navigator = Navigator::new(Config {
        heading: HeadingSource::Given(car.heading_rad),
        ..Config::mems()
    })
    .unwrap();
    let position_alone = |fix: GnssFix| {
        Some(GnssFix {
            velocity_en_mps: None,
            ..fix
        })
    };
    while car.navigator.phase() != Phase::Navigating {
        assert!(car.time_s() < 60.0);
        let until_s = car.time_s() + STEP_S;
        car.until(until_s, true, position_alone);
    }
    let velocity_mps = car.navigator.solution().unwrap().velocity_enu_mps.xy();
    let off_mps = (velocity_mps - car.velocity_mps()).norm();
    let sigma_mps = car.navigator.sigma().unwrap().velocity_mps.x;
    assert!(off_mps < 3.0 * sigma_mps, "{off_mps} {sigma_mps}");
}

/// Two antennas agree once a second, and each heading comes a tenth of one late.
#[test]
fn headings_once_a_second_that_come_late_end_the_search() {
    let mut car = Car::new(|_| (0.0, 0.0, 0.0));
    car.until(30.0, true, Some);
    assert_eq!(car.navigator.phase(), Phase::FindingHeading);
    while car.navigator.phase() != Phase::Navigating {
        assert!(car.time_s() < 50.0, "{:?}", car.navigator.phase());
        let heading = Heading {
            time: car.time(),
            heading_rad: car.heading_rad,
            sigma_rad: 0.02,
        };
        let second_s = car.time_s() + 1.0;
        car.until(second_s - 0.9, true, Some);
        let _ = car.navigator.on_heading(&heading);
        car.until(second_s, true, Some);
    }
}

/// In a turn from the beginning, of which each measured heading comes most of a second late.
#[test]
fn a_late_heading_is_turned_on_while_levelling() {
    let mut car = Car::new(|_| (6.0, 0.0, 0.3));
    let mut headings = Vec::new();
    while car.navigator.phase() != Phase::Navigating {
        assert!(car.time_s() < 60.0, "{:?}", car.navigator.phase());
        let until_s = car.time_s() + 0.1;
        car.until(until_s, true, Some);
        headings.push(Heading {
            time: car.time(),
            heading_rad: wrap_pi(car.heading_rad),
            sigma_rad: 0.01,
        });
        if let Some(late) = headings.iter().rev().nth(8) {
            let _ = car.navigator.on_heading(late);
        }
    }
    let off_rad = wrap_pi(car.navigator.solution().unwrap().euler().heading_rad - car.heading_rad);
    assert!(off_rad.abs() < 0.05, "{off_rad}");
}

#[test]
fn accelerometers_that_stand_askew_show_it_in_turns_to_one_side() {
    let mut car = Car::new(circles);
    car.askew = 0.01;
    car.until(200.0, true, Some);
    let known = car.navigator.estimates().accel_bias_mps2[2];
    assert!(known.value.abs() < 4.0 * known.sigma, "{known:?}");
}

/// The line of the antennas is three degrees off the forward axis, or the front one is the rear one.
#[test]
fn headings_that_manoeuvres_contradict_are_not_believed() {
    for (off_rad, sigma_rad, least_s) in [(0.05, 0.01, 200.0), (3.1, 0.01, 80.0)] {
        let mut car = Car::new(bends);
        while car.time_s() < 300.0 {
            let until_s = car.time_s() + 0.2;
            car.until(until_s, true, Some);
            let heading_rad = wrap_pi(car.heading_rad + off_rad);
            let _ = car.navigator.on_heading(&Heading {
                time: car.time(),
                heading_rad,
                sigma_rad,
            });
            if let Some(solution) = car.navigator.solution()
                && car.time_s() > least_s
            {
                let off_rad = wrap_pi(solution.euler().heading_rad - car.heading_rad);
                let sigma_rad = car.navigator.sigma().unwrap().attitude_rad.z;
                let known = off_rad.abs() < 4.5 * sigma_rad;
                assert!(known, "{} {off_rad} {sigma_rad}", car.time_s());
            }
        }
        assert_eq!(car.navigator.phase(), Phase::Navigating);
    }
}

/// Of a bias that walks as no data sheet has it the innovations go on as the ones before.
#[test]
fn innovations_that_go_on_as_those_before_widen_what_they_are_of() {
    let mut car = Car::new(bends);
    car.warming = 1e-3;
    let mut worst: f64 = 0.0;
    while car.time_s() < 300.0 {
        let until_s = car.time_s() + 1.0;
        car.until(until_s, true, Some);
        if car.time_s() > 60.0 {
            let up_mps = car.navigator.solution().unwrap().velocity_enu_mps.z;
            let sigma_mps = car.navigator.sigma().unwrap().velocity_mps.z;
            worst = worst.max(up_mps.abs() / sigma_mps);
        }
    }
    // A bias that walks ten times as fast as configured; 13 with the variance that whiteness would leave.
    assert!(worst < 8.0, "{worst}");
}

#[test]
fn a_level_that_a_hole_has_tipped_is_not_kept() {
    // While navigating, and while looking for the heading anew.
    for before in [vec![], vec![92.5, 94.0]] {
        let mut car = Car::new(bends);
        car.until(90.0, true, Some);
        let mut samples = false;
        for until_s in before {
            car.until(until_s, samples, |_| None);
            samples = true;
        }
        assert!(car.navigator.solution().is_some());
        car.until(car.time_s() + 2.5, false, Some);
        assert!(car.navigator.body_motion().is_some());
        // The unit lies on its side.
        for count in 0..50 {
            let time = car.time().plus_seconds(STEP_S * f64::from(count));
            let outcome = car.navigator.on_imu(&ImuSample {
                time,
                gyro: Vector3::new(2e-3, -3e-3, 4e-3),
                accel: Vector3::new(GRAVITY_MPS2, 0.0, 0.0),
            });
            // What was felt before the hole is not felt now.
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
fn rest_before_a_way_that_nothing_has_seen_tells_no_level_after_it() {
    let config = Config {
        heading: HeadingSource::Given(0.0),
        ..Config::mems()
    };
    let mut navigator = Navigator::new(config).unwrap();
    let mut pitch_rad = 0.0_f64;
    for count in 0..5000 {
        let time_s = STEP_S * f64::from(count);
        // Stands, is carried up a ramp, and stands there.
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
            let off_rad = solution.euler().pitch_rad - pitch_rad;
            assert!(off_rad.abs() < 0.02, "{off_rad} at {time_s} s");
        }
    }
    assert_eq!(navigator.phase(), Phase::Navigating);
}

#[test]
fn a_vertical_that_is_assumed_is_no_fix_that_was_taken() {
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
    car.until(90.0, true, |fix| Some(level(fix)));
    // Those that were on their way.
    car.until(90.5, true, |fix| Some(wrong(fix)));
    let before = car.navigator.health().fixes;
    // For less long than shows that it is the INS which is wrong.
    car.until(101.0, true, |fix| Some(wrong(fix)));
    let after = car.navigator.health().fixes;
    assert!(after.outlier > before.outlier + 45, "{after:?}");
    assert_eq!(after.accepted, before.accepted);
}

#[test]
fn longitudes_from_zero_are_understood() {
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
        car.way_m.x = -1e4;
        car.until(60.0, true, of);
        let navigating = car.navigator.solution().unwrap().position;
        car.until(63.0, false, of);
        // Up to a fix, and no sample further.
        car.until(63.4, true, of);
        [navigating, car.navigator.solution().unwrap().position]
    });
    for (plain, odd) in plain.iter().zip(&odd) {
        assert!(plain.longitude_rad < 0.0);
        assert!(plain.enu_from(odd).norm() < 1e-3, "{plain:?} {odd:?}");
        assert!((plain.longitude_rad - odd.longitude_rad).abs() < 1e-9);
    }
}

#[test]
fn one_surprising_fix_after_an_outage_is_no_surprise_that_lasts() {
    let mut car = Car::new(bends);
    car.until(200.0, true, Some);
    car.until(260.0, true, |_| None);
    let sigma = car.navigator.sigma().unwrap().velocity_mps;
    let off_mps = Vector2::new(6.0 * sigma.x, 0.0);
    car.until(260.2, true, |fix| {
        Some(GnssFix {
            velocity_en_mps: fix.velocity_en_mps.map(|velocity| velocity + off_mps),
            ..fix
        })
    });
    car.until(263.0, true, Some);
    let health = car.navigator.health();
    assert_eq!(
        (health.last_reset, health.restarts),
        (None, 0),
        "{health:?}"
    );
}

/// Stands, turns to the right by 1.5 rad, and stands again before the first fix.
fn turns_first(time_s: f64) -> (f64, f64, f64) {
    let turns = (4.0..14.0).contains(&time_s);
    (0.0, 0.0, if turns { 0.15 } else { 0.0 })
}

#[test]
fn a_turn_before_levelling_is_in_a_heading_that_was_given_for_the_beginning() {
    for first_fix_s in [16.0, 40.0] {
        let mut car = Car::new(turns_first);
        car.navigator = Navigator::new(Config {
            heading: HeadingSource::Given(car.heading_rad),
            ..Config::mems()
        })
        .unwrap();
        car.until(60.0, true, |fix| {
            (fix.time >= Time::from_seconds(first_fix_s).unwrap()).then_some(fix)
        });
        let solution = car.navigator.solution().unwrap();
        let off_rad = wrap_pi(solution.euler().heading_rad - car.heading_rad);
        assert!(off_rad.abs() < 0.1, "{off_rad}");
    }
}

/// Out of a garage by a turn, and a hole before the first fix.
#[test]
fn a_heading_given_before_a_turn_and_a_hole_is_not_that_of_now() {
    let mut car = Car::new(turns_first);
    car.navigator = Navigator::new(Config {
        heading: HeadingSource::Given(car.heading_rad),
        ..Config::mems()
    })
    .unwrap();
    car.until(14.5, true, |_| None);
    car.until(17.0, false, |_| None);
    for count in 1700..6000 {
        car.until(STEP_S * f64::from(count), true, Some);
        if let Some(solution) = car.navigator.solution() {
            let off_rad = wrap_pi(solution.euler().heading_rad - car.heading_rad);
            let sigma_rad = car.navigator.sigma().unwrap().attitude_rad.z;
            assert!(off_rad.abs() < 3.0 * sigma_rad, "{off_rad} {sigma_rad}");
        }
    }
}

/// A receiver without vertical velocity, or one that writes zero for it, on a vehicle that climbs as
/// navigation begins.
#[test]
fn a_climb_that_nothing_tells_at_first_is_not_taken_for_none() {
    begins_in_a_climb(|_| (20.0, 0.0, 0.0), None);
    begins_in_a_climb(|_| (0.8, 0.0, 0.0), Some(0.0));
}

fn begins_in_a_climb(drive: Drive, written: Option<f64>) {
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
        car.until(STEP_S * f64::from(count), true, climbing);
        let Some(solution) = car.navigator.solution() else {
            continue;
        };
        let off_mps = solution.velocity_enu_mps.z - climbs_mps;
        let sigma_mps = car.navigator.sigma().unwrap().velocity_mps.z;
        assert!(off_mps.abs() < 4.0 * sigma_mps, "{off_mps} {sigma_mps}");
    }
    assert_eq!(car.navigator.phase(), Phase::Navigating);
}

#[test]
fn an_ins_with_fixes_does_not_coast_as_it_begins() {
    let mut car = Car::new(bends);
    for count in 1..10_000 {
        car.until(STEP_S * f64::from(count), true, Some);
        assert_eq!(car.navigator.health().coasting_since, None);
    }
    assert_eq!(car.navigator.phase(), Phase::Navigating);
}

/// What a warm start knows of the accelerometers is in what an autopilot is told from the first sample on.
#[test]
fn a_warm_start_does_not_step() {
    let mut stands = Car::new(|_| (0.0, 0.0, 0.0));
    let mut calibration = stands.navigator.calibration();
    calibration.accel_bias_mps2[2].value = 0.2;
    calibration.accel_bias_mps2[2].sigma = 0.01;
    let config = Config {
        heading: HeadingSource::Given(stands.heading_rad),
        ..Config::mems()
    };
    stands.navigator = Navigator::warm(config, &calibration).unwrap();
    for count in 2..2000 {
        stands.until(STEP_S * f64::from(count), true, Some);
        let felt_mps2 = stands.navigator.body_motion().unwrap().force_mps2.z;
        let off_mps2 = felt_mps2 - (GRAVITY_MPS2 - 0.2);
        assert!(off_mps2.abs() < 0.05, "{off_mps2} after {count}");
    }
    assert_eq!(stands.navigator.phase(), Phase::Navigating);
}

#[test]
fn a_calibration_need_not_say_what_the_configuration_gives() {
    let calibration = Navigator::new(Config::mems()).unwrap().calibration();
    let mut config = Config::mems();
    config.gnss.latency_sigma_s = 0.0;
    let mut without = calibration;
    without.gnss_latency_s.sigma = 0.0;
    assert!(Navigator::warm(config, &without).is_ok());
    // Nor what another configuration did not seek.
    let warm = Navigator::warm(Config::mems(), &without).unwrap();
    assert_eq!(
        warm.calibration().gnss_latency_s,
        calibration.gnss_latency_s
    );
    without.gnss_latency_s.sigma = -1.0;
    assert!(Navigator::warm(Config::mems(), &without).is_err());
}

/// A receiver without heights, and a hole after which it is aligned anew.
#[test]
fn a_hole_makes_no_height_known_that_was_not() {
    let mut car = Car::new(bends);
    let without_height = |fix| {
        Some(GnssFix {
            height_m: None,
            ..fix
        })
    };
    car.until(100.0, true, without_height);
    car.until(105.0, false, |_| None);
    for count in 1..600 {
        car.until(105.0 + 0.1 * f64::from(count), true, without_height);
        let height_m = car.navigator.sigma().unwrap().position_m.z;
        assert!(height_m > 1000.0, "{height_m}");
    }
    assert_eq!(car.navigator.health().restarts, 1);
}

/// A position that is known before, as one fix, and velocities alone after it.
#[test]
fn a_place_that_is_left_while_aligning_is_followed() {
    let straight_at_first: Drive = |time_s| {
        let t = (time_s - 40.0).max(0.0);
        let push = if t > 0.0 { 0.5 * (0.25 * t).cos() } else { 0.0 };
        (20.0 + 2.0 * (0.25 * t).sin(), push, 0.2 * (0.35 * t).sin())
    };
    for hole_s in [0.0, 20.0] {
        let mut car = Car::new(straight_at_first);
        let mut told = false;
        while car.navigator.phase() != Phase::Navigating {
            assert!(car.time_s() < 200.0);
            let (until_s, time_s) = (car.time_s() + 0.2, car.time_s());
            let hidden = (30.0..30.0 + hole_s).contains(&time_s);
            car.until(until_s, true, |fix| {
                (!hidden).then_some(GnssFix {
                    position: fix.position.filter(|_| !told),
                    ..fix
                })
            });
            told |= time_s > 1.0;
        }
        assert!(car.way_m.norm() > 700.0);
        let (off_m, sigma_m) = (
            car.off_m().xy(),
            car.navigator.sigma().unwrap().position_m.x,
        );
        assert!(off_m.norm() < 3.0 * sigma_m, "{off_m} {sigma_m}");
        assert!(hole_s > 0.0 || off_m.norm() < 30.0, "{off_m}");
    }
}

/// Most of a second of a bend is not seen, and GNSS tells no more either.
#[test]
fn what_a_clock_that_is_set_back_hides_is_doubted() {
    let mut car = Car::new(even_bends);
    car.until(100.0, true, Some);
    let before_rad = car.navigator.sigma().unwrap().attitude_rad.z;
    car.clock_s = -0.8;
    car.until(100.9, true, |_| None);
    let after_rad = car.navigator.sigma().unwrap().attitude_rad.z;
    let hidden_rad = car.heading_rad - car.navigator.solution().unwrap().euler().heading_rad;
    assert!(after_rad > 10.0 * before_rad, "{before_rad} {after_rad}");
    assert!(
        wrap_pi(hidden_rad).abs() < 3.0 * after_rad,
        "{hidden_rad} {after_rad}"
    );
}

/// Ten velocities a second, and positions between them that are late.
#[test]
fn positions_in_fixes_of_their_own_may_be_later_than_velocities() {
    let mut car = Car::new(bends);
    let late = 40_u8;
    let late_s = STEP_S * f64::from(late);
    let (mut ways, mut count) = (std::collections::VecDeque::new(), 0);
    while car.time_s() < 300.0 {
        let until_s = car.time_s() + STEP_S;
        car.until(until_s, true, |_| None);
        ways.push_back(car.fix());
        if ways.len() > 1 + usize::from(late) {
            ways.pop_front();
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
                ..*ways.front().unwrap()
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
    let (off_m, sigma_m) = (car.off_m(), car.navigator.sigma().unwrap().position_m.x);
    assert!(off_m.xy().norm() < 3.0 * sigma_m, "{off_m} {sigma_m}");
}

/// A receiver that tells no height: gravity, which is another one higher up, must not be taken to tell it.
#[test]
fn a_height_that_nobody_knows_stays_where_it_is_put() {
    let mut car = Car::new(bends);
    car.up_bias_mps2 = 0.2;
    car.until(300.0, true, |fix| {
        Some(GnssFix {
            height_m: None,
            // All zeros would be none.
            velocity_up_mps: Some(0.0004 * fix.velocity_enu_mps().x),
            ..fix
        })
    });
    let height_m = car.navigator.solution().unwrap().position.height_m;
    assert!(height_m.abs() < 200.0, "{height_m}");
    assert!(car.navigator.sigma().unwrap().position_m.z > 5000.0);
}

/// What has been turned since the last fix has turned the velocity too, by the error of the heading.
#[test]
fn a_velocity_is_as_doubtful_as_the_way_it_was_turned_to() {
    let mut car = Car::new(bends);
    car.until(60.0, true, Some);
    let [before, after] = [0.0, 0.8].map(|seconds| {
        let mut car = car.clone();
        car.drive = |_| (12.0, 0.0, 1.5);
        car.until(60.0 + seconds, true, |_| None);
        car.navigator.sigma().unwrap()
    });
    // By 1.2 rad: a chord of 13.6 m/s.
    let turned_mps = 13.6 * before.attitude_rad.z;
    let square = |sigma: &SolutionSigma| sigma.velocity_mps.xy().norm_squared();
    let grown = square(&after) - square(&before);
    assert!(grown > turned_mps * turned_mps, "{before:?} {after:?}");
}
