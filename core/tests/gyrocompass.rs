//! Gyrocompassing with a ring laser unit at rest: its heading error is correlated with the gyro biases, and no fix
//! separates them.
#![allow(
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::indexing_slicing
)] // Reference values.

#[path = "unit/deviates.rs"]
mod deviates;

use std::f64::consts::TAU;

use deviates::Deviates;
use ins_core::earth::{Geodetic, LocalEarth, wrap_pi};
use ins_core::{Config, GnssFix, ImuSample, Navigator, Time};
use nalgebra::{Vector2, Vector3};

const STEP_S: f64 = 0.02;
const PLACE: Geodetic = Geodetic {
    latitude_rad: 0.8,
    longitude_rad: 0.1,
    height_m: 100.0,
};

/// One unit of the class at rest for four minutes: its heading error in sigmas.
fn normalized_heading_error(seed: u32, heading_rad: f64) -> f64 {
    let mut deviates = Deviates(u64::from(seed));
    let mut noise = |sigma: f64| {
        let three = [0, 1, 2].map(|_| f64::from(deviates.next()));
        Vector3::from(three) * sigma
    };
    let config = Config::hg1700();
    let s = config.sensors;
    let earth = LocalEarth::at(PLACE.latitude_rad, PLACE.height_m);
    let rate = earth.earth_rate();
    let (sin, cos) = heading_rad.sin_cos();
    let turn = Vector3::new(-sin * rate.y, cos * rate.y, rate.z) + noise(s.gyro_bias_radps);
    let force = Vector3::new(0.0, 0.0, earth.gravity_mps2) + noise(s.accel_bias_mps2);
    let per_sample = STEP_S.sqrt();
    let mut navigator = Navigator::new(config).unwrap();
    for step in 1..=12_000 {
        let time = Time::from_seconds(STEP_S * f64::from(step)).unwrap();
        if step % 50 == 0 {
            let error_mps = noise(0.05);
            let fix = GnssFix {
                time,
                velocity_en_mps: Some(Vector2::new(error_mps.x, error_mps.y)),
                velocity_up_mps: Some(error_mps.z),
                ..GnssFix::default()
            };
            let _ = navigator.on_gnss(&fix.at(&PLACE));
        }
        let _ = navigator.on_imu(&ImuSample {
            time,
            gyro: turn + noise(s.gyro_noise[0] / per_sample),
            accel: force + noise(s.accel_noise[0] / per_sample),
        });
    }
    let error_rad = wrap_pi(navigator.solution().unwrap().euler().heading_rad - heading_rad);
    let sigma_rad = navigator.sigma().unwrap().attitude_rad.z;
    error_rad / sigma_rad
}

#[test]
fn heading_sigma_after_gyrocompassing_covers_the_error() {
    let units = 150;
    let squares = (0..units).map(|unit| {
        let heading_rad = TAU * f64::from(unit) / f64::from(units);
        normalized_heading_error(unit, heading_rad).powi(2)
    });
    let mean = squares.sum::<f64>() / f64::from(units);
    // Three sigmas of the mean of squares; without the correlation it was 1.63.
    let tolerance = 3.0 * (2.0 / f64::from(units)).sqrt();
    assert!((mean - 1.0).abs() < tolerance, "{mean}");
}
