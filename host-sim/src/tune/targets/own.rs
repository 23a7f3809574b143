//! This core.

use ins_core::Config;

use super::{Setting, bracketed, file};
use crate::tune::{Found, Tuning};

/// Spread of a latency that is taken from the stamps, sigmas: it changes from start to start.
const LATENCY_SIGMAS: f64 = 3.0;

/// A configuration with what was found in place of the class's: units and axes are the core's
/// (`ins_core::config`), and noise per root of a second is what a density per root of Hz is.
pub fn config(t: &Tuning, base: Config) -> Config {
    let mut config = base;
    let set = |value: &mut f64, found: &Found| {
        if found.is_known() {
            *value = found.value;
        }
    };
    for axis in 0..3 {
        set(&mut config.sensors.gyro_noise[axis], &t.gyro_noise);
        set(&mut config.sensors.accel_noise[axis], &t.accel_noise);
    }
    set(&mut config.sensors.gyro_bias_walk, &t.gyro_bias_walk);
    set(
        &mut config.gnss.velocity_mps.white,
        &t.gnss_velocity_noise_mps,
    );
    if t.lever_arm_m.iter().all(Found::is_known) {
        config.gnss.lever_arm_m = t.lever_arm_m.map(|arm| arm.value);
        config.gnss.lever_arm_sigma_m = t
            .lever_arm_m
            .iter()
            .map(|arm| arm.sigma)
            .fold(0.0, f64::max);
    }
    if t.gnss_delay_s.is_known() {
        config.gnss.latency_sigma_s = LATENCY_SIGMAS * t.gnss_delay_s.sigma;
    }
    config
}

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
