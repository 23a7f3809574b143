//! Kalibr's imu.yaml.

use super::setting::{Setting, file};
use crate::tune::found::Found;
use crate::tune::tuning::Tuning;

/// Shift of the stamps, s: Kalibr's is added to the stamp of the other sensor, `t_imu = t_cam + shift`
/// (its report; `timeshift_cam_imu`), so the latency with the opposite sign.
pub fn shift_s(latency_s: Found) -> Found {
    latency_s.scaled(-1.0)
}

/// Densities of continuous time and one number for all axes, as they are here (Kalibr wiki, "IMU Noise
/// Model", "Yaml formats").
pub(super) fn text(t: &Tuning) -> String {
    let noises = [
        (
            "accelerometer_noise_density",
            "m/s^2/sqrt(Hz), at rest",
            t.accel_noise,
        ),
        (
            "accelerometer_random_walk",
            "m/s^3/sqrt(Hz)",
            t.accel_bias_walk,
        ),
        ("gyroscope_noise_density", "rad/s/sqrt(Hz)", t.gyro_noise),
        (
            "gyroscope_random_walk",
            "rad/s^2/sqrt(Hz)",
            t.gyro_bias_walk,
        ),
        ("t_imu = t_gnss + shift", "s", shift_s(t.gnss_delay_s)),
    ];
    let mut all = noises.map(|(name, unit, found)| Setting::new(name, unit, &[found]));
    all[4].hold = Some("Kalibr has no GNSS");
    let write = |name: &str, values: &[String]| format!("{name}: {}", values.concat());
    let densities = file(t, "Kalibr: imu.yaml; rostopic is yours", "#", write, &all);
    format!("{densities}update_rate: {:.1}\n", t.imu_rate_hz)
}
