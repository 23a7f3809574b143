//! PX4, by its source of 2026, and `ArduPilot` 4.6.
//!
//! Both have the antenna in the same frame as the unit (`EKF2_IMU_POS`, `INS_POS1`), and correct readings by
//! `(reading - offset) * scale`: biases identified in corrected readings are added to the offset, unscaled.

use super::setting::{Setting, TURNED, file};
use crate::tune::found::{Found, frd};
use crate::tune::tuning::Tuning;

/// One prediction of PX4, s: `EKF2_PREDICT_US`, its default.
const PX4_STEP_S: f64 = 0.01;
/// One step of `ArduPilot`'s filter, s: `EKF_TARGET_DT`.
const ARDUPILOT_STEP_S: f64 = 0.012;

const ROTATED: &str = "the board is rotated: sensors, board and vehicle have different axes";
const NO_NUMBER: &str = "which number the autopilot's parameters give this one is not known";
const LEAST: &str =
    "white noise alone, so the least; the default also covers scale errors and vibration";

pub(super) fn px4(t: &Tuning) -> String {
    let set = |name: &str| t.parameters.get(name).copied();
    // Parameters are assigned to sensors by device ID: only the first surely has those of its number.
    let sensor = number(t, ["vehicle_imu ", "sensor_accel "]).unwrap_or(0);
    let one_of_several =
        t.source.starts_with("sensor_combined") && set("CAL_GYRO1_ID").is_some_and(|id| id != 0.0);
    let no_sensor = (sensor > 0 || one_of_several).then_some(NO_NUMBER);
    let receiver = number(t, ["vehicle_gps_position ", "sensor_gps "]).unwrap_or(0);
    let bound = [0, 1].map(|n| set(&format!("SENS_GPS{n}_ID")).is_some_and(|id| id != 0.0));
    let no_receiver = (receiver > 1 || receiver == 1 && bound.contains(&true)).then_some(NO_NUMBER);
    // The delay that was set is subtracted from the stamps of this message before they are logged.
    let stamped = t.source.contains("vehicle_gps_position");
    let delay_name = format!("SENS_GPS{receiver}_DELAY");
    let delayed_ms = set(&delay_name).filter(|_| stamped);
    let delay = t.gnss_delay_s.scaled(1e3).plus(delayed_ms.unwrap_or(0.0));
    let rotations = ["ROT", "X_OFF", "Y_OFF", "Z_OFF"].map(|which| format!("SENS_BOARD_{which}"));
    let rotated = (rotations.iter()).any(|name| set(name).is_some_and(|value| value != 0.0));
    // Raw readings, without offset, scale and rotation.
    let raw = t.source.starts_with("sensor_gyro");
    let own_axes = (rotated && raw).then_some(ROTATED);
    let turned = t.turned_upright.then_some(TURNED);
    let hold = turned.or((rotated && !raw).then_some(ROTATED));
    let corrected = |setting: Setting, hold| {
        if raw {
            setting.hold(hold)
        } else {
            setting.incremental(t, hold)
        }
    };
    let scale = ["X", "Y", "Z"].map(|axis| {
        let scale = set(&format!("CAL_ACC{sensor}_{axis}SCALE"));
        scale.filter(|_| !raw).unwrap_or(1.0)
    });

    let note = "before 2026 EKF2_GPS_DELAY; EKF2_DELAY_MAX must not be less";
    let delay = delay_ms(&delay_name, delay, [0.0, 300.0], note);
    let mut all = vec![delay.hold(no_receiver)];
    let name = format!("SENS_GPS{receiver}_OFF");
    let antenna = antenna(t, &format!("{name}@"), "EKF2_IMU_POS_@");
    all.extend(antenna.into_iter().map(|antenna| {
        let former = antenna.name.replace(&name, "EKF2_GPS_POS_");
        let antenna = antenna.note(format!("before 2026 {former}"));
        antenna.hold(own_axes.or(no_receiver))
    }));
    let board = [t.mount.roll_rad, t.mount.pitch_rad, t.mount.heading_rad];
    let board_deg = board.map(|angle| angle.scaled(1_f64.to_degrees()));
    let board = Setting::each("SENS_BOARD_@_OFF", "deg", &board_deg).into_iter();
    all.extend(board.map(|board| corrected(board.range([-45.0, 45.0]), own_axes)));
    let names = ["GYRO", "ACC"].map(|kind| format!("CAL_{kind}{sensor}_@OFF"));
    let offsets = offsets(t, [&names[0], &names[1]], scale);
    all.extend(offsets.map(|offset| corrected(offset, hold.or(no_sensor))));
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
    let sensor = number(t, ["IMU ", "GYR and ACC "]).unwrap_or(1);
    // Names of the first have no number except for its position, that of the fourth is in front.
    let (group, number) = match sensor {
        1 => ("INS_".to_owned(), String::new()),
        2..=3 => ("INS_".to_owned(), sensor.to_string()),
        _ => (format!("INS{sensor}_"), String::new()),
    };
    let place = match sensor {
        1..=3 => format!("INS_POS{sensor}_@"),
        _ => format!("{group}POS_@"),
    };
    let receiver = self::number(t, ["GPS "; 2]).unwrap_or(1);
    let no_receiver = (receiver > 2).then_some(NO_NUMBER);
    let rotated = set("AHRS_ORIENTATION").is_some_and(|rotation| rotation != 0.0);
    let turned = t.turned_upright.then_some(TURNED);
    let hold = rotated.then_some(ROTATED).or(turned);
    let scale = ["X", "Y", "Z"].map(|axis| {
        let scale = set(&format!("{group}ACC{number}SCAL_{axis}"));
        scale.filter(|scale| *scale > 0.0).unwrap_or(1.0)
    });

    // Zero selects the default of the driver.
    let (delay, range) = (t.gnss_delay_s.scaled(1e3), [1.0, 250.0]);
    let former = ["before 4.6 GPS_DELAY_MS", "before 4.6 GPS_DELAY_MS2"];
    let former = former[usize::from(receiver > 1)];
    let delay = delay_ms(&format!("GPS{receiver}_DELAY_MS"), delay, range, former);
    let mut all = vec![delay.hold(no_receiver)];
    let name = format!("GPS{receiver}_POS");
    let antenna = antenna(t, &format!("{name}_@"), &place);
    all.extend(antenna.into_iter().map(|antenna| {
        let former = antenna.name.replace(&name, &format!("GPS_POS{receiver}"));
        let antenna = antenna.range([-5.0, 5.0]).hold(no_receiver);
        antenna.note(format!("before 4.6 {former}"))
    }));
    let trim =
        Setting::each("AHRS_TRIM_@", "rad", &[t.mount.roll_rad, t.mount.pitch_rad]).into_iter();
    all.extend(trim.map(|trim| trim.range([-0.1745, 0.1745])));
    let names = ["GYR", "ACC"].map(|kind| format!("{group}{kind}{number}OFFS_@"));
    let offsets = offsets(t, [&names[0], &names[1]], scale);
    all.extend(offsets.map(|offset| offset.range([-3.5, 3.5]).incremental(t, hold)));
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

/// The number after one of these words in the name of the source.
fn number(t: &Tuning, words: [&str; 2]) -> Option<u8> {
    let behind = |word: &str| {
        let (_, behind) = t.source.split_once(word)?;
        behind.split_whitespace().next()?.parse().ok()
    };
    words.into_iter().find_map(behind)
}

/// Antenna in the frame of the autopilot: lever arm plus the position of the unit.
fn antenna(t: &Tuning, name: &str, place: &str) -> Vec<Setting> {
    let axes = ["X", "Y", "Z"].into_iter().zip(frd(&t.lever_arm_m));
    let arm = axes.map(|(axis, arm)| {
        let set = t.parameters.get(&place.replace('@', axis));
        arm.plus(set.copied().unwrap_or(0.0))
    });
    Setting::each(name, "m", &arm.collect::<Vec<_>>())
}

/// The latency: the autopilot subtracts it from the stamps of fixes.
fn delay_ms(name: &str, found: Found, range: [f64; 2], note: &str) -> Setting {
    Setting {
        integer: true,
        ..Setting::new(name, "ms", &[found]).range(range).note(note)
    }
}

/// Offsets of gyros, and of accelerometers with their scale.
fn offsets(t: &Tuning, names: [&str; 2], scale: [f64; 3]) -> impl Iterator<Item = Setting> {
    let unscaled = frd(&t.accel_bias_mps2);
    let accel = [0, 1, 2].map(|axis| unscaled[axis].scaled(1.0 / scale[axis]));
    let gyros = Setting::each(names[0], "rad/s", &frd(&t.gyro_bias_radps));
    let accels = Setting::each(names[1], "m/s^2", &accel);
    gyros.into_iter().chain(accels)
}

/// Noises and their ranges, of a filter that adds `(step_s noise)^2` to the variance of an angle, a velocity
/// and both offsets at each step. Never set, since they are lower bounds.
fn noises_a_step(t: &Tuning, step_s: f64, noises: [(&str, [f64; 2]); 4]) -> Vec<Setting> {
    let densities = [
        ("rad/s", t.gyro_noise),
        ("m/s^2", t.accel_noise),
        ("rad/s^2", t.gyro_bias_walk),
        ("m/s^3", t.accel_bias_walk),
    ];
    let all = noises.into_iter().zip(densities);
    all.map(|((name, range), (unit, density))| {
        let noise = Setting::new(name, unit, &[density.scaled(1.0 / step_s.sqrt())]);
        noise.range(range).hold(Some(LEAST))
    })
    .collect()
}
