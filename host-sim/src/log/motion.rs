//! Units, signs and order of the sensor channels, checked against the motion by GNSS and against each
//! other.

use nalgebra::{Matrix2, Vector2, Vector3};

use super::Log;
use super::clock::{MotionComparison, TimeOffset};
use super::error::{Findings, LogError};
use super::meta::BodyAxes;
use super::rates::{Rate, Rates};
use super::series::{ALIGNMENT_S, Curve, intervals, nearest_known, signed_angle, within};
use crate::statistics::Line;

/// Correlation that determines a sign, and least number of intervals for it.
const CLEAR_CORRELATION: f64 = 0.6;
const MIN_INTERVALS: usize = 30;
const EQUAL_TURNS: &str = "gyros that turn about the vertical as GNSS does";

// --- Turns about the vertical. ---

/// Linear fit of the rate about the vertical over the turn rate of the course; none without turns.
pub(super) fn turn_rate_fit(log: &Log, rates: &Rates) -> Option<Line> {
    let moving = moving_intervals(log);
    let turning = (moving.iter()).filter(|interval| course_rate_radps(interval).abs() > 0.05);
    // With less than ten seconds of turning the fit is by chance.
    if turning.count() < 10 {
        return None;
    }
    fit(&moving, &rates.angles_about_vertical())
}

/// Unit and sign of the gyros by the fit.
pub(super) fn check_turns(
    fit: Option<&Line>,
    same_motion: bool,
    duration_s: f64,
    rates: &Rates,
    findings: &mut Findings,
) -> Result<(), LogError> {
    // Below 0.8 course and heading differ too much to judge a scale.
    if let Some(fit) = fit.filter(|fit| fit.correlation.abs() >= 0.8) {
        return check_scale(fit, rates, findings);
    }
    check_range(rates, findings)?;
    match fit {
        // A correlation of 0.5 is not by chance.
        Some(fit) if !same_motion && fit.correlation.abs() < 0.5 => warn_unrelated(fit, findings),
        // A shorter one may be a single turn.
        None if duration_s > ALIGNMENT_S => check_offset(rates, findings),
        _ => {}
    }
    Ok(())
}

fn check_range(rates: &Rates, findings: &Findings) -> Result<(), LogError> {
    // Half of the time faster than 230 deg/s: no vehicle.
    let rate_radps = rates.median.gyro_norm_radps;
    if rate_radps < 4.0 {
        return Ok(());
    }
    let found = format!("a median rate of {rate_radps:.1} rad/s");
    let cause = "degrees for radians: multiply by 0.0174533; or else deg/h, mdeg/s, or rates for \
                 increments";
    Err(findings.imu("gyro", "angular rates in rad/s", found, cause))
}

fn check_offset(rates: &Rates, findings: &mut Findings) {
    let mean = rates.mean_gyro_radps;
    // 6 deg/s, ten times the bias of a consumer gyro.
    if mean.norm() > 0.1 {
        let expected = "a mean angular rate near zero while GNSS sees no turn";
        let found = format!("{:.3} rad/s", mean.norm());
        let cause = "degrees for radians, or a gyro bias beyond any grade";
        findings.warn(findings.imu("gyro", expected, found, cause));
    }
}

fn warn_unrelated(fit: &Line, findings: &mut Findings) {
    let found = format!("a correlation of {:.2} between the two", fit.correlation);
    let cause = "files of different drives, clocks that differ, or a vehicle whose nose does not \
                 follow its track (multirotor, boat)";
    findings.warn(findings.gnss("", EQUAL_TURNS, found, cause));
}

fn check_scale(fit: &Line, rates: &Rates, findings: &mut Findings) -> Result<(), LogError> {
    let found = format!(
        "{:.4} times the turn rate of the GNSS track (correlation {:.2})",
        fit.slope, fit.correlation
    );
    let defect = |cause: &str| findings.imu("gyro", EQUAL_TURNS, found.clone(), cause);
    if fit.slope < 0.0 {
        return Err(defect(
            "gyro_z of the wrong sign, or gyros and accelerometers of opposite sign or other axes: the \
             vertical is taken from the accelerometers, so check the sign of both against body_axes",
        ));
    }
    match nearest_known(gyro_units(rates), fit.slope, 1.3) {
        Some(cause) => Err(defect(&cause)),
        None if within(fit.slope, 1.0, 1.5) => Ok(()),
        None => {
            let cause = "another unit, or a track that does not follow the nose";
            findings.warn(defect(cause));
            Ok(())
        }
    }
}

/// Mistaken units of gyros, and the factor by which the readings are then too large.
fn gyro_units(rates: &Rates) -> impl Iterator<Item = (f64, String)> {
    let interval = rates.median.interval_s;
    let units = [
        (57.296, "degrees for radians", "0.0174533"),
        (57_296.0, "mdeg/s for rad/s", "1.74533e-5"),
        (206_265.0, "deg/h for rad/s", "4.84814e-6"),
        (1000.0, "mrad/s for rad/s", "0.001"),
        (1.0 / 57.296, "converted from degrees twice", "57.2958"),
    ];
    let units = units.map(|(times, what, by)| {
        let cause = format!("{what}: multiply the gyro columns by {by}");
        (times, cause)
    });
    let forms = [
        (interval, "increments for rates"),
        (1.0 / interval, "rates for increments"),
    ];
    let forms = forms.map(|(times, what)| (times, format!("{what} in the gyro columns only")));
    units.into_iter().chain(forms)
}

/// Times and velocities at the ends of a short interval, s and m/s.
type MovingInterval = [(f64, Vector2<f64>); 2];

/// Short intervals in motion.
fn moving_intervals(log: &Log) -> Vec<MovingInterval> {
    let origin = log.start();
    let moving = log.gnss.iter().filter_map(|fix| {
        let velocity = fix.velocity_en_mps.filter(|v| v.norm() > 2.0)?;
        Some((fix.time.seconds_since(origin), velocity))
    });
    intervals(moving)
}

/// Turn rate of the course, counter-clockwise.
fn course_rate_radps([from, to]: &MovingInterval) -> f64 {
    signed_angle(from.1, to.1) / (to.0 - from.0)
}

/// Least-squares line of mean gyro rates over turn rates of the course.
fn fit(moving: &[MovingInterval], angles: &Curve) -> Option<Line> {
    let pairs: Vec<(f64, f64)> = moving
        .iter()
        .filter_map(|interval @ [from, to]| {
            let turned = angles.change(from.0, to.0)?;
            Some((course_rate_radps(interval), turned / (to.0 - from.0)))
        })
        .collect();
    let line = Line::through(&pairs);
    (pairs.len() >= 10 && line.correlation.is_finite()).then_some(line)
}

// --- Horizontal accelerations, and rotation of gravity in the body. ---

/// Warns where accelerometers show the motion in other axes than declared.
pub(super) fn check_axes(log: &Log, turns: Option<&Line>, rates: &Rates, findings: &mut Findings) {
    // Under a canopy or on a cable heading does not follow course, and swinging inverts accelerations.
    let nose_follows_track = turns.is_none_or(|fit| fit.correlation > 0.5);
    if let Some(correlation) = track_correlations(log, rates).filter(|_| nose_follows_track) {
        check_horizontal_axes(log, &correlation, findings);
    }
    check_gravity_rotation(log, rates, findings);
}

/// Accelerations right and forward, by the sensors and by GNSS.
type Pair = (Vector2<f64>, Vector2<f64>);

/// Correlations of the accelerations right and forward by the sensors (rows) with those by GNSS
/// (columns), for a vehicle whose heading follows its course; none without manoeuvres.
fn track_correlations(log: &Log, rates: &Rates) -> Option<Matrix2<f64>> {
    let mut curves: [Curve; 2] = Default::default();
    let mut sum = Vector3::zeros();
    for rate in rates.iter() {
        sum += rate.accel_mps2 * rate.interval_s;
        for (axis, curve) in curves.iter_mut().enumerate() {
            curve.push(rate.time_s, sum[axis]);
        }
    }
    let mut pairs: Vec<Pair> = Vec::new();
    for [(from_s, before), (to_s, after)] in moving_intervals(log) {
        let sensed = [0, 1].map(|axis: usize| curves[axis].change(from_s, to_s));
        if let [Some(sensed_right), Some(sensed_forward)] = sensed {
            let speed = 0.5 * (before.norm() + after.norm());
            let right = -speed * signed_angle(before, after);
            let forward = after.norm() - before.norm();
            let sensed = Vector2::new(sensed_right, sensed_forward);
            let seconds = to_s - from_s;
            pairs.push((sensed / seconds, Vector2::new(right, forward) / seconds));
        }
    }
    // Half a minute of accelerations above the gravity component on a sloping road.
    let strong = |axis: usize| pairs.iter().filter(|p| p.1[axis].abs() > 0.5).count();
    if strong(0) < MIN_INTERVALS || strong(1) < MIN_INTERVALS {
        return None;
    }
    // Turns correlated with braking do not separate the axes.
    let of = |pick: &dyn Fn(&Pair) -> (f64, f64)| {
        Line::through(&pairs.iter().map(pick).collect::<Vec<_>>()).correlation
    };
    if of(&|p| (p.1.x, p.1.y)).abs() > 0.5 {
        return None;
    }
    Some(Matrix2::from_fn(|row, column| {
        of(&|p| (p.0[row], p.1[column]))
    }))
}

fn check_horizontal_axes(log: &Log, correlation: &Matrix2<f64>, findings: &mut Findings) {
    let c = correlation;
    let expected = "accelerometers that measure braking along forward and turns along right";
    let mut warn = |found: String, cause: String, doubt: bool| {
        let defect = findings.imu("accel", expected, found, cause);
        findings.warn(LogError { doubt, ..defect });
    };
    let axes = log.meta.body_axes;
    let (a, b) = (c[(0, 1)], c[(1, 0)]);
    if a.abs() > CLEAR_CORRELATION && b.abs() > CLEAR_CORRELATION {
        let [right, forward] = [a, b].map(|value| if value < 0.0 { "-" } else { "" });
        let found = format!(
            "{right}right where forward is, {forward}forward where right is (correlations \
             {a:.2}, {b:.2})"
        );
        let mut all = BodyAxes::ALL.into_iter();
        let cause = match all.find(|other| would_fit(axes, *other, c)) {
            Some(other) => format!(
                "body_axes = \"{other}\" would fit; as it is heading and the names of the axes \
                 are a quarter turn off"
            ),
            None if a * b > 0.0 => {
                "accel_x and accel_y are swapped, and gyro_x and gyro_y may be".to_owned()
            }
            None => "columns of another order, or a unit mounted sideways".to_owned(),
        };
        warn(found, cause, true);
        return;
    }
    for (axis, name) in [(0, "right"), (1, "forward")] {
        if c[(axis, axis)] < -CLEAR_CORRELATION {
            // The unit as a whole may be turned; a single sensor is wrong.
            let turned = c[(1 - axis, 1 - axis)] < -CLEAR_CORRELATION;
            let cause = if turned {
                "mounted backwards, or both level accelerometers of the wrong sign: heading is \
                 half a turn off"
                    .to_owned()
            } else {
                format!("accel_{} has the wrong sign", axes.letter(axis))
            };
            let found = format!("the opposite {name} (correlation {:.2})", c[(axis, axis)]);
            warn(found, cause, !turned);
            if turned {
                return;
            }
        }
    }
}

/// Whether columns in `other` axes, read as `axes`, would have the signs of the correlations `c`.
fn would_fit(axes: BodyAxes, other: BodyAxes, c: &Matrix2<f64>) -> bool {
    let true_rfu = |axis| other.to_rfu(axes.from_rfu(Vector3::ith(axis, 1.0)));
    let agrees = |sensed: usize| true_rfu(sensed)[1 - sensed] * c[(sensed, 1 - sensed)] > 0.5;
    // Up stays up.
    true_rfu(2).z > 0.0 && agrees(0) && agrees(1)
}

/// Gravity rotates in the body opposite to the vehicle: a clear negative correlation with the gyros is a
/// wrong sign of one of the two.
fn check_gravity_rotation(log: &Log, rates: &Rates, findings: &mut Findings) {
    let blocks: Vec<Block> = blocks(rates).collect();
    let names = [("right", "forward"), ("forward", "right")];
    for (axis, (name, about)) in names.into_iter().enumerate() {
        let changes = || blocks.windows(2).map(|pair| gravity_change(pair, axis));
        // 0.25 m/s^2 is 1.5 deg per block: far above a road's unevenness.
        let clear = changes().filter(|(gyro, _)| gyro.abs() > 0.25).count();
        let correlation = Line::from_origin(changes()).correlation;
        if clear < MIN_INTERVALS || correlation > -CLEAR_CORRELATION {
            continue;
        }
        let found = format!("the opposite {name} (correlation {correlation:.2})");
        let cause = format!(
            "the accelerometer {name} or the gyro {about} has the wrong sign against body_axes = \"{}\"",
            log.meta.body_axes
        );
        let expected = "gravity that rotates in the body as the gyros measure";
        findings.warn(LogError {
            doubt: true,
            ..findings.imu("gyro, accel", expected, found, cause)
        });
    }
}

/// Shorter than changes of attitude, longer than periods of vibration.
const BLOCK_S: f64 = 0.2;

/// Mean angular rate and specific force.
type Block = (Vector3<f64>, Vector3<f64>);

/// Change of gravity along an axis from block to block, by gyros and by accelerometers.
fn gravity_change(pair: &[Block], axis: usize) -> (f64, f64) {
    let (last, block) = (&pair[0], &pair[1]);
    let reversed_turn = -0.5 * (last.0 + block.0) * BLOCK_S;
    let force = 0.5 * (last.1 + block.1);
    (reversed_turn.cross(&force)[axis], (block.1 - last.1)[axis])
}

fn blocks(rates: &Rates) -> impl Iterator<Item = Block> {
    #[allow(clippy::cast_possible_truncation)] // Seconds of a log.
    let block_index = |rate: &Rate| (rate.time_s / BLOCK_S) as i64;
    let mut rates = rates.iter().peekable();
    std::iter::from_fn(move || {
        let first = rates.next()?;
        let (mut gyro, mut accel, mut n) = (first.gyro_radps, first.accel_mps2, 1.0);
        while let Some(rate) = rates.next_if(|rate| block_index(rate) == block_index(&first)) {
            gyro += rate.gyro_radps;
            accel += rate.accel_mps2;
            n += 1.0;
        }
        Some((gyro / n, accel / n))
    })
}

// --- All motion by GNSS, independent of mount and vehicle: a wrong sign makes the sensors' frame
// left-handed, and no rotation of it fits the motion. ---

/// Evidence of other units, signs or axes than declared: so many times that as declared, and so much more,
/// beyond chance in a minute of motion.
const EVIDENCE_RATIO: f64 = 1.05;
const EVIDENCE_MARGIN: f64 = 20.0;
/// Ten times the offset of a consumer gyro, rad/s.
const MAX_OFFSET_RADPS: f64 = 0.1;
/// Part of the log that is examined, s.
const EXAMINED_S: f64 = 1800.0;

/// Other units, signs or axes that the readings may have.
struct Hypothesis {
    cause: String,
    column: &'static str,
    /// Whether the log is refused.
    fatal: bool,
    remap: Box<dyn Fn(&mut Rate)>,
}

impl Hypothesis {
    fn new(column: &'static str, cause: String, remap: impl Fn(&mut Rate) + 'static) -> Self {
        Self {
            cause,
            column,
            fatal: false,
            remap: Box::new(remap),
        }
    }
}

/// Reports other units, signs or axes of the channels that fit the motion far better.
pub(super) fn check_readings(
    log: &Log,
    rates: &Rates,
    findings: &mut Findings,
) -> Result<(), LogError> {
    let examined = rates.until(EXAMINED_S);
    let mut comparison = MotionComparison::new(log, &examined);
    let as_read = comparison.refined(comparison.at(0.0));
    let mut best: Option<(TimeOffset, Hypothesis)> = None;
    for hypothesis in hypotheses(log, rates) {
        comparison.set_rates(&examined.remapped(&hypothesis.remap));
        let coarse = comparison.at(as_read.offset_s);
        if coarse.evidence < as_read.evidence {
            continue;
        }
        let offset = comparison.refined(coarse);
        if hypothesis.fatal
            && !(offset.is_decisive_over(&as_read) && comparison.is_explained_by(&offset))
        {
            continue;
        }
        let better = |(best, _): &(TimeOffset, Hypothesis)| offset.evidence > best.evidence;
        if best.as_ref().is_none_or(better) {
            best = Some((offset, hypothesis));
        }
    }
    let threshold = EVIDENCE_RATIO * as_read.evidence.max(0.0) + EVIDENCE_MARGIN;
    let Some((offset, hypothesis)) = best.filter(|(offset, _)| offset.evidence > threshold) else {
        return Ok(());
    };
    let expected = "sensors that measure the motion that GNSS shows";
    let found = format!(
        "other readings that explain it far better (evidence {:.0} against {:.0})",
        offset.evidence, as_read.evidence
    );
    let defect = findings.imu(hypothesis.column, expected, found, hypothesis.cause);
    if hypothesis.fatal {
        return Err(defect);
    }
    findings.warn(LogError {
        doubt: true,
        ..defect
    });
    Ok(())
}

fn hypotheses(log: &Log, rates: &Rates) -> Vec<Hypothesis> {
    let name = |component: usize| log.meta.body_axes.letter(component);
    let all = "all gyros have the wrong sign".to_owned();
    let mut hypotheses = vec![Hypothesis::new("gyro", all, |rate| rate.gyro_radps *= -1.0)];
    for axis in 0..3 {
        let sign = format!("gyro_{} has the wrong sign", name(axis));
        let inverted = move |rate: &mut Rate| rate.gyro_radps[axis] *= -1.0;
        hypotheses.push(Hypothesis::new("gyro", sign, inverted));
        let next = (axis + 1) % 3;
        let swap = format!("gyro_{} and gyro_{} are swapped", name(axis), name(next));
        let swapped = move |rate: &mut Rate| rate.gyro_radps.swap_rows(axis, next);
        hypotheses.push(Hypothesis::new("gyro", swap, swapped));
    }
    for axis in 0..2 {
        let sign = format!("accel_{} has the wrong sign", name(axis));
        let inverted = move |rate: &mut Rate| rate.accel_mps2[axis] *= -1.0;
        hypotheses.push(Hypothesis::new("accel", sign, inverted));
    }
    let swap = format!("accel_{} and accel_{} are swapped", name(0), name(1));
    let swapped = |rate: &mut Rate| rate.accel_mps2.swap_rows(0, 1);
    hypotheses.push(Hypothesis::new("accel", swap, swapped));
    let offset = rates.median.gyro_radps;
    if offset.norm() > MAX_OFFSET_RADPS {
        let cause = format!(
            "gyro offsets of {:.1} deg/s, beyond any class",
            offset.norm().to_degrees()
        );
        let less = move |rate: &mut Rate| rate.gyro_radps -= offset;
        hypotheses.push(Hypothesis::new("gyro", cause, less));
    }
    hypotheses.extend(gyro_units(rates).map(|(times, cause)| Hypothesis {
        fatal: true,
        ..Hypothesis::new("gyro", cause, move |rate| rate.gyro_radps /= times)
    }));
    hypotheses
}
