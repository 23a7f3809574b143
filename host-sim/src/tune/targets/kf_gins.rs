//! KF-GINS's yaml.

use super::setting::{Setting, bracketed, file};
use crate::identify::quantities::DEG_H_RADPS;
use crate::log::BodyAxes;
use crate::tune::found::{Found, along};
use crate::tune::tuning::Tuning;

/// One mGal, m/s^2.
const MGAL_MPS2: f64 = 1e-5;

/// Antenna, m, forward, right, down of the unit (`antlever`, `dataset/kf-gins.yaml`).
pub fn antlever_m(lever_arm_m: &[Found; 3]) -> [Found; 3] {
    along(BodyAxes::Frd, lever_arm_m)
}

/// Offsets, deg/h, forward, right, down, subtracted from readings (`initgyrbias`,
/// `dataset/kf-gins.yaml`; `imuCompensate`, `gi_engine.cpp`).
pub fn gyrbias_deg_h(bias: &[Found; 3]) -> [Found; 3] {
    along(BodyAxes::Frd, bias).map(|found| found.scaled(1.0 / DEG_H_RADPS))
}

/// The same of accelerometers, mGal (`initaccbias`).
pub fn accbias_mgal(bias: &[Found; 3]) -> [Found; 3] {
    along(BodyAxes::Frd, bias).map(|found| found.scaled(1.0 / MGAL_MPS2))
}

/// Gyro noise, deg/sqrt(h) (`arw`): a root of an hour has 60 roots of a second.
pub fn arw(density: Found) -> Found {
    density.scaled(60.0 * 1_f64.to_degrees())
}

/// Accelerometer noise, m/s/sqrt(h) (`vrw`).
pub fn vrw(density: Found) -> Found {
    density.scaled(60.0)
}

/// Wander of a gyro offset, deg/h (`gbstd`), over its correlation time, h (`corrtime`): first-order
/// Gauss-Markov, driven by `2 gbstd^2 / corrtime` (`gi_engine.cpp`).
pub fn wander(sigma_radps: Found, correlation_s: Found) -> [Found; 2] {
    [
        sigma_radps.scaled(1.0 / DEG_H_RADPS),
        correlation_s.scaled(1.0 / 3600.0),
    ]
}

pub(super) fn text(t: &Tuning) -> String {
    let [gbstd, corrtime] = wander(t.gyro_bias_wander, t.gyro_bias_correlation_s);
    let mut delay = Setting::new("delay of GNSS", "s", &[t.gnss_delay_s]);
    delay.hold = Some("KF-GINS has no delay; subtract it from the stamps of the GNSS file");
    let initial = [
        delay,
        Setting::new("antlever", "m", &antlever_m(&t.lever_arm_m)),
        Setting::new("initgyrbias", "deg/h", &gyrbias_deg_h(&t.gyro_bias_radps)),
        Setting::new("initaccbias", "mGal", &accbias_mgal(&t.accel_bias_mps2)),
    ];
    let noise = [
        Setting::new("arw", "deg/sqrt(h)", &[arw(t.gyro_noise)]),
        Setting::new("vrw", "m/s/sqrt(h), at rest", &[vrw(t.accel_noise)]),
        Setting::new("gbstd", "deg/h", &[gbstd]),
        Setting::new("abstd", "mGal", &[t.accel_bias_walk]),
        Setting::new("corrtime", "h", &[corrtime]),
    ];
    let title = "KF-GINS: into its yaml; forward, right, down";
    let mut text = file(t, title, "#", line, &initial) + "imunoise:\n";
    for setting in &noise {
        setting.print(&mut text, "  #", |name, values| {
            format!("  {}", line(name, values))
        });
    }
    text
}

fn line(name: &str, values: &[String]) -> String {
    match name {
        "corrtime" => format!("{name}: {}", values.concat()),
        _ => format!("{name}: {}", bracketed(values)),
    }
}
