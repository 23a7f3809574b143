//! Plausibility of a log: units, axes, time scales, positions against velocities.

use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

use ins_core::earth::LatLon;
use ins_core::{GnssFix, ImuOutput, Time};
use nalgebra::{Matrix2, Vector2, Vector3};

use super::clock::set_clock;
use super::error::{Findings, LogError};
use super::fixes::{repair_fixes, warn_of_early_end};
use super::meta::BodyAxes;
use super::motion::{check_axes, check_readings, check_turns, turn_rate_fit};
use super::rates::Rates;
use super::sensors::repair_sensors;
use super::series::{ALIGNMENT_S, median, median_interval_s, nearest_known, within};
use super::{GRAVITY_MPS2, Log};
use crate::statistics::Line;

/// Checks a log of these files: refuses impossible data, repairs known defects, warns of suspicious ones.
pub(super) fn check(
    log: &mut Log,
    imu: &Path,
    gnss: &Path,
    warnings: &mut Vec<LogError>,
) -> Result<(), LogError> {
    let findings = &mut Findings {
        imu,
        gnss,
        warnings,
    };
    keep_one_recording(log, findings);
    if log.imu.len() < 2 {
        let expected = "inertial samples all along the drive";
        let cause = "the logger stopped, or most of the file is lost";
        return Err(findings.imu("", expected, "a single one", cause));
    }
    let interval_s = median_interval_s(log.imu.times());
    check_intervals(log, interval_s, findings)?;
    repair_fixes(log, findings)?;
    let mut rates = Rates::of(log, interval_s);
    check_accelerometer_unit(log, &rates, findings)?;
    let per_second = 1.0 / log.meta.imu.per_rate(interval_s);
    if repair_sensors(log, per_second, findings)? {
        rates = Rates::of(log, median_interval_s(log.imu.times()));
    }
    check_gravity_axis(log, &rates, findings)?;
    let same_motion = set_clock(log, &rates, findings)?;
    warn_of_early_end(log, findings);
    keep_only_position(log);
    let turns = turn_rate_fit(log, &rates);
    let turns = turns.as_ref();
    check_displacements(log, turns, findings)?;
    check_turns(turns, same_motion, log.duration_s(), &rates, findings)?;
    let warned = findings.warnings.len();
    check_axes(log, turns, &rates, findings);
    // These checks are more specific than that by the motion as a whole.
    if findings.warnings.len() == warned {
        check_readings(log, &rates, findings)?;
    }
    Ok(())
}

/// Longest gap within one recording, s: across a longer one stamps are damaged.
const LONGEST_GAP_S: f64 = 86_400.0;

/// Leaves out samples far in time from most.
fn keep_one_recording(log: &mut Log, findings: &mut Findings) {
    // A shorter log has no such gap, and is not read again.
    if log.duration_s() < LONGEST_GAP_S {
        return;
    }
    let mut pieces: Vec<(Time, Time, usize)> = Vec::new();
    for time in log.imu.times() {
        match pieces.last_mut() {
            Some((_, end, count)) if time.seconds_since(*end) < LONGEST_GAP_S => {
                (*end, *count) = (time, *count + 1);
            }
            _ => pieces.push((time, time, 1)),
        }
    }
    let most = pieces.iter().max_by_key(|(_, _, count)| *count);
    let Some((start, end, count)) = most.filter(|_| pieces.len() > 1) else {
        return;
    };
    let excess = log.imu.len() - count;
    log.imu = log
        .imu
        .between(*start, Time::from_micros(end.as_micros() + 1));
    let expected = "inertial samples of one recording, less than a day apart";
    let found = format!("{excess} of another time than the others");
    let cause = "damaged stamps, or two recordings in one: left out";
    findings.warn(findings.imu("t_s", expected, found, cause));
}

/// Keeps a position given only before the first sample, for a receiver without positions: the core uses no
/// fix from before the samples.
fn keep_only_position(log: &mut Log) {
    let start = log.start();
    let early = log.gnss.partition_point(|fix| fix.time < start);
    let (early, rest) = log.gnss.split_at_mut(early);
    let position = early.iter().rev().find_map(|fix| fix.position);
    let later = rest.iter().any(|fix| fix.position.is_some());
    if let Some(first) = rest.first_mut().filter(|_| !later) {
        first.position = position;
    }
}

fn check_intervals(log: &Log, imu_s: f64, findings: &mut Findings) -> Result<(), LogError> {
    let gnss_s = median_interval_s(log.gnss.iter().map(|fix| fix.time));
    let fixes_s = gnss_s * log.gnss.len() as f64;
    let found = |seconds: f64| {
        let digits = format!("{seconds:.6}");
        let digits = digits.trim_end_matches('0').trim_end_matches('.');
        format!("{digits} s from row to row (median)")
    };
    let imu = |cause: &str| {
        let expected = "inertial samples 1 to 100 ms apart";
        Err(findings.imu("t_s", expected, found(imu_s), cause))
    };
    let gnss = |cause: &str| {
        let expected = "GNSS fixes 0.05 to 10 s apart";
        Err(findings.gnss("t_s", expected, found(gnss_s), cause))
    };
    let milliseconds = "milliseconds for seconds: divide t_s by 1000";
    let nanoseconds = "microseconds or nanoseconds for seconds";
    let dense = imu_s < 5e-5 || imu_s < 5e-4 && fixes_s > 30.0 * log.duration_s();
    // Strapdown navigation needs at least ten samples a second; receivers give 0.1 to 20 fixes a second.
    if imu_s > 200.0 {
        return imu(nanoseconds);
    } else if imu_s > 0.5 {
        // The unit is right where both files have the same duration.
        let slow = "too slow for inertial navigation, which needs ten samples a second and more";
        let as_long = gnss_s < 30.0 && within(fixes_s, log.duration_s(), 2.0);
        return imu(if as_long { slow } else { milliseconds });
    } else if gnss_s > 20_000.0 {
        return gnss(nanoseconds);
    } else if gnss_s > 30.0 {
        return gnss(milliseconds);
    } else if dense {
        return imu("minutes or kiloseconds for seconds, or stamps of too few digits");
    }
    if imu_s > 0.045 {
        let cause = "right where each reading is the mean over its interval or an increment; \
                     every tenth of faster readings, say, aliases vibration and misses turns";
        let expected = "inertial samples 1 to 40 ms apart";
        findings.warn(findings.imu("t_s", expected, found(imu_s), cause));
    }
    if gnss_s > 3.0 {
        let found = format!("{gnss_s:.1} s from row to row (median)");
        let cause = "too seldom to show turns and brakings: estimates come late, if at all";
        let expected = "GNSS fixes 0.05 to 2 s apart";
        findings.warn(findings.gnss("t_s", expected, found, cause));
    }
    if log.duration_s() < ALIGNMENT_S {
        let found = format!("{:.1} s", log.duration_s());
        let cause = "too short to align and to manoeuvre: nothing can be found";
        findings.warn(findings.imu("", "a minute of motion and more", found, cause));
    }
    Ok(())
}

fn check_accelerometer_unit(
    log: &Log,
    rates: &Rates,
    findings: &mut Findings,
) -> Result<(), LogError> {
    let (norm, interval) = (rates.median.force_norm_mps2, rates.median.interval_s);
    let near_g = "a median specific force near 9.81 m/s^2";
    // Wide for a racing multirotor; a wrong unit is off by three times or more.
    if within(norm, GRAVITY_MPS2, 2.0) {
        // 5 %: twice the worst scale error and bias of consumer sensors.
        if !within(norm, GRAVITY_MPS2, 1.05) {
            let cause = "a large scale error, or a vehicle that turns and accelerates throughout";
            let found = format!("{norm:.3} m/s^2");
            findings.warn(findings.imu("accel", near_g, found, cause));
        }
        return Ok(());
    }
    let g = GRAVITY_MPS2;
    let to_increments = "increments for rates: say imu = \"increments\" in meta.toml";
    let to_rates = "rates for increments: say imu = \"rates\" in meta.toml";
    let (expected, units) = match log.meta.imu {
        ImuOutput::Rates => (
            near_g,
            [
                (1.0, "g for m/s^2: multiply by 9.80665"),
                (
                    1000.0,
                    "mg for m/s^2: multiply by 0.00980665; or cm/s^2: multiply by 0.01",
                ),
                (1000.0 * g, "mm/s^2 for m/s^2: multiply by 0.001"),
                (g * interval, to_increments),
            ],
        ),
        ImuOutput::Increments => (
            "a median specific force (increment / interval) near 9.81 m/s^2",
            [
                (1.0, "g s for m/s: multiply by 9.80665"),
                (1000.0, "mg s for m/s: multiply by 0.00980665"),
                (1000.0 * g, "mm/s for m/s: multiply by 0.001"),
                (g / interval, to_rates),
            ],
        ),
    };
    let mut fitting = units.iter().filter(|(value, _)| within(norm, *value, 1.3));
    // Increments for rates concern the gyros, too; units of the accelerometers do not.
    let gyros_are_right = turn_rate_fit(log, rates)
        .filter(|fit| fit.correlation.abs() > 0.8)
        .is_some_and(|fit| within(fit.slope.abs(), 1.0, 1.5));
    let likely = if gyros_are_right {
        fitting.next()
    } else {
        fitting.next_back()
    };
    let other = "another unit, or not the accelerometer's columns";
    let cause = likely.map_or(other, |(_, cause)| cause);
    Err(findings.imu("accel", expected, format!("{norm:.4}"), cause))
}

fn check_gravity_axis(log: &Log, rates: &Rates, findings: &mut Findings) -> Result<(), LogError> {
    // Over minutes the vehicle's own accelerations cancel, and the specific force points up.
    let mean = rates.median.force_mps2;
    let axes = log.meta.body_axes;
    let tilt_deg = (mean.z / mean.norm()).clamp(-1.0, 1.0).acos().to_degrees();
    // In banked turns specific force stays along the aircraft's up axis: only the mount tilts it.
    if tilt_deg < 30.0 {
        return Ok(());
    }
    let own = axes.from_rfu(mean);
    let axis = own.iamax();
    let sign = if own[axis] < 0.0 { '-' } else { '+' };
    let (size, name) = (own[axis].abs(), ["x", "y", "z"][axis]);
    let (x, y, z) = (own.x, own.y, own.z);
    let found =
        format!("{sign}{size:.2} m/s^2 on {name}, median of the log ({x:.2}, {y:.2}, {z:.2})");
    let z = axes.direction(2);
    let reaction = if z == "up" { '+' } else { '-' };
    let expected = format!("gravity's reaction, {reaction}9.81 m/s^2, on z ({z} in {axes})");
    let defect = findings.imu("accel", expected, found, gravity_cause(own, axes));
    // A mount may be tilted; beyond 60 deg another axis is the vertical one.
    if tilt_deg > 60.0 {
        return Err(defect);
    }
    let cause =
        format!("sensors mounted {tilt_deg:.0} deg off level; if not, turn the axes").into();
    findings.warn(LogError { cause, ..defect });
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

/// Whether displacements between positions are the integral of velocity.
pub(super) fn check_displacements(
    log: &Log,
    turns: Option<&Line>,
    findings: &mut Findings,
) -> Result<(), LogError> {
    // Enough for the median to be robust against multipath.
    let steps_of = |length| Some(steps(&log.gnss, length)).filter(|steps| steps.len() >= 10);
    let Some(steps) = steps_of(STEP_M) else {
        return Ok(());
    };
    let mut ratio = distance_ratio(&steps);
    // In a far smaller unit of velocity the steps are so short that position noise dominates.
    if ratio < 0.1
        && let Some(longer) = steps_of(4.0 * STEP_M / ratio)
    {
        ratio = distance_ratio(&longer);
    }
    let off_deg = |turn: &Matrix2<f64>| course_difference_deg(&steps, turn);
    let is_right = |ratio: f64, steps: &[Step]| {
        within(ratio, 1.0, 1.25) && course_difference_deg(steps, &Matrix2::identity()) < 15.0
    };
    if !is_right(ratio, &steps)
        && let Some(swapped) = swapped_lat_lon(&log.gnss)
        && let steps = self::steps(&swapped, STEP_M)
        && is_right(distance_ratio(&steps), &steps)
    {
        let expected = "positions along the velocity";
        let found = "that, with latitude and longitude exchanged";
        let cause = "columns lat_deg and lon_deg swapped";
        return Err(findings.gnss(HORIZONTAL_COLUMNS, expected, found, cause));
    }
    if !within(ratio, 1.0, 1.25) {
        return unequal_distances(ratio, within_radians(log), findings);
    }
    // Courses agree to a few degrees where units and columns are right.
    let as_is = off_deg(&Matrix2::identity());
    let hypotheses = hypotheses(turns).map(|(turn, cause)| (off_deg(&turn), cause));
    let best = hypotheses.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    let defect = |cause: &str| {
        let expected = "velocity along the way from position to position";
        let found = format!("{as_is:.0} deg between them (median)");
        findings.gnss(HORIZONTAL_COLUMNS, expected, found, cause)
    };
    // On a route along a diagonal swapped columns have a small median, but right ones a smaller one.
    let best = best.filter(|(off, _)| *off < 15.0 && as_is > 3.0 * off + 10.0);
    if let Some((_, cause)) = best {
        return Err(defect(cause));
    }
    if as_is > 30.0 {
        let cause = "velocity and position of different sources, clocks or axes";
        findings.warn(defect(cause));
    }
    Ok(())
}

/// Median ratio of displacements by positions to those by velocities.
fn distance_ratio(steps: &[Step]) -> f64 {
    median((steps.iter()).map(|s| s.moved_m.norm() / s.integrated_m.norm()))
}

/// Median difference of their courses, with the velocities transformed, deg.
fn course_difference_deg(steps: &[Step], turn: &Matrix2<f64>) -> f64 {
    let degrees = |s: &Step| s.moved_m.angle(&(turn * s.integrated_m)).to_degrees();
    median(steps.iter().map(degrees))
}

/// The fixes with latitude and longitude swapped, if that is possible.
fn swapped_lat_lon(fixes: &[GnssFix]) -> Option<Vec<GnssFix>> {
    let swap = |fix: &GnssFix| {
        let position = match fix.position {
            Some(at) if at.longitude_rad.abs() > FRAC_PI_2 => return None,
            position => position.map(|at| LatLon {
                latitude_rad: at.longitude_rad,
                longitude_rad: at.latitude_rad,
            }),
        };
        Some(GnssFix { position, ..*fix })
    };
    fixes.iter().map(swap).collect()
}

/// Transformations of velocity that may align it with positions, and their causes. The sign of the turn
/// rate fit shows whether velocity or position has the wrong sign.
fn hypotheses(turns: Option<&Line>) -> [(Matrix2<f64>, &'static str); 5] {
    let (west, south) = match turns.map(|fit| fit.slope > 0.0) {
        Some(true) => ("the sign of lon_deg is lost", "the sign of lat_deg is lost"),
        Some(false) => ("ve positive to the west", "vn positive to the south"),
        None => (
            "ve positive to the west, or the sign of lon_deg is lost",
            "vn positive to the south, or the sign of lat_deg is lost",
        ),
    };
    let (swapped, opposite) = ("columns ve and vn swapped", "velocity of the opposite sign");
    let both = "columns ve and vn swapped, with the opposite sign";
    [
        (Matrix2::new(0.0, 1.0, 1.0, 0.0), swapped),
        (Matrix2::new(-1.0, 0.0, 0.0, -1.0), opposite),
        (Matrix2::new(-1.0, 0.0, 0.0, 1.0), west),
        (Matrix2::new(1.0, 0.0, 0.0, -1.0), south),
        (Matrix2::new(0.0, -1.0, -1.0, 0.0), both),
    ]
}

const HORIZONTAL_COLUMNS: &str = "lat_deg, lon_deg, ve, vn";

/// Horizontal displacement between two fixes, by positions and by velocities.
struct Step {
    moved_m: Vector2<f64>,
    integrated_m: Vector2<f64>,
}

/// Length of a step, m: ten times the position noise of a single-frequency receiver.
const STEP_M: f64 = 20.0;

/// Displacements of this length by velocities; gaps of three seconds are left out.
fn steps(fixes: &[GnssFix], length_m: f64) -> Vec<Step> {
    let mut steps = Vec::new();
    let mut start = fixes[0];
    let mut integrated_m = Vector2::zeros();
    for pair in fixes.windows(2) {
        let interval_s = pair[1].time.seconds_since(pair[0].time);
        let ends = pair[0].velocity_en_mps.zip(pair[1].velocity_en_mps);
        let positions = start.geodetic_or(0.0).zip(pair[1].geodetic_or(0.0));
        let (Some((a, b)), Some((from, to)), true) = (ends, positions, interval_s < 3.0) else {
            (start, integrated_m) = (pair[1], Vector2::zeros());
            continue;
        };
        integrated_m += 0.5 * (a + b) * interval_s;
        if integrated_m.norm() > length_m {
            let moved_m = to.enu_from(&from).xy();
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

/// Whether all positions would be in range as radians.
fn within_radians(log: &Log) -> bool {
    let bounds = (FRAC_PI_2.to_radians(), PI.to_radians());
    let mut positions = log.gnss.iter().filter_map(|fix| fix.position);
    positions.all(|p| p.latitude_rad.abs() <= bounds.0 && p.longitude_rad.abs() <= bounds.1)
}

fn unequal_distances(
    ratio: f64,
    within_radians: bool,
    findings: &mut Findings,
) -> Result<(), LogError> {
    let units = [
        (1.0 / 3.6, "km/h for m/s in ve and vn"),
        (0.5144, "knots for m/s in ve and vn"),
        (0.447, "miles per hour for m/s in ve and vn"),
        (0.3048, "ft/s for m/s in ve and vn"),
        (0.01, "cm/s for m/s in ve and vn"),
        (0.001, "mm/s for m/s in ve and vn"),
    ];
    let expected = "the way between positions to equal the integral of velocity";
    let found = format!("{ratio:.4} of it (median)");
    // Radians for degrees also stretch east displacements, by the cosine of the true latitude.
    let likely = if within_radians && (0.016..0.1).contains(&ratio) {
        Some("radians for degrees in lat_deg and lon_deg")
    } else {
        nearest_known(units, ratio, 1.07)
    };
    let cause = likely.unwrap_or("another unit, or positions that do not follow the motion");
    let defect = findings.gnss(HORIZONTAL_COLUMNS, expected, found, cause);
    if likely.is_some() {
        return Err(defect);
    }
    findings.warn(defect);
    Ok(())
}
