//! The ellipsoid, its gravity, and the rates of a local frame, against published values.
#![allow(clippy::cast_precision_loss)]
#![allow(clippy::disallowed_methods, clippy::unwrap_used)]

use core::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use ins_core::Time;
use ins_core::earth::{Geodetic, LocalEarth, SEMI_MAJOR_AXIS_M, wrap_pi};
use nalgebra::Vector3;
use proptest::prelude::*;

/// Semi-minor axis and polar radius of curvature a^2/b, m (NGA.STND.0036, table 3.4).
const SEMI_MINOR_AXIS_M: f64 = 6_356_752.314_2;
const POLAR_RADIUS_M: f64 = 6_399_593.625_8;

fn assert_near(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() < tolerance, "{value} {expected}");
}

#[test]
fn radii_match_the_published_ellipsoid() {
    let equator = LocalEarth::at(0.0, 0.0);
    let pole = LocalEarth::at(FRAC_PI_2, 0.0);
    let (a, b) = (SEMI_MAJOR_AXIS_M, SEMI_MINOR_AXIS_M);
    // To the tenth of a millimetre that the table prints.
    assert_near(equator.east_radius_m, a, 1e-4);
    assert_near(equator.north_radius_m, b * b / a, 2e-4);
    assert_near(pole.east_radius_m, POLAR_RADIUS_M, 1e-4);
    assert_near(pole.north_radius_m, POLAR_RADIUS_M, 1e-4);
    assert_near(
        LocalEarth::at(0.7, 250.0).east_radius_m - LocalEarth::at(0.7, 0.0).east_radius_m,
        250.0,
        1e-8,
    );
}

#[test]
fn meridian_radius_integrates_to_the_quarter_meridian() {
    // 10 001 965.729 m for WGS 84; Simpson's rule over 1000 steps leaves less than a micrometre.
    let steps = 1000;
    let h = FRAC_PI_2 / f64::from(steps);
    let sum: f64 = (0..=steps)
        .map(|k| {
            let weight = match k {
                0 => 1.0,
                k if k == steps => 1.0,
                k if k % 2 == 1 => 4.0,
                _ => 2.0,
            };
            weight * LocalEarth::at(f64::from(k) * h, 0.0).north_radius_m
        })
        .sum();
    assert_near(sum * h / 3.0, 10_001_965.729, 1e-3);
}

#[test]
fn gravity_matches_the_published_values() {
    // WGS 84 normal gravity at the equator, at 45 degrees and at the poles, m/s^2.
    for latitude in [0.0, 1.0, -1.0] {
        let expected = if latitude == 0.0 {
            9.780_325_335_9
        } else {
            9.832_184_937_8
        };
        assert_near(
            LocalEarth::at(latitude * FRAC_PI_2, 0.0).gravity_mps2,
            expected,
            1e-10,
        );
    }
    assert_near(
        LocalEarth::at(FRAC_PI_4, 0.0).gravity_mps2,
        9.806_197_769,
        1e-8,
    );
    assert_near(
        LocalEarth::at(-FRAC_PI_4, 0.0).gravity_mps2,
        9.806_197_769,
        1e-8,
    );
}

/// Normal gravity from the potential itself: a closed form in ellipsoidal coordinates
/// (NGA.STND.0036, appendix B), which the series in height only approximates.
fn exact_gravity(latitude_rad: f64, height_m: f64) -> f64 {
    let (a, b) = (SEMI_MAJOR_AXIS_M, SEMI_MINOR_AXIS_M);
    let (gm, omega) = (3.986_004_418e14_f64, 7.292_115e-5_f64);
    let linear2 = a * a - b * b;
    let linear = linear2.sqrt();
    let (s, c) = latitude_rad.sin_cos();
    let normal = a * a / (a * a * c * c + b * b * s * s).sqrt();
    let r = (normal + height_m) * c;
    let z = (b * b / (a * a) * normal + height_m) * s;
    let d2 = r * r + z * z - linear2;
    let u = (0.5 * d2 * (1.0 + (1.0 + 4.0 * linear2 * z * z / (d2 * d2)).sqrt())).sqrt();
    let beta = (z * (u * u + linear2).sqrt()).atan2(u * r);
    let (sb, cb) = beta.sin_cos();
    let w = ((u * u + linear2 * sb * sb) / (u * u + linear2)).sqrt();
    let q_of =
        |u: f64| 0.5 * ((1.0 + 3.0 * u * u / linear2) * (linear / u).atan() - 3.0 * u / linear);
    let q1 = 3.0 * (1.0 + u * u / linear2) * (1.0 - u / linear * (linear / u).atan()) - 1.0;
    let ratio = q_of(u) / q_of(b);
    let t2 = u * u + linear2;
    let down = (gm / t2
        + omega * omega * a * a * linear / t2 * q1 / q_of(b) * (0.5 * sb * sb - 1.0 / 6.0)
        - omega * omega * u * cb * cb)
        / w;
    let along =
        (-omega * omega * a * a / t2.sqrt() * ratio + omega * omega * t2.sqrt()) * sb * cb / w;
    down.hypot(along)
}

#[test]
fn gravity_with_height_matches_the_potential() {
    for latitude in [0.0, 0.5, -1.0, 1.5] {
        for height in [-400.0_f64, 0.0, 3_000.0, 12_000.0, 30_000.0] {
            let series = LocalEarth::at(latitude, height).gravity_mps2;
            let exact = exact_gravity(latitude, height);
            // The series omits f^2 in its linear term, 1.2e-10 per metre, and the third order,
            // 4 g (h/a)^3.
            let truncation =
                1.2e-10 * height.abs() + 40.0 * (height / SEMI_MAJOR_AXIS_M).abs().powi(3);
            assert_near(series, exact, 3e-10 + truncation);
        }
    }
}

#[test]
fn earth_rate_and_transport_rate() {
    let latitude = 0.9;
    let earth = LocalEarth::at(latitude, 100.0);
    let rate = earth.earth_rate();
    // 15.041 deg/h in all, none about east.
    assert_near(rate.norm().to_degrees() * 3600.0, 15.041_067, 1e-5);
    assert_near(rate.z / rate.y, latitude.tan(), 1e-12);
    assert_near(rate.x, 0.0, 1e-20);
    // East at one radius a second: the frame turns about the Earth's axis at 1 rad/s.
    let radius = earth.east_radius_m * latitude.cos();
    let eastwards = earth.transport_rate(&Vector3::new(radius, 0.0, 5.0));
    assert_near(
        (eastwards - Vector3::new(0.0, latitude.cos(), latitude.sin())).norm(),
        0.0,
        1e-12,
    );
    // Northwards about the west axis.
    let northwards = earth.transport_rate(&Vector3::new(0.0, earth.north_radius_m, 5.0));
    assert_near(
        (northwards - Vector3::new(-1.0, 0.0, 0.0)).norm(),
        0.0,
        1e-12,
    );
    // Finite at the pole.
    let pole = LocalEarth::at(FRAC_PI_2, 0.0);
    assert!(pole.transport_rate(&Vector3::new(300.0, 300.0, 0.0)).norm() < 0.1);
}

#[test]
fn enu_difference_across_the_date_line() {
    let at = |latitude_rad, longitude_rad, height_m| Geodetic {
        latitude_rad,
        longitude_rad,
        height_m,
    };
    let from = at(0.9, PI - 1e-5, 100.0);
    let to = at(0.9 + 1e-5, -PI + 1e-5, 130.0);
    let enu = to.enu_from(&from);
    let earth = LocalEarth::at(0.9, 100.0);
    // Radii change by 1e-7 on 60 m.
    assert_near(enu.x, 2e-5 * earth.east_radius_m * 0.9_f64.cos(), 2e-3);
    assert_near(enu.y, 1e-5 * earth.north_radius_m, 1e-4);
    assert_near(enu.z, 30.0, 1e-12);
    assert!((from.enu_from(&to) + enu).norm() < 1e-3);
}

#[test]
fn wrap_pi_reference_values() {
    assert_near(wrap_pi(0.3), 0.3, 1e-16);
    assert_near(wrap_pi(PI + 0.1), 0.1 - PI, 1e-15);
    assert_near(wrap_pi(-PI - 0.1), PI - 0.1, 1e-15);
    assert_near(wrap_pi(5.0 * TAU - 0.2), -0.2, 1e-14);
}

proptest! {
    #[test]
    fn wrapping_changes_an_angle_by_whole_turns_only(turns in -50_i32..50, part in -0.499_f64..0.499) {
        let wrapped = wrap_pi((f64::from(turns) + part) * TAU);
        // 50 turns are 314 rad: 6e-14 of rounding.
        prop_assert!((wrapped - part * TAU).abs() < 1e-13);
    }

    /// For any two times; microseconds are exact.
    #[test]
    fn time_differences_are_finite_and_ordered(a in any::<i64>(), b in any::<i64>()) {
        let (first, second) = (Time::from_micros(a), Time::from_micros(b));
        let seconds = second.seconds_since(first);
        prop_assert_eq!(seconds > 0.0, b > a);
        prop_assert_eq!(seconds < 0.0, b < a);
        prop_assert!(first.plus_seconds(Time::from_micros(b).as_seconds()).as_seconds().is_finite());
    }

    #[test]
    fn seconds_round_trip(micros in -1_000_000_000_000_000_i64..1_000_000_000_000_000) {
        let time = Time::from_micros(micros);
        // 1e9 s has steps of 1e-7 s in f64, a tenth of a microsecond.
        prop_assert_eq!(Time::from_seconds(time.as_seconds()).unwrap(), time);
    }
}

#[test]
fn invalid_times_are_rejected_or_saturate() {
    for seconds in [f64::NAN, f64::INFINITY, -f64::INFINITY, 1e300, 1.1e12] {
        assert_eq!(Time::from_seconds(seconds), None, "{seconds}");
    }
    let time = Time::from_micros(7);
    assert_eq!(time.plus_seconds(f64::NAN), time);
    assert_eq!(time.plus_seconds(1e300).as_micros(), i64::MAX);
    assert_eq!(time.plus_seconds(-1e300).as_micros(), i64::MIN + 7);
    assert_eq!(time.plus_seconds(0.000_000_6).as_micros(), 8);
}
