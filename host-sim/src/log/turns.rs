//! Turns seen by the gyros against turns seen by GNSS: unit, sign and clock of the gyros.

use nalgebra::{Vector2, Vector3};

use super::Log;
use super::check::{LEAP_SECONDS, Rate, is_leap_seconds, median, within};
use super::error::LogError;
use super::read::Files;

/// Shifts of the clocks that are looked for: so many steps each way, s apart.
const SHIFT_STEPS: i32 = 40;
const SHIFT_STEP_S: f64 = 0.5;

/// A turn rate of the track over a short interval.
struct Turn {
    from_s: f64,
    to_s: f64,
    /// Counter-clockwise, rad/s.
    rate_radps: f64,
}

/// How well the gyros explain the turns at one shift of the clocks.
#[derive(Clone, Copy)]
struct Fit {
    /// How much later GNSS stamps are.
    shift_s: f64,
    correlation: f64,
    slope: f64,
}

/// Compares the rate about the vertical with the turning of the GNSS course.
pub(super) fn check_turns(
    log: &Log,
    rates: &[Rate],
    files: &Files,
    warnings: &mut Vec<LogError>,
) -> Result<(), LogError> {
    check_range(rates, files)?;
    let turns = turns(log);
    let turning = turns
        .iter()
        .filter(|turn| turn.rate_radps.abs() > 0.05)
        .count();
    // Ten seconds of turning, or the fit is chance.
    if turning < 10 {
        check_offset(rates, files, warnings);
        return Ok(());
    }
    let angles = vertical_angles(rates);
    let fits: Vec<Fit> = (-SHIFT_STEPS..=SHIFT_STEPS)
        .filter_map(|step| fit(&turns, &angles, f64::from(step) * SHIFT_STEP_S))
        .collect();
    let strength = |f: &&Fit| f.correlation.abs();
    let Some(best) = fits
        .iter()
        .max_by(|a, b| strength(a).total_cmp(&strength(b)))
    else {
        return Ok(());
    };
    let at_zero = fits.iter().find(|f| f.shift_s == 0.0).copied();
    check_clock(*best, at_zero, files)?;
    // Below 0.8 the track does not follow the nose well enough to judge a scale.
    if best.correlation.abs() < 0.8 {
        Ok(())
    } else {
        check_scale(*best, rates, files, warnings)
    }
}

fn check_range(rates: &[Rate], files: &Files) -> Result<(), LogError> {
    // Half of the time faster than two turns in three seconds: no vehicle navigates so.
    let typical = median(rates.iter().map(|rate| rate.gyro_radps.norm()));
    if typical < 4.0 {
        return Ok(());
    }
    let found = format!("a median rate of {typical:.1} rad/s");
    let cause = "degrees for radians: multiply by 0.0174533; or else rates for increments";
    Err(LogError::file(&files.imu, "angular rates in rad/s", found, cause).in_column("gyro"))
}

fn check_offset(rates: &[Rate], files: &Files, warnings: &mut Vec<LogError>) {
    let mean = rates.iter().map(|r| r.gyro_radps).sum::<Vector3<f64>>() / rates.len() as f64;
    // 6 deg/s, ten times the bias of a consumer gyro.
    if mean.norm() > 0.1 {
        let expected = "a mean angular rate near zero while GNSS sees no turn";
        let found = format!("{:.3} rad/s", mean.norm());
        let cause = "degrees for radians, or a gyro bias beyond any grade";
        warnings.push(LogError::file(&files.imu, expected, found, cause).in_column("gyro"));
    }
}

fn check_clock(best: Fit, at_zero: Option<Fit>, files: &Files) -> Result<(), LogError> {
    let gain = best.correlation.abs() - at_zero.map_or(0.0, |f| f.correlation.abs());
    // A latency is below a second; only a clear gain in correlation names a shift.
    if best.shift_s.abs() < 1.5 || best.correlation.abs() < 0.7 || gain < 0.3 {
        return Ok(());
    }
    let cause = if is_leap_seconds(best.shift_s) {
        LEAP_SECONDS
    } else {
        "the two files were stamped by clocks that differ: bring both to one scale"
    };
    let later = if best.shift_s > 0.0 {
        "later"
    } else {
        "earlier"
    };
    let found = format!(
        "turns of the GNSS track {:.1} s {later} than those of the gyros (correlation {:.2})",
        best.shift_s.abs(),
        best.correlation
    );
    Err(LogError::file(&files.gnss, "both files on one time scale", found, cause).in_column("t_s"))
}

fn check_scale(
    fit: Fit,
    rates: &[Rate],
    files: &Files,
    warnings: &mut Vec<LogError>,
) -> Result<(), LogError> {
    let interval = median(rates.iter().map(|rate| rate.interval_s));
    let found = format!(
        "{:.4} times the turn rate of the GNSS track (correlation {:.2})",
        fit.slope, fit.correlation
    );
    let defect = |cause: &str| {
        let expected = "gyros that turn about the vertical as GNSS does";
        LogError::file(&files.imu, expected, found.clone(), cause).in_column("gyro")
    };
    if fit.slope < 0.0 {
        return Err(defect(
            "gyros and accelerometers of opposite sign or other axes: the vertical is taken from \
             the accelerometers, so check the sign of both against body_axes",
        ));
    }
    let guesses = [
        (
            57.296,
            "degrees for radians: multiply the gyro columns by 0.0174533",
        ),
        (
            1.0 / 57.296,
            "converted from degrees twice: multiply the gyro columns by 57.2958",
        ),
        (interval, "increments for rates in the gyro columns only"),
        (
            1.0 / interval,
            "rates for increments in the gyro columns only",
        ),
    ];
    let off = |value: f64| (fit.slope / value).ln().abs();
    let nearest = guesses.iter().min_by(|a, b| off(a.0).total_cmp(&off(b.0)));
    match nearest.filter(|(value, _)| within(fit.slope, *value, 1.3)) {
        Some((_, cause)) => Err(defect(cause)),
        None if within(fit.slope, 1.0, 1.5) => Ok(()),
        None => {
            warnings.push(defect(
                "another unit, or a track that does not follow the nose",
            ));
            Ok(())
        }
    }
}

/// Turn rates of the track over intervals of a second or more, in motion.
fn turns(log: &Log) -> Vec<Turn> {
    let origin = log.imu[0].time;
    let mut moving = log.gnss.iter().filter_map(|fix| {
        let velocity = fix.velocity_en_mps.filter(|v| v.norm() > 2.0)?;
        Some((fix.time.seconds_since(origin), velocity))
    });
    let Some(mut start) = moving.next() else {
        return Vec::new();
    };
    let mut turns = Vec::new();
    for next in moving {
        let interval = next.0 - start.0;
        if interval < 0.95 {
            continue;
        }
        if interval < 3.0 {
            let rate_radps = turned(start.1, next.1) / interval;
            turns.push(Turn {
                from_s: start.0,
                to_s: next.0,
                rate_radps,
            });
        }
        start = next;
    }
    turns
}

/// Angle from one vector to the next, counter-clockwise.
fn turned(from: Vector2<f64>, to: Vector2<f64>) -> f64 {
    from.perp(&to).atan2(from.dot(&to))
}

/// Time and angle turned so far about the mean direction of the specific force.
fn vertical_angles(rates: &[Rate]) -> Vec<(f64, f64)> {
    let up = rates
        .iter()
        .map(|rate| rate.accel_mps2)
        .sum::<Vector3<f64>>()
        .normalize();
    let mut angle = 0.0;
    rates
        .iter()
        .map(|rate| {
            angle += rate.gyro_radps.dot(&up) * rate.interval_s;
            (rate.time_s, angle)
        })
        .collect()
}

/// Least squares of the gyro's mean rates over the track's, with GNSS shifted.
fn fit(turns: &[Turn], angles: &[(f64, f64)], shift_s: f64) -> Option<Fit> {
    let pairs: Vec<(f64, f64)> = turns
        .iter()
        .filter_map(|turn| {
            let angle = |time_s| angle_at(angles, time_s - shift_s);
            let turned = angle(turn.to_s)? - angle(turn.from_s)?;
            Some((turn.rate_radps, turned / (turn.to_s - turn.from_s)))
        })
        .collect();
    // With less than half of the turns left any shift could look good.
    if pairs.len() * 2 < turns.len() || pairs.len() < 10 {
        return None;
    }
    let n = pairs.len() as f64;
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>() / n;
    let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
    let xx = mean(&|p| (p.0 - x) * (p.0 - x));
    let xy = mean(&|p| (p.0 - x) * (p.1 - y));
    let yy = mean(&|p| (p.1 - y) * (p.1 - y));
    let correlation = xy / (xx * yy).sqrt();
    correlation.is_finite().then_some(Fit {
        shift_s,
        correlation,
        slope: xy / xx,
    })
}

fn angle_at(angles: &[(f64, f64)], time_s: f64) -> Option<f64> {
    let next = angles.partition_point(|(t, _)| *t < time_s);
    let (before, after) = (angles.get(next.checked_sub(1)?)?, angles.get(next)?);
    let share = (time_s - before.0) / (after.0 - before.0);
    Some(before.1 + share * (after.1 - before.1))
}
