//! This core.

use super::setting::{Setting, bracketed, file};
use crate::tune::found::Found;
use crate::tune::tuning::{LATENCY_SIGMAS, Tuning};

pub(super) fn text(t: &Tuning) -> String {
    let class = t.grade.name();
    let delay = t.gnss_delay_s;
    let spread = Found {
        value: LATENCY_SIGMAS * delay.sigma,
        ..delay
    };
    let all = [
        Setting::new(
            "config.sensors.gyro_noise",
            "rad/s/sqrt(Hz)",
            &[t.gyro_noise; 3],
        ),
        Setting::new(
            "config.sensors.accel_noise",
            "m/s^2/sqrt(Hz), at rest",
            &[t.accel_noise; 3],
        ),
        Setting::new(
            "config.sensors.gyro_bias_walk",
            "rad/s/sqrt(s)",
            &[t.gyro_bias_walk],
        ),
        Setting::new(
            "config.gnss.velocity_mps.white",
            "m/s",
            &[t.gnss_velocity_noise_mps],
        ),
        Setting::new("config.gnss.lever_arm_m", "m", &t.lever_arm_m),
        Setting::new("config.gnss.latency_sigma_s", "s", &[spread])
            .note("with this subtracted from the stamps of fixes:".to_owned()),
        Setting::new("let gnss_latency_s", "s", &[delay]),
        Setting::new("let gyro_bias_radps", "rad/s", &t.gyro_bias_radps)
            .note("to be subtracted from readings, right, forward, up".to_owned()),
        Setting::new("let accel_bias_mps2", "m/s^2", &t.accel_bias_mps2)
            .note("the same".to_owned()),
    ];
    let title = format!("This core: let mut config = Config::{class}(); right, forward, up; SI");
    file(t, &title, "//", line, &all)
}

fn line(name: &str, values: &[String]) -> String {
    match values {
        [one] => format!("{name} = {one};"),
        all => format!("{name} = {};", bracketed(all)),
    }
}
