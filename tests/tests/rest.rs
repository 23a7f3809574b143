//! What the gyros of a standing vehicle tell, and what they do not.

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

/// A level vehicle that stands with perfect sensors, but for what its up gyro reads besides.
fn stand(navigator: &mut Navigator, from_s: i64, to_s: i64, up_gyro_radps: f64) {
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

/// On a turntable, say: slow and even, it looks like rest.
#[test]
fn a_slow_turn_is_not_a_gyro_bias() {
    let config = Config {
        heading: HeadingSource::Given(0.0),
        ..Config::mems()
    };
    let mut navigator = Navigator::new(config).unwrap();
    stand(&mut navigator, 0, 60, 0.0);
    assert_eq!(navigator.phase(), Phase::Navigating);
    stand(&mut navigator, 60, 70, 0.5_f64.to_radians());
    stand(&mut navigator, 70, 80, 0.0);
    // Of a rate of 0.5 deg/s, a hundredth at most; the heading has turned to the left by 5 deg.
    let gyro = up_gyro_deg_s(&navigator);
    assert!(gyro.abs() < 0.005, "{gyro}");
    let turned = -navigator
        .solution()
        .unwrap()
        .euler()
        .heading_rad
        .to_degrees();
    assert!((turned - 5.0).abs() < 0.1, "{turned}");
}

/// While a gyro warms up its bias moves by more than a minute's mean is uncertain; a vehicle that
/// begins to turn on the spot looks the same. Either way it is said.
#[test]
fn a_bias_that_moves_before_the_start_is_not_held_for_known() {
    let config = Config {
        heading: HeadingSource::Motion,
        ..Config::mems()
    };
    let mut navigator = Navigator::new(config).unwrap();
    stand(&mut navigator, 0, 60, 0.0);
    stand(&mut navigator, 60, 70, 0.5_f64.to_radians());
    assert_eq!(navigator.phase(), Phase::FindingHeading);
    let gyro = up_gyro_deg_s(&navigator);
    let sigma = navigator.estimates().gyro_bias_radps[2].sigma.to_degrees();
    assert!(
        (gyro - 0.5).abs() < 3.0 * sigma + 0.005,
        "{gyro} of {sigma}"
    );
}

/// Whether it simply stands, or is shaken for longer than rest is waited for.
#[test]
fn gyros_that_resolve_the_earth_rate_are_a_compass() {
    for shaken_s in [0, 30] {
        let mut navigator = Navigator::new(Config::hg1700()).unwrap();
        for from_s in 0..shaken_s {
            let turn_radps = if from_s % 2 == 0 { 0.1 } else { -0.1 };
            stand(&mut navigator, from_s, from_s + 1, turn_radps);
        }
        stand(&mut navigator, shaken_s, shaken_s + 55, 0.0);
        assert_ne!(navigator.phase(), Phase::Navigating);
        stand(&mut navigator, shaken_s + 55, shaken_s + 75, 0.0);
        assert_eq!(navigator.phase(), Phase::Navigating, "{shaken_s}");
        let off = wrap_pi(navigator.solution().unwrap().euler().heading_rad);
        let sigma = navigator.sigma().unwrap().attitude_rad.z;
        // 1 deg/h of bias, of 8.5 that point north.
        assert!(
            off.abs() < 0.01 && (0.05..0.2).contains(&sigma),
            "{off} {sigma}"
        );
    }
}

/// At anchor it turns slowly for minutes, as a bias of the gyro would: what headings say counts more.
#[test]
fn a_swing_is_no_bias_where_headings_are_measured() {
    let mut navigator = Navigator::new(Config {
        heading: HeadingSource::Given(0.0),
        ..Config::mems()
    })
    .unwrap();
    let (swing_rad, radps) = (11.5_f64.to_radians(), TAU / 240.0);
    let (mut refused, mut off) = (0, 0.0);
    for second in 0_i32..1200 {
        let phase = radps * (f64::from(second) + 0.5);
        let (from_s, to_s) = (i64::from(second), i64::from(second) + 1);
        stand(
            &mut navigator,
            from_s,
            to_s,
            swing_rad * radps * phase.cos(),
        );
        // Up is to the left.
        let heading_rad = -swing_rad * (radps * f64::from(second + 1)).sin();
        let outcome = navigator.on_heading(&Heading {
            time: Time::from_micros(1_000_000 * to_s),
            heading_rad,
            sigma_rad: 0.5_f64.to_radians(),
        });
        refused += i32::from(outcome == GnssOutcome::Outlier);
        if let (Some(solution), Some(sigma)) = (navigator.solution(), navigator.sigma()) {
            off = wrap_pi(solution.euler().heading_rad - heading_rad) / sigma.attitude_rad.z;
        }
    }
    assert!(refused == 0 && off.abs() < 4.5, "{refused} {off}");
}
