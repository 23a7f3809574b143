//! gnss-ins-sim's accuracy dictionary.

use super::kf_gins::{arw, gyrbias_deg_h, vrw};
use super::setting::{Setting, bracketed, file};
use crate::identify::quantities::DEG_H_RADPS;
use crate::log::BodyAxes;
use crate::tune::found::{Found, along};
use crate::tune::tuning::Tuning;

/// Offsets, m/s^2, forward, right, down, as they are added to the truth (`accel_b`; README, "Manually
/// define the model"); gyros in deg/h (`gyro_b`).
pub fn accel_b(bias: &[Found; 3]) -> [Found; 3] {
    along(BodyAxes::Frd, bias)
}

/// Random walks are deg/sqrt(h) and m/s/sqrt(h), instability deg/h over a correlation time in s
/// (README).
pub(super) fn text(t: &Tuning) -> String {
    let stability = t.gyro_bias_wander.scaled(1.0 / DEG_H_RADPS);
    let all = [
        Setting::new(
            "imu_err['gyro_b']",
            "deg/h",
            &gyrbias_deg_h(&t.gyro_bias_radps),
        ),
        Setting::new("imu_err['gyro_arw']", "deg/sqrt(h)", &[arw(t.gyro_noise)]),
        Setting::new("imu_err['gyro_b_stability']", "deg/h", &[stability]),
        Setting::new("imu_err['gyro_b_corr']", "s", &[t.gyro_bias_correlation_s]),
        Setting::new("imu_err['accel_b']", "m/s^2", &accel_b(&t.accel_bias_mps2)),
        Setting::new(
            "imu_err['accel_vrw']",
            "m/s/sqrt(h), at rest",
            &[vrw(t.accel_noise)],
        ),
        Setting::new(
            "imu_err['accel_b_stability']",
            "m/s^2",
            &[t.accel_bias_walk],
        ),
        Setting::new("imu_err['accel_b_corr']", "s", &[t.accel_bias_walk]),
        Setting::new("gps_err['stdv']", "m/s", &[t.gnss_velocity_noise_mps]),
    ];
    let title =
        "gnss-ins-sim: over a copy of a built-in accuracy, for IMU(accuracy=imu_err, axis=6)";
    file(
        t,
        title,
        "#",
        |name, values| format!("{name} = np.array({})", bracketed(values)),
        &all,
    )
}
