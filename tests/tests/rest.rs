//! Use of the gyros at rest.

use std::f64::consts::TAU;

use ins_core::config::HeadingSource;
use ins_core::earth::{Geodetic, LocalEarth, wrap_pi};
use ins_core::{Config, GnssFix, GnssOutcome, Heading, ImuSample, Navigator, Phase, Time};
use nalgebra::{Vector2, Vector3};

const PLACE: Geodetic = Geodetic {
    latitude_rad: 0.97,
    longitude_rad: 0.66,
    height_m: 150.0,
};
const RATE_HZ: i64 = 100;

/// A level, stationary vehicle with perfect sensors, except for an additional rate of the up gyro.
fn run_at_rest(navigator: &mut Navigator, from_s: i64, to_s: i64, up_gyro_radps: f64) {
    let earth = LocalEarth::at(PLACE.latitude_rad, PLACE.height_m);
    for tick in RATE_HZ * from_s + 1..=RATE_HZ * to_s {
        let time = Time::from_micros(tick * 1_000_000 / RATE_HZ);
        if tick % RATE_HZ == 0 {
            let _ = navigator.on_gnss(
                &GnssFix {
                    time,
                    velocity_en_mps: Some(Vector2::zeros()),
                    velocity_up_mps: Some(0.0),
                    ..GnssFix::default()
                }
                .at(&PLACE),
            );
        }
        let _ = navigator.on_imu(&ImuSample {
            time,
            gyro: earth.earth_rate() + Vector3::new(0.0, 0.0, up_gyro_radps),
            accel: Vector3::new(0.0, 0.0, earth.gravity_mps2),
        });
    }
}

fn up_gyro_deg_s(navigator: &Navigator) -> f64 {
    navigator.estimates().gyro_bias_radps[2].value.to_degrees()
}

/// As on a turntable: a slow and constant rate resembles rest.
#[test]
fn a_slow_turn_is_not_estimated_as_gyro_bias() {
    let config = Config {
        heading: HeadingSource::Given(0.0),
        ..Config::mems()
    };
    let mut navigator = Navigator::new(config).unwrap();
    run_at_rest(&mut navigator, 0, 60, 0.0);
    assert_eq!(navigator.phase(), Phase::Navigating);
    run_at_rest(&mut navigator, 60, 70, 0.5_f64.to_radians());
    run_at_rest(&mut navigator, 70, 80, 0.0);
    // At most a hundredth of the rate of 0.5 deg/s; the heading has changed to the left by 5 deg.
    let gyro = up_gyro_deg_s(&navigator);
    assert!(gyro.abs() < 0.005, "{gyro}");
    let turned_deg = -navigator
        .solution()
        .unwrap()
        .euler()
        .heading_rad
        .to_degrees();
    assert!((turned_deg - 5.0).abs() < 0.1, "{turned_deg}");
}

/// During warm-up a gyro bias changes by more than the uncertainty of a minute's mean; a vehicle that begins to
/// turn on the spot looks the same. The sigma must cover both.
#[test]
fn a_changing_bias_before_the_start_has_a_larger_sigma() {
    let config = Config {
        heading: HeadingSource::Motion,
        ..Config::mems()
    };
    let mut navigator = Navigator::new(config).unwrap();
    run_at_rest(&mut navigator, 0, 60, 0.0);
    run_at_rest(&mut navigator, 60, 70, 0.5_f64.to_radians());
    assert_eq!(navigator.phase(), Phase::FindingHeading);
    let gyro = up_gyro_deg_s(&navigator);
    let sigma = navigator.estimates().gyro_bias_radps[2].sigma.to_degrees();
    assert!(
        (gyro - 0.5).abs() < 3.0 * sigma + 0.005,
        "{gyro} of {sigma}"
    );
}

/// At rest, or moved for longer than alignment waits for rest.
#[test]
fn gyrocompassing_finds_the_heading() {
    for moved_s in [0, 30] {
        let mut navigator = Navigator::new(Config::hg1700()).unwrap();
        for from_s in 0..moved_s {
            let turn_radps = if from_s % 2 == 0 { 0.1 } else { -0.1 };
            run_at_rest(&mut navigator, from_s, from_s + 1, turn_radps);
        }
        run_at_rest(&mut navigator, moved_s, moved_s + 55, 0.0);
        assert_ne!(navigator.phase(), Phase::Navigating);
        run_at_rest(&mut navigator, moved_s + 55, moved_s + 75, 0.0);
        assert_eq!(navigator.phase(), Phase::Navigating, "{moved_s}");
        let error = wrap_pi(navigator.solution().unwrap().euler().heading_rad);
        let sigma = navigator.sigma().unwrap().attitude_rad.z;
        // 1 deg/h of bias relative to 8.5 of north Earth rate.
        assert!(
            error.abs() < 0.01 && (0.05..0.2).contains(&sigma),
            "{error} {sigma}"
        );
    }
}

/// At anchor a boat yaws slowly for minutes, like a gyro bias: measured headings take precedence.
#[test]
fn yawing_with_measured_headings_is_not_estimated_as_bias() {
    let mut navigator = Navigator::new(Config {
        heading: HeadingSource::Given(0.0),
        ..Config::mems()
    })
    .unwrap();
    let (amplitude_rad, radps) = (11.5_f64.to_radians(), TAU / 240.0);
    let (mut rejected, mut error) = (0, 0.0);
    for second in 0_i32..1200 {
        let phase = radps * (f64::from(second) + 0.5);
        let (from_s, to_s) = (i64::from(second), i64::from(second) + 1);
        run_at_rest(
            &mut navigator,
            from_s,
            to_s,
            amplitude_rad * radps * phase.cos(),
        );
        // A positive up rate turns left.
        let heading_rad = -amplitude_rad * (radps * f64::from(second + 1)).sin();
        let outcome = navigator.on_heading(&Heading {
            time: Time::from_micros(1_000_000 * to_s),
            heading_rad,
            sigma_rad: 0.5_f64.to_radians(),
        });
        rejected += i32::from(outcome == GnssOutcome::Outlier);
        if let (Some(solution), Some(sigma)) = (navigator.solution(), navigator.sigma()) {
            error = wrap_pi(solution.euler().heading_rad - heading_rad) / sigma.attitude_rad.z;
        }
    }
    assert!(rejected == 0 && error.abs() < 4.5, "{rejected} {error}");
}
