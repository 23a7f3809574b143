//! `ArduPilot`, of its source as of 4.6.

use super::setting::{ROTATED, Setting, TURNED, file, noise, unscaled};
use crate::log::BodyAxes;
use crate::tune::found::{Found, along};
use crate::tune::mount::Mount;
use crate::tune::tuning::Tuning;

/// One step of the filter, s: `EKF_TARGET_DT` (`AP_NavEKF3_core.h`).
pub const STEP_S: f64 = 0.012;

/// Delay, ms, subtracted from the time of arrival, so the latency itself; zero stands for the
/// driver's own (`GPS1_DELAY_MS`, `AP_GPS_Params.cpp`; before 4.6 `GPS_DELAY_MS`, `AP_GPS.cpp`).
pub fn delay_ms(latency_s: Found) -> Found {
    latency_s.scaled(1e3)
}

/// Antenna, m, forward, right, down of the origin along the board (`GPS1_POS_X`, `AP_GPS_Params.cpp`;
/// before 4.6 `GPS_POS1_X`, `AP_GPS.cpp`). The filter takes it less `INS_POS1`: from the unit where
/// that is zero.
pub fn antenna_m(lever_arm_m: &[Found; 3]) -> [Found; 3] {
    along(BodyAxes::Frd, lever_arm_m)
}

/// Trim, rad: roll and pitch of the board against the frame, for `from_euler(trim)` turns from board to
/// frame (`AHRS_TRIM_X`, `_rotation_autopilot_body_to_vehicle_body`, `AP_AHRS.cpp`). Yaw is not used.
pub fn trim_rad(mount: &Mount) -> [Found; 2] {
    [mount.roll, mount.pitch]
}

/// Sensor offset, rad/s or m/s^2, forward, right, down: `(reading - offset) * scale`; what is found in
/// logged readings, which are corrected, comes on top (`INS_ACCOFFS_X`, `AP_InertialSensor.cpp`;
/// `_rotate_and_correct_accel`, `AP_InertialSensor_Backend.cpp`).
pub fn offsets(bias: &[Found; 3], scale: [f64; 3]) -> [Found; 3] {
    unscaled(bias, scale)
}

/// Part of a sensor's parameter names that is its number: none of the first.
pub fn number(source: &str) -> String {
    let number = source.split_whitespace().find_map(|word| word.parse().ok());
    match number {
        Some(number @ 2..=3_u8) => number.to_string(),
        _ => String::new(),
    }
}

pub(super) fn text(t: &Tuning) -> String {
    let set = |name: &str| t.parameters.get(name).copied();
    let number = number(&t.source);
    let rotated = set("AHRS_ORIENTATION").is_some_and(|rotation| rotation != 0.0);
    let rotated = rotated.then_some(ROTATED);
    let hold = rotated.or(t.turned_upright.then_some(TURNED));
    let scale = ["X", "Y", "Z"]
        .map(|axis| set(&format!("INS_ACC{number}SCAL_{axis}")).filter(|scale| *scale > 0.0))
        .map(|scale| scale.unwrap_or(1.0));
    let (gyro, accel) = (
        offsets(&t.gyro_bias_radps, [1.0; 3]),
        offsets(&t.accel_bias_mps2, scale),
    );

    let mut all = vec![
        Setting {
            whole: true,
            ..Setting::new("GPS1_DELAY_MS", "ms", &[delay_ms(t.gnss_delay_s)])
        }
        .takes(1.0, 250.0)
        .note("before 4.6 GPS_DELAY_MS".to_owned()),
    ];
    let antenna = Setting::each("GPS1_POS_@", "m", &antenna_m(&t.lever_arm_m)).into_iter();
    all.extend(antenna.map(|antenna| {
        let former = antenna.name.replace("GPS1_POS", "GPS_POS1");
        antenna
            .takes(-5.0, 5.0)
            .note(format!("before 4.6 {former}"))
    }));
    let trim = Setting::each("AHRS_TRIM_@", "rad", &trim_rad(&t.mount)).into_iter();
    all.extend(trim.map(|trim| trim.takes(-0.1745, 0.1745)));
    for (kind, unit, found) in [("GYR", "rad/s", gyro), ("ACC", "m/s^2", accel)] {
        let offsets = Setting::each(&format!("INS_{kind}{number}OFFS_@"), unit, &found).into_iter();
        all.extend(offsets.map(|offset| offset.takes(-3.5, 3.5).on_top(t, hold)));
    }
    all.extend(noises(t));
    file(
        t,
        "ArduPilot: a parameter file; gyro offsets stay only where INS_GYR_CAL is 0",
        "#",
        |name, values| format!("{name},{}", values.concat()),
        &all,
    )
}

/// Noises a step of [`STEP_S`]: the filter adds `(dt noise)^2` to the variance (`daxVar`,
/// `CovariancePrediction`, `AP_NavEKF3_core.cpp`; `EK3_GYRO_P_NSE`, `AP_NavEKF3.cpp`).
fn noises(t: &Tuning) -> [Setting; 4] {
    [
        ("EK3_GYRO_P_NSE", "rad/s", t.gyro_noise, [1e-4, 0.1]),
        ("EK3_ACC_P_NSE", "m/s^2", t.accel_noise, [0.01, 1.0]),
        ("EK3_GBIAS_P_NSE", "rad/s^2", t.gyro_bias_walk, [1e-5, 1e-3]),
        ("EK3_ABIAS_P_NSE", "m/s^3", t.accel_bias_walk, [1e-5, 0.02]),
    ]
    .map(|(name, unit, density, takes)| noise(name, unit, density, takes, STEP_S))
}
