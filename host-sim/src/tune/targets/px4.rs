//! PX4, of its source as of 2026.

use super::setting::{ROTATED, Setting, TURNED, file, noise, unscaled};
use crate::log::BodyAxes;
use crate::tune::found::{Found, along};
use crate::tune::mount::Mount;
use crate::tune::tuning::Tuning;

/// One prediction, s: `EKF2_PREDICT_US`, its default (`ekf2/module.yaml`).
pub const STEP_S: f64 = 0.01;

/// Delay, ms: subtracted from the stamp of a fix, so the latency itself.
///
/// `EKF2_GPS_DELAY` ("GPS measurement delay relative to IMU measurements", `ekf2/params_gnss.yaml`);
/// since 2026 `SENS_GPS0_DELAY`, and then taken from the stamps of `vehicle_gps_position` before they
/// are logged (`VehicleGPSPosition.cpp`): what is found there comes on top of what was set.
pub fn delay_ms(latency_s: Found, set_ms: f64) -> Found {
    latency_s.scaled(1e3).plus(set_ms)
}

/// Antenna, m, forward, right, down of the centre of gravity (`EKF2_GPS_POS_X`,
/// `ekf2/params_gnss.yaml`; since 2026 `SENS_GPS0_OFFX`, `vehicle_gps_position/module.yaml`). The
/// filter takes it less `EKF2_IMU_POS`: from the unit where that is zero.
pub fn antenna_m(lever_arm_m: &[Found; 3]) -> [Found; 3] {
    along(BodyAxes::Frd, lever_arm_m)
}

/// Board rotation, deg: roll, pitch and yaw of the board against the vehicle, for `Dcm(Euler(x, y, z))`
/// turns readings from board to vehicle (`SENS_BOARD_X_OFF`, `sensors/sensor_params.yaml`;
/// `GetSensorLevelAdjustment`, `sensor_calibration/Utilities.cpp`).
pub fn board_deg(mount: &Mount) -> [Found; 3] {
    [mount.roll, mount.pitch, mount.heading].map(|angle| angle.scaled(1_f64.to_degrees()))
}

/// Sensor offset, rad/s or m/s^2, forward, right, down: `(reading - offset) * scale`; what is found in
/// corrected readings comes on top, unscaled (`Correct`, `BiasCorrectedSensorOffset`,
/// `sensor_calibration/Accelerometer.hpp`; gyros have no scale).
pub fn offsets(bias: &[Found; 3], scale: [f64; 3]) -> [Found; 3] {
    unscaled(bias, scale)
}

pub(super) fn text(t: &Tuning) -> String {
    let set = |name: &str| t.parameters.get(name).copied();
    let stamped = t.source.contains("vehicle_gps_position");
    let delayed = set("SENS_GPS0_DELAY").filter(|_| stamped);
    let delay = delay_ms(t.gnss_delay_s, delayed.unwrap_or(0.0));
    let rotations = ["ROT", "X_OFF", "Y_OFF", "Z_OFF"].map(|which| format!("SENS_BOARD_{which}"));
    let rotated = (rotations.iter()).any(|name| set(name).is_some_and(|value| value != 0.0));
    // As the sensor reads: neither offset nor scale nor rotation has acted.
    let raw = t.source.starts_with("sensor_gyro");
    let turned = t.turned_upright.then_some(TURNED);
    let own_axes = (rotated && raw).then_some(ROTATED);
    let hold = turned.or((rotated && !raw).then_some(ROTATED));
    let scale = ["X", "Y", "Z"].map(|axis| {
        let scale = set(&format!("CAL_ACC0_{axis}SCALE"));
        scale.filter(|_| !raw).unwrap_or(1.0)
    });
    let (gyro, accel) = (
        offsets(&t.gyro_bias_radps, [1.0; 3]),
        offsets(&t.accel_bias_mps2, scale),
    );
    let acted = |setting: Setting, hold| {
        if raw {
            Setting { hold, ..setting }
        } else {
            setting.on_top(t, hold)
        }
    };
    let mut all = vec![
        Setting {
            whole: true,
            ..Setting::new("SENS_GPS0_DELAY", "ms", &[delay])
        }
        .takes(0.0, 300.0)
        .note("before 2026 EKF2_GPS_DELAY; EKF2_DELAY_MAX must not be less".to_owned()),
    ];
    let antenna = Setting::each("SENS_GPS0_OFF@", "m", &antenna_m(&t.lever_arm_m)).into_iter();
    all.extend(antenna.map(|mut antenna| {
        antenna.hold = own_axes;
        let former = antenna.name.replace("SENS_GPS0_OFF", "EKF2_GPS_POS_");
        antenna.note(format!("before 2026 {former}"))
    }));
    let board = Setting::each("SENS_BOARD_@_OFF", "deg", &board_deg(&t.mount)).into_iter();
    all.extend(board.map(|board| acted(board.takes(-45.0, 45.0), own_axes)));
    for (name, unit, found) in [("GYRO", "rad/s", gyro), ("ACC", "m/s^2", accel)] {
        let offsets = Setting::each(&format!("CAL_{name}0_@OFF"), unit, &found).into_iter();
        all.extend(offsets.map(|offset| acted(offset, hold)));
    }
    all.extend(noises(t));
    file(
        t,
        "PX4: for nsh or the MAVLink console",
        "#",
        |name, values| format!("param set {name} {}", values.concat()),
        &all,
    )
}

/// Noises a step of [`STEP_S`]: the filter adds `(dt noise)^2` to the variance of an angle, a velocity
/// or an offset (`predictCovariance`, `ekf2/EKF/covariance.cpp`; `ekf2/module.yaml`,
/// `ekf2/params_gyro_bias.yaml`).
fn noises(t: &Tuning) -> [Setting; 4] {
    [
        ("EKF2_GYR_NOISE", "rad/s", t.gyro_noise, [1e-4, 0.1]),
        ("EKF2_ACC_NOISE", "m/s^2", t.accel_noise, [0.01, 1.0]),
        ("EKF2_GYR_B_NOISE", "rad/s^2", t.gyro_bias_walk, [0.0, 0.01]),
        ("EKF2_ACC_B_NOISE", "m/s^3", t.accel_bias_walk, [0.0, 0.01]),
    ]
    .map(|(name, unit, density, takes)| noise(name, unit, density, takes, STEP_S))
}
