//! PX4, of its source as of 2026, and `ArduPilot`, as of 4.6.
//!
//! Both take the antenna from the unit where their own place of the unit (`EKF2_IMU_POS`, `INS_POS1`)
//! is zero, and correct readings by `(reading - offset) * scale`: what is found in corrected ones
//! comes on top of the offset, unscaled.

use super::setting::{Setting, TURNED, file};
use crate::tune::found::{Found, frd};
use crate::tune::tuning::Tuning;

/// One prediction of PX4, s: `EKF2_PREDICT_US`, its default.
const PX4_STEP_S: f64 = 0.01;
/// One step of `ArduPilot`'s filter, s: `EKF_TARGET_DT`.
const ARDUPILOT_STEP_S: f64 = 0.012;

const ROTATED: &str = "the board is rotated: sensors, board and vehicle have different axes";
const LEAST: &str =
    "white noise alone, so the least; the default also covers scale errors and vibration";

pub(super) fn px4(t: &Tuning) -> String {
    let set = |name: &str| t.parameters.get(name).copied();
    // What was set is taken from the stamps of this message before they are logged.
    let stamped = t.source.contains("vehicle_gps_position");
    let delayed_ms = set("SENS_GPS0_DELAY").filter(|_| stamped);
    let delay = t.gnss_delay_s.scaled(1e3).plus(delayed_ms.unwrap_or(0.0));
    let rotations = ["ROT", "X_OFF", "Y_OFF", "Z_OFF"].map(|which| format!("SENS_BOARD_{which}"));
    let rotated = (rotations.iter()).any(|name| set(name).is_some_and(|value| value != 0.0));
    // As the sensor reads: neither offset nor scale nor rotation has acted.
    let raw = t.source.starts_with("sensor_gyro");
    let own_axes = (rotated && raw).then_some(ROTATED);
    let turned = t.turned_upright.then_some(TURNED);
    let hold = turned.or((rotated && !raw).then_some(ROTATED));
    let acted = |setting: Setting, hold| {
        if raw {
            Setting { hold, ..setting }
        } else {
            setting.on_top(t, hold)
        }
    };
    let scale = ["X", "Y", "Z"].map(|axis| {
        let scale = set(&format!("CAL_ACC0_{axis}SCALE"));
        scale.filter(|_| !raw).unwrap_or(1.0)
    });

    let note = "before 2026 EKF2_GPS_DELAY; EKF2_DELAY_MAX must not be less";
    let mut all = vec![delay_ms("SENS_GPS0_DELAY", delay, [0.0, 300.0], note)];
    let antenna = Setting::each("SENS_GPS0_OFF@", "m", &frd(&t.lever_arm_m)).into_iter();
    all.extend(antenna.map(|antenna| {
        let former = antenna.name.replace("SENS_GPS0_OFF", "EKF2_GPS_POS_");
        Setting {
            hold: own_axes,
            ..antenna.note(format!("before 2026 {former}"))
        }
    }));
    let board = [t.mount.roll, t.mount.pitch, t.mount.heading];
    let board_deg = board.map(|angle| angle.scaled(1_f64.to_degrees()));
    let board = Setting::each("SENS_BOARD_@_OFF", "deg", &board_deg).into_iter();
    all.extend(board.map(|board| acted(board.takes([-45.0, 45.0]), own_axes)));
    let offsets = offsets(t, ["CAL_GYRO0_@OFF", "CAL_ACC0_@OFF"], scale);
    all.extend(offsets.map(|offset| acted(offset, hold)));
    let noises = [
        ("EKF2_GYR_NOISE", [1e-4, 0.1]),
        ("EKF2_ACC_NOISE", [0.01, 1.0]),
        ("EKF2_GYR_B_NOISE", [0.0, 0.01]),
        ("EKF2_ACC_B_NOISE", [0.0, 0.01]),
    ];
    all.extend(noises_a_step(t, PX4_STEP_S, noises));
    let title = "PX4: for nsh or the MAVLink console";
    let write = |name: &str, values: &[String]| format!("param set {name} {}", values.concat());
    file(t, title, "#", write, &all)
}

pub(super) fn ardupilot(t: &Tuning) -> String {
    let set = |name: &str| t.parameters.get(name).copied();
    // The first sensor has no number in its names.
    let number = t
        .source
        .split_whitespace()
        .find_map(|word| word.parse().ok());
    let number = number.filter(|number| matches!(number, 2..=3_u8));
    let number = number.map_or(String::new(), |number| number.to_string());
    let rotated = set("AHRS_ORIENTATION").is_some_and(|rotation| rotation != 0.0);
    let turned = t.turned_upright.then_some(TURNED);
    let hold = rotated.then_some(ROTATED).or(turned);
    let scale = ["X", "Y", "Z"].map(|axis| {
        let scale = set(&format!("INS_ACC{number}SCAL_{axis}"));
        scale.filter(|scale| *scale > 0.0).unwrap_or(1.0)
    });

    // Zero stands for the driver's own.
    let (delay, takes) = (t.gnss_delay_s.scaled(1e3), [1.0, 250.0]);
    let mut all = vec![delay_ms(
        "GPS1_DELAY_MS",
        delay,
        takes,
        "before 4.6 GPS_DELAY_MS",
    )];
    let antenna = Setting::each("GPS1_POS_@", "m", &frd(&t.lever_arm_m)).into_iter();
    all.extend(antenna.map(|antenna| {
        let former = antenna.name.replace("GPS1_POS", "GPS_POS1");
        let note = format!("before 4.6 {former}");
        antenna.takes([-5.0, 5.0]).note(note)
    }));
    let trim = Setting::each("AHRS_TRIM_@", "rad", &[t.mount.roll, t.mount.pitch]).into_iter();
    all.extend(trim.map(|trim| trim.takes([-0.1745, 0.1745])));
    let names = ["GYR", "ACC"].map(|kind| format!("INS_{kind}{number}OFFS_@"));
    let offsets = offsets(t, [&names[0], &names[1]], scale);
    all.extend(offsets.map(|offset| offset.takes([-3.5, 3.5]).on_top(t, hold)));
    let noises = [
        ("EK3_GYRO_P_NSE", [1e-4, 0.1]),
        ("EK3_ACC_P_NSE", [0.01, 1.0]),
        ("EK3_GBIAS_P_NSE", [1e-5, 1e-3]),
        ("EK3_ABIAS_P_NSE", [1e-5, 0.02]),
    ];
    all.extend(noises_a_step(t, ARDUPILOT_STEP_S, noises));
    let title = "ArduPilot: a parameter file; gyro offsets stay only where INS_GYR_CAL is 0";
    let write = |name: &str, values: &[String]| format!("{name},{}", values.concat());
    file(t, title, "#", write, &all)
}

/// Subtracted from the stamps of fixes, so the latency itself.
fn delay_ms(name: &str, found: Found, takes: [f64; 2], note: &str) -> Setting {
    Setting {
        whole: true,
        ..Setting::new(name, "ms", &[found]).takes(takes).note(note)
    }
}

/// Offsets of gyros and accelerometers, of which the latter have a scale.
fn offsets(t: &Tuning, names: [&str; 2], scale: [f64; 3]) -> impl Iterator<Item = Setting> {
    let unscaled = frd(&t.accel_bias_mps2);
    let accel = [0, 1, 2].map(|axis| unscaled[axis].scaled(1.0 / scale[axis]));
    let gyros = Setting::each(names[0], "rad/s", &frd(&t.gyro_bias_radps));
    let accels = Setting::each(names[1], "m/s^2", &accel);
    gyros.into_iter().chain(accels)
}

/// Noises, and what they may be, of a filter that adds `(step_s noise)^2` to the variance of an angle,
/// a velocity and both offsets at each step. Never set, for they are the least.
fn noises_a_step(t: &Tuning, step_s: f64, noises: [(&str, [f64; 2]); 4]) -> Vec<Setting> {
    let densities = [
        ("rad/s", t.gyro_noise),
        ("m/s^2", t.accel_noise),
        ("rad/s^2", t.gyro_bias_walk),
        ("m/s^3", t.accel_bias_walk),
    ];
    let all = noises.into_iter().zip(densities);
    all.map(|((name, takes), (unit, density))| Setting {
        hold: Some(LEAST),
        takes,
        ..Setting::new(name, unit, &[density.scaled(1.0 / step_s.sqrt())])
    })
    .collect()
}
