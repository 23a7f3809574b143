//! Whether a log can be meant as it stands: units, axes, time scales.

use std::f64::consts::{FRAC_PI_2, PI};

use ins_core::{GnssFix, ImuOutput};
use nalgebra::{Matrix2, Vector2, Vector3};

use super::Log;
use super::axes::BodyAxes;
use super::error::LogError;
use super::read::Files;
use super::turns::check_turns;

const GRAVITY_MPS2: f64 = 9.81;

/// An inertial sample as rates, whatever the log holds.
pub(super) struct Rate {
    pub(super) time_s: f64,
    pub(super) interval_s: f64,
    pub(super) gyro_radps: Vector3<f64>,
    pub(super) accel_mps2: Vector3<f64>,
}

/// Refuses what cannot be meant, warns of what looks suspicious.
pub(super) fn check(
    log: &Log,
    files: &Files,
    warnings: &mut Vec<LogError>,
) -> Result<(), LogError> {
    check_intervals(log, files)?;
    check_time_scales(log, files)?;
    let rates = rates(log);
    check_accelerometer_unit(log, &rates, files, warnings)?;
    check_gravity_axis(log, &rates, files, warnings)?;
    check_position_unit(log, files, warnings)?;
    check_turns(log, &rates, files, warnings)
}

/// Start of a log's own clock: differences from it are exact enough in f64.
fn origin(log: &Log) -> ins_core::Time {
    log.imu[0].time
}

/// Samples as rates, seconds from the first one.
fn rates(log: &Log) -> Vec<Rate> {
    let typical = median_interval_s(log.imu.iter().map(|sample| sample.time));
    let mut last = None;
    log.imu
        .iter()
        .map(|sample| {
            let since = last
                .replace(sample.time)
                .map(|last| sample.time.seconds_since(last));
            let interval_s = since.unwrap_or(typical);
            let scale = match log.meta.imu {
                ImuOutput::Rates => 1.0,
                ImuOutput::Increments => 1.0 / interval_s,
            };
            Rate {
                time_s: sample.time.seconds_since(origin(log)),
                interval_s,
                gyro_radps: sample.gyro * scale,
                accel_mps2: sample.accel * scale,
            }
        })
        .collect()
}

fn check_intervals(log: &Log, files: &Files) -> Result<(), LogError> {
    let imu = median_interval_s(log.imu.iter().map(|sample| sample.time));
    let gnss = median_interval_s(log.gnss.iter().map(|fix| fix.time));
    let refuse = |path, found: f64, expected: &str, cause: &str| {
        let found = format!("{found} s from row to row (median)");
        Err(LogError::file(path, expected, found, cause).in_column("t_s"))
    };
    let milliseconds = "milliseconds for seconds: divide t_s by 1000";
    let nanoseconds = "microseconds or nanoseconds for seconds";
    // A strapdown needs ten samples a second at the very least; receivers give 0.1 to 20 fixes.
    match (imu, gnss) {
        (imu, _) if imu > 200.0 => refuse(
            &files.imu,
            imu,
            "inertial samples 1 to 100 ms apart",
            nanoseconds,
        ),
        (imu, _) if imu > 0.5 => refuse(
            &files.imu,
            imu,
            "inertial samples 1 to 100 ms apart",
            milliseconds,
        ),
        (_, gnss) if gnss > 20_000.0 => refuse(
            &files.gnss,
            gnss,
            "GNSS fixes 0.05 to 10 s apart",
            nanoseconds,
        ),
        (_, gnss) if gnss > 30.0 => refuse(
            &files.gnss,
            gnss,
            "GNSS fixes 0.05 to 10 s apart",
            milliseconds,
        ),
        (imu, _) if log.imu.len() > 1 && imu < 5e-5 => refuse(
            &files.imu,
            imu,
            "inertial samples 1 to 100 ms apart",
            "minutes or kiloseconds for seconds, or stamps of too few digits",
        ),
        _ => Ok(()),
    }
}

fn check_time_scales(log: &Log, files: &Files) -> Result<(), LogError> {
    let first = log.gnss[0].time.seconds_since(origin(log));
    let last = log.gnss[log.gnss.len() - 1].time.seconds_since(origin(log));
    let duration = log.duration_s();
    if first <= duration && last >= 0.0 {
        return Ok(());
    }
    let cause = if is_leap_seconds(first) && is_leap_seconds(last - duration) {
        LEAP_SECONDS
    } else {
        "the two files count from different origins (UTC, GPS week, boot): bring both to one scale"
    };
    let expected = "GNSS fixes within the time of the inertial samples, 0 to ".to_owned();
    let found = format!("fixes from {first:.3} to {last:.3} s, counted from the first sample");
    let expected = format!("{expected}{duration:.3} s");
    Err(LogError::file(&files.gnss, expected, found, cause).in_column("t_s"))
}

pub(super) const LEAP_SECONDS: &str = "leap seconds: one file counts UTC, the other GPS time \
     (18 s ahead since 2017): bring both to one scale";

/// Whether a shift is what GPS time has been ahead of UTC since 2006.
pub(super) fn is_leap_seconds(shift_s: f64) -> bool {
    (13.5..=19.5).contains(&shift_s.abs())
}

fn check_accelerometer_unit(
    log: &Log,
    rates: &[Rate],
    files: &Files,
    warnings: &mut Vec<LogError>,
) -> Result<(), LogError> {
    let norm = median(rates.iter().map(|rate| rate.accel_mps2.norm()));
    let interval = median(rates.iter().map(|rate| rate.interval_s));
    if within(norm, GRAVITY_MPS2, 1.3) {
        // 5 %: twice the worst scale error and bias of consumer sensors.
        if !within(norm, GRAVITY_MPS2, 1.05) {
            let cause = "a large scale error, or a vehicle that turns and accelerates throughout";
            let found = format!("{norm:.3} m/s^2");
            warnings.push(
                LogError::file(
                    &files.imu,
                    "a median specific force near 9.81 m/s^2",
                    found,
                    cause,
                )
                .in_column("accel"),
            );
        }
        return Ok(());
    }
    let g = GRAVITY_MPS2;
    let guesses = match log.meta.imu {
        ImuOutput::Rates => [
            (1.0, "g for m/s^2: multiply by 9.80665"),
            (1000.0, "mg for m/s^2: multiply by 0.00980665"),
            (
                g * interval,
                "increments for rates: say imu = \"increments\" in meta.toml",
            ),
        ],
        ImuOutput::Increments => [
            (1.0, "g s for m/s: multiply by 9.80665"),
            (1000.0, "mg s for m/s: multiply by 0.00980665"),
            (
                g / interval,
                "rates for increments: say imu = \"rates\" in meta.toml",
            ),
        ],
    };
    let cause = guesses
        .iter()
        .find(|(value, _)| within(norm, *value, 1.3))
        .map_or(
            "another unit, or not the accelerometer's columns",
            |(_, cause)| cause,
        );
    let found = format!("{norm:.4}");
    let expected = match log.meta.imu {
        ImuOutput::Rates => "a median specific force near 9.81 m/s^2",
        ImuOutput::Increments => "a median specific force (increment / interval) near 9.81 m/s^2",
    };
    Err(LogError::file(&files.imu, expected, found, cause).in_column("accel"))
}

fn check_gravity_axis(
    log: &Log,
    rates: &[Rate],
    files: &Files,
    warnings: &mut Vec<LogError>,
) -> Result<(), LogError> {
    // Over minutes the vehicle's own accelerations cancel, and what is left points up.
    let mean = rates
        .iter()
        .map(|rate| rate.accel_mps2)
        .sum::<Vector3<f64>>()
        / rates.len() as f64;
    let axes = log.meta.body_axes;
    let tilt_deg = (mean.z / mean.norm()).clamp(-1.0, 1.0).acos().to_degrees();
    // Banked turns keep the mean along the aircraft's up axis, so only a mount tilts it.
    if tilt_deg < 30.0 {
        return Ok(());
    }
    let own = axes.from_rfu(mean);
    let axis = own.iamax();
    let sign = if own[axis] < 0.0 { '-' } else { '+' };
    let found = format!(
        "{sign}{:.2} m/s^2 on {}, mean of the log ({:.2}, {:.2}, {:.2})",
        own[axis].abs(),
        ["x", "y", "z"][axis],
        own.x,
        own.y,
        own.z
    );
    let z = axes.direction(2);
    let reaction = if z == "up" { '+' } else { '-' };
    let expected = format!("gravity's reaction, {reaction}9.81 m/s^2, on z ({z} in {axes})");
    let defect =
        LogError::file(&files.imu, expected, found, gravity_cause(own, axes)).in_column("accel");
    // A sensor may well be mounted tilted; beyond 60 degrees another axis is the vertical one.
    if tilt_deg > 60.0 {
        return Err(defect);
    }
    warnings.push(LogError {
        cause: format!("sensors mounted {tilt_deg:.0} deg off level; if not, turn the axes").into(),
        ..defect
    });
    Ok(())
}

fn gravity_cause(own: Vector3<f64>, declared: BodyAxes) -> String {
    let fits: Vec<String> = BodyAxes::ALL
        .into_iter()
        .filter(|axes| axes.to_rfu(own).z > 0.5 * own.norm())
        .map(|axes| format!("\"{axes}\""))
        .collect();
    if fits.is_empty() {
        let axis = ["x", "y", "z"][own.iamax()];
        return format!(
            "wrong axes: {axis} is the vertical axis, and no body_axes has it there: reorder the \
             columns to {declared}"
        );
    }
    format!(
        "wrong axes or sign: body_axes = {} would fit; or else gravity is logged instead of \
         specific force: change the sign of all three accelerometers",
        fits.join(" or ")
    )
}

fn check_position_unit(
    log: &Log,
    files: &Files,
    warnings: &mut Vec<LogError>,
) -> Result<(), LogError> {
    let steps = steps(&log.gnss);
    // So many make the median firm against multipath.
    if steps.len() < 10 {
        return Ok(());
    }
    let ratio = median(
        steps
            .iter()
            .map(|s| s.moved_m.norm() / s.integrated_m.norm()),
    );
    if !within(ratio, 1.0, 1.25) {
        return unequal_paths(ratio, within_radians(log), files, warnings);
    }
    let apart = |turn: &Matrix2<f64>| {
        let degrees = |s: &Step| s.moved_m.angle(&(turn * s.integrated_m)).to_degrees();
        median(steps.iter().map(degrees))
    };
    // Courses agree to a few degrees where units and names are right.
    let as_is = apart(&Matrix2::identity());
    if as_is < 30.0 {
        return Ok(());
    }
    let guesses = [
        (
            Matrix2::new(0.0, 1.0, 1.0, 0.0),
            "columns ve and vn swapped",
        ),
        (
            Matrix2::new(-1.0, 0.0, 0.0, -1.0),
            "velocity of the opposite sign",
        ),
        (Matrix2::new(-1.0, 0.0, 0.0, 1.0), "ve positive to the west"),
        (
            Matrix2::new(1.0, 0.0, 0.0, -1.0),
            "vn positive to the south",
        ),
    ];
    let defect = |cause: &str| {
        let expected = "velocity along the way from position to position";
        let found = format!("{as_is:.0} deg between them (median)");
        LogError::file(&files.gnss, expected, found, cause).in_column("ve, vn")
    };
    if let Some((_, cause)) = guesses.iter().find(|(turn, _)| apart(turn) < 15.0) {
        return Err(defect(cause));
    }
    warnings.push(defect(
        "velocity and position of different sources, clocks or axes",
    ));
    Ok(())
}

/// Horizontal way between two fixes, from positions and from velocities.
struct Step {
    moved_m: Vector2<f64>,
    integrated_m: Vector2<f64>,
}

/// Length of a step, m: ten times the noise of a plain receiver's positions.
const STEP_M: f64 = 20.0;

/// Cuts the way into steps; holes of three seconds are left out.
fn steps(fixes: &[GnssFix]) -> Vec<Step> {
    let mut steps = Vec::new();
    let mut start = fixes[0];
    let mut integrated_m = Vector2::zeros();
    for pair in fixes.windows(2) {
        let interval_s = pair[1].time.seconds_since(pair[0].time);
        let mean = pair[0]
            .velocity_en_mps
            .zip(pair[1].velocity_en_mps)
            .map(|(a, b)| 0.5 * (a + b));
        let moved = start
            .geodetic_or(0.0)
            .zip(pair[1].geodetic_or(0.0))
            .map(|(from, to)| to.enu_from(&from).xy());
        let (Some(mean), Some(moved_m), true) = (mean, moved, interval_s < 3.0) else {
            (start, integrated_m) = (pair[1], Vector2::zeros());
            continue;
        };
        integrated_m += mean * interval_s;
        if integrated_m.norm() > STEP_M {
            steps.push(Step {
                moved_m,
                integrated_m,
            });
            (start, integrated_m) = (pair[1], Vector2::zeros());
        }
    }
    steps.retain(|step| step.moved_m.norm() > 0.0);
    steps
}

/// Whether the columns of degrees hold nothing that could not be radians.
fn within_radians(log: &Log) -> bool {
    let bounds = (FRAC_PI_2.to_radians(), PI.to_radians());
    let mut positions = log.gnss.iter().filter_map(|fix| fix.position);
    positions.all(|p| p.latitude_rad.abs() <= bounds.0 && p.longitude_rad.abs() <= bounds.1)
}

fn unequal_paths(
    ratio: f64,
    within_radians: bool,
    files: &Files,
    warnings: &mut Vec<LogError>,
) -> Result<(), LogError> {
    let guesses = [
        (1.0 / 3.6, "km/h for m/s in ve and vn"),
        (0.5144, "knots for m/s in ve and vn"),
        (0.01, "cm/s for m/s in ve and vn"),
        (0.001, "mm/s for m/s in ve and vn"),
    ];
    let expected = "the way between positions to equal the integral of velocity";
    let found = format!("{ratio:.4} of it (median)");
    // Radians make the way east too long besides, by the cosine of the true latitude.
    let likely = if within_radians && (0.016..0.1).contains(&ratio) {
        Some("radians for degrees in lat_deg and lon_deg")
    } else {
        guesses
            .iter()
            .find(|(value, _)| within(ratio, *value, 1.1))
            .map(|guess| guess.1)
    };
    let cause = likely.unwrap_or("another unit, or positions that do not follow the motion");
    let defect = LogError::file(&files.gnss, expected, found, cause);
    if likely.is_some() {
        return Err(defect.in_column("lat_deg, lon_deg, ve, vn"));
    }
    warnings.push(defect.in_column("lat_deg, lon_deg, ve, vn"));
    Ok(())
}

/// Whether `value` is `reference` up to a factor.
pub(super) fn within(value: f64, reference: f64, factor: f64) -> bool {
    value < reference * factor && value > reference / factor
}

fn median_interval_s(times: impl Iterator<Item = ins_core::Time>) -> f64 {
    let times: Vec<_> = times.collect();
    median(times.windows(2).map(|pair| pair[1].seconds_since(pair[0])))
}

/// Median; zero of nothing.
pub(super) fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
