//! Sensor models of Kalibr, KF-GINS, gnss-ins-sim, and this core.

use super::setting::{Setting, bracketed, file};
use crate::identify::quantities::DEG_H_RADPS;
use crate::tune::found::{Found, frd};
use crate::tune::tuning::{LATENCY_SIGMAS, Tuning};

/// One mGal, m/s^2.
const MGAL_MPS2: f64 = 1e-5;

/// imu.yaml: continuous-time densities, one number for all axes.
pub(super) fn kalibr(t: &Tuning) -> String {
    let names = [
        ("accelerometer_noise_density", "m/s^2/sqrt(Hz), at rest"),
        ("accelerometer_random_walk", "m/s^3/sqrt(Hz)"),
        ("gyroscope_noise_density", "rad/s/sqrt(Hz)"),
        ("gyroscope_random_walk", "rad/s^2/sqrt(Hz)"),
        // Added to the stamps of the other sensor.
        ("t_imu = t_gnss + shift", "s"),
    ];
    let shift = t.gnss_delay_s.scaled(-1.0);
    let found = [
        t.accel_noise,
        t.accel_bias_walk,
        t.gyro_noise,
        t.gyro_bias_walk,
        shift,
    ];
    let mut all: Vec<Setting> = (names.into_iter().zip(found))
        .map(|((name, unit), found)| Setting::new(name, unit, &[found]))
        .collect();
    all[4].hold = Some("Kalibr has no GNSS");
    let write = |name: &str, values: &[String]| format!("{name}: {}", values.concat());
    let densities = file(t, "Kalibr: imu.yaml; rostopic is yours", "#", write, &all);
    format!("{densities}update_rate: {:.1}\n", t.imu_rate_hz)
}

/// Its yaml: offsets are subtracted from readings; a gyro offset is of first order, Gauss-Markov.
pub(super) fn kf_gins(t: &Tuning) -> String {
    let mgal = frd(&t.accel_bias_mps2).map(|found| found.scaled(1.0 / MGAL_MPS2));
    let correlation_h = t.gyro_bias_correlation_s.scaled(1.0 / 3600.0);
    // Its GNSS file holds positions and nothing else.
    let delay_s = t.gnss_delay_s.and(t.gnss_position_delay_s);
    let no_delay = "KF-GINS has no delay; subtract it from the stamps of the GNSS file";
    let initial = [
        Setting::new("delay of positions", "s", &[delay_s]).hold(Some(no_delay)),
        Setting::new("antlever", "m", &frd(&t.lever_arm_m)),
        Setting::new("initgyrbias", "deg/h", &gyro_deg_h(t)),
        Setting::new("initaccbias", "mGal", &mgal),
    ];
    let noise = [
        Setting::new("arw", "deg/sqrt(h)", &[arw(t)]),
        Setting::new("vrw", "m/s/sqrt(h), at rest", &[vrw(t)]),
        Setting::new("gbstd", "deg/h", &[wander_deg_h(t)]),
        Setting::new("abstd", "mGal", &[t.accel_bias_walk]),
        Setting::new("corrtime", "h", &[correlation_h]),
    ];
    let title = "KF-GINS: into its yaml; forward, right, down";
    let mut text = file(t, title, "#", line, &initial) + "imunoise:\n";
    for setting in &noise {
        let write = |name: &str, values: &[String]| format!("  {}", line(name, values));
        setting.print(&mut text, "  #", write);
    }
    text
}

fn line(name: &str, values: &[String]) -> String {
    match name {
        "corrtime" => format!("{name}: {}", values.concat()),
        _ => format!("{name}: {}", bracketed(values)),
    }
}

/// Its accuracy dictionary: offsets are added to the truth.
pub(super) fn gnss_ins_sim(t: &Tuning) -> String {
    let (walk, correlation) = (t.accel_bias_walk, t.gyro_bias_correlation_s);
    let all = [
        Setting::new("imu_err['gyro_b']", "deg/h", &gyro_deg_h(t)),
        Setting::new("imu_err['gyro_arw']", "deg/sqrt(h)", &[arw(t)]),
        Setting::new("imu_err['gyro_b_stability']", "deg/h", &[wander_deg_h(t)]),
        Setting::new("imu_err['gyro_b_corr']", "s", &[correlation]),
        Setting::new("imu_err['accel_b']", "m/s^2", &frd(&t.accel_bias_mps2)),
        Setting::new("imu_err['accel_vrw']", "m/s/sqrt(h), at rest", &[vrw(t)]),
        Setting::new("imu_err['accel_b_stability']", "m/s^2", &[walk]),
        Setting::new("imu_err['accel_b_corr']", "s", &[walk]),
        Setting::new("gps_err['stdv']", "m/s", &[t.gnss_velocity_noise_mps]),
    ];
    let title =
        "gnss-ins-sim: over a copy of a built-in accuracy, for IMU(accuracy=imu_err, axis=6)";
    let write = |name: &str, values: &[String]| format!("{name} = np.array({})", bracketed(values));
    file(t, title, "#", write, &all)
}

pub(super) fn core(t: &Tuning) -> String {
    let class = t.grade.name();
    let delay = t.gnss_delay_s;
    let spread = Found {
        value: LATENCY_SIGMAS * delay.sigma,
        ..delay
    };
    let (gyro, accel, walk) = ([t.gyro_noise; 3], [t.accel_noise; 3], [t.gyro_bias_walk]);
    let white = [t.gnss_velocity_noise_mps];
    let density = "m/s^2/sqrt(Hz), at rest";
    let all = [
        Setting::new("config.sensors.gyro_noise", "rad/s/sqrt(Hz)", &gyro),
        Setting::new("config.sensors.accel_noise", density, &accel),
        Setting::new("config.sensors.gyro_bias_walk", "rad/s/sqrt(s)", &walk),
        Setting::new("config.gnss.velocity_mps.white", "m/s", &white),
        Setting::new("config.gnss.lever_arm_m", "m", &t.lever_arm_m),
        Setting::new("config.gnss.latency_sigma_s", "s", &[spread])
            .note("with this subtracted from the stamps of fixes:"),
        Setting::new("let gnss_latency_s", "s", &[delay]),
        Setting::new("let gyro_bias_radps", "rad/s", &t.gyro_bias_radps)
            .note("to be subtracted from readings, right, forward, up"),
        Setting::new("let accel_bias_mps2", "m/s^2", &t.accel_bias_mps2).note("the same"),
    ];
    let title = format!("This core: let mut config = Config::{class}(); right, forward, up; SI");
    let write = |name: &str, values: &[String]| match values {
        [one] => format!("{name} = {one};"),
        all => format!("{name} = {};", bracketed(all)),
    };
    file(t, &title, "//", write, &all)
}

/// Gyro offsets forward, right, down.
fn gyro_deg_h(t: &Tuning) -> [Found; 3] {
    frd(&t.gyro_bias_radps).map(|found| found.scaled(1.0 / DEG_H_RADPS))
}

fn wander_deg_h(t: &Tuning) -> Found {
    t.gyro_bias_wander.scaled(1.0 / DEG_H_RADPS)
}

/// Angular random walk, deg/sqrt(h); sqrt(h) is 60 sqrt(s).
fn arw(t: &Tuning) -> Found {
    t.gyro_noise.scaled(60.0 * 1_f64.to_degrees())
}

/// Velocity random walk, m/s/sqrt(h).
fn vrw(t: &Tuning) -> Found {
    t.accel_noise.scaled(60.0)
}
