//! Unit, signs and order of the sensors' channels against the motion that GNSS and the sensors
//! themselves show.

use nalgebra::{Matrix2, Vector2, Vector3};

use super::Log;
use super::clock::{Clocks, Shift};
use super::error::{Findings, LogError};
use super::meta::BodyAxes;
use super::rates::{Rate, Rates};
use super::typical::{Curve, SHORT_S, intervals, likeliest, turned, within};
use crate::statistics::Line;

/// Correlation from which on a sign is beyond doubt, with the least number of intervals.
const CLEAR: f64 = 0.6;
const INTERVALS: usize = 30;
const TURN_ALIKE: &str = "gyros that turn about the vertical as GNSS does";

// --- Turns about the vertical. ---

/// The rate about the vertical, over the turning of the GNSS course; none without turns.
pub(super) fn turning(log: &Log, rates: &Rates) -> Option<Line> {
    let legs = legs(log);
    let turning = legs.iter().filter(|leg| rate_radps(leg).abs() > 0.05);
    // Ten seconds of turning, or the fit is chance.
    if turning.count() < 10 {
        return None;
    }
    fit(&legs, &rates.vertical_angles())
}

/// What the fit says of unit and sign of the gyros.
pub(super) fn check_turns(
    fit: Option<&Line>,
    together: bool,
    duration_s: f64,
    rates: &Rates,
    findings: &mut Findings,
) -> Result<(), LogError> {
    // Below 0.8 the track does not follow the nose well enough to judge a scale.
    if let Some(fit) = fit.filter(|fit| fit.correlation.abs() >= 0.8) {
        return check_scale(fit, rates, findings);
    }
    check_range(rates, findings)?;
    match fit {
        // Half of the turns in common is no chance.
        Some(fit) if !together && fit.correlation.abs() < 0.5 => warn_of_strangers(fit, findings),
        // A shorter one may be a single turn.
        None if duration_s > SHORT_S => check_offset(rates, findings),
        _ => {}
    }
    Ok(())
}

fn check_range(rates: &Rates, findings: &Findings) -> Result<(), LogError> {
    // Half of the time faster than two turns in three seconds: no vehicle navigates so.
    let typical = rates.typical.gyro_norm_radps;
    if typical < 4.0 {
        return Ok(());
    }
    let found = format!("a median rate of {typical:.1} rad/s");
    let cause = "degrees for radians: multiply by 0.0174533; or else deg/h, mdeg/s, or rates for \
                 increments";
    Err(findings.imu("gyro", "angular rates in rad/s", found, cause))
}

fn check_offset(rates: &Rates, findings: &mut Findings) {
    let mean = rates.typical.mean_gyro_radps;
    // 6 deg/s, ten times the bias of a consumer gyro.
    if mean.norm() > 0.1 {
        let expected = "a mean angular rate near zero while GNSS sees no turn";
        let found = format!("{:.3} rad/s", mean.norm());
        let cause = "degrees for radians, or a gyro bias beyond any grade";
        findings.warn(findings.imu("gyro", expected, found, cause));
    }
}

fn warn_of_strangers(fit: &Line, findings: &mut Findings) {
    let found = format!("a correlation of {:.2} between the two", fit.correlation);
    let cause = "files of different drives, clocks that differ, or a vehicle whose nose does not \
                 follow its track (multirotor, boat)";
    findings.warn(findings.gnss("", TURN_ALIKE, found, cause));
}

fn check_scale(fit: &Line, rates: &Rates, findings: &mut Findings) -> Result<(), LogError> {
    let found = format!(
        "{:.4} times the turn rate of the GNSS track (correlation {:.2})",
        fit.slope, fit.correlation
    );
    let defect = |cause: &str| findings.imu("gyro", TURN_ALIKE, found.clone(), cause);
    if fit.slope < 0.0 {
        return Err(defect(
            "gyro_z of the wrong sign, or gyros and accelerometers of opposite sign or other axes: the \
             vertical is taken from the accelerometers, so check the sign of both against body_axes",
        ));
    }
    match likeliest(gyro_units(rates), fit.slope, 1.3) {
        Some(cause) => Err(defect(&cause)),
        None if within(fit.slope, 1.0, 1.5) => Ok(()),
        None => {
            let cause = "another unit, or a track that does not follow the nose";
            findings.warn(defect(cause));
            Ok(())
        }
    }
}

/// What gyros are mistaken for, and how many times too much they say then.
fn gyro_units(rates: &Rates) -> impl Iterator<Item = (f64, String)> {
    let interval = rates.typical.interval_s;
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

/// Velocity at the ends of a short interval, s and m/s.
type Leg = [(f64, Vector2<f64>); 2];

/// Short intervals in motion.
fn legs(log: &Log) -> Vec<Leg> {
    let origin = log.start();
    let moving = log.gnss.iter().filter_map(|fix| {
        let velocity = fix.velocity_en_mps.filter(|v| v.norm() > 2.0)?;
        Some((fix.time.seconds_since(origin), velocity))
    });
    intervals(moving)
}

/// Turn rate of the track, counter-clockwise.
fn rate_radps([from, to]: &Leg) -> f64 {
    turned(from.1, to.1) / (to.0 - from.0)
}

/// Least squares of the gyro's mean rates over the track's.
fn fit(legs: &[Leg], angles: &Curve) -> Option<Line> {
    let pairs: Vec<(f64, f64)> = legs
        .iter()
        .filter_map(|leg @ [from, to]| {
            let turned = angles.change(from.0, to.0)?;
            Some((rate_radps(leg), turned / (to.0 - from.0)))
        })
        .collect();
    let line = Line::through(&pairs);
    (pairs.len() >= 10 && line.correlation.is_finite()).then_some(line)
}

// --- Level accelerations, and gravity that turns in the body. ---

/// Warns where accelerometers show the motion in other axes than they are said to have.
pub(super) fn check_axes(
    log: &Log,
    turning: Option<&Line>,
    rates: &Rates,
    findings: &mut Findings,
) {
    // Under a canopy or a cable the nose does not turn with the track, and a swing is felt as its opposite.
    let follows = turning.is_none_or(|fit| fit.correlation > 0.5);
    if let Some(correlation) = along_the_track(log, rates).filter(|_| follows) {
        check_level_axes(log, &correlation, findings);
    }
    check_turning_gravity(log, rates, findings);
}

/// Accelerations right and forward: felt, and seen by GNSS.
type Pair = (Vector2<f64>, Vector2<f64>);

/// Correlations of the accelerations right and forward by the sensors (rows) with those by GNSS
/// (columns), for a vehicle that follows its nose; none without manoeuvres.
fn along_the_track(log: &Log, rates: &Rates) -> Option<Matrix2<f64>> {
    let mut curves: [Curve; 2] = Default::default();
    let mut sum = Vector3::zeros();
    for rate in rates.iter() {
        sum += rate.accel_mps2 * rate.interval_s;
        for (axis, curve) in curves.iter_mut().enumerate() {
            curve.push(rate.time_s, sum[axis]);
        }
    }
    let mut pairs: Vec<Pair> = Vec::new();
    for [(from_s, before), (to_s, after)] in legs(log) {
        let felt = [0, 1].map(|axis: usize| curves[axis].change(from_s, to_s));
        if let [Some(felt_right), Some(felt_ahead)] = felt {
            let speed = 0.5 * (before.norm() + after.norm());
            let right = -speed * turned(before, after);
            let ahead = after.norm() - before.norm();
            let felt = Vector2::new(felt_right, felt_ahead);
            let seconds = to_s - from_s;
            pairs.push((felt / seconds, Vector2::new(right, ahead) / seconds));
        }
    }
    // Half a minute of accelerations above those that a slope of the road feigns.
    let strong = |axis: usize| pairs.iter().filter(|p| p.1[axis].abs() > 0.5).count();
    if strong(0) < INTERVALS || strong(1) < INTERVALS {
        return None;
    }
    // Turns that go with brakings tell nothing of which is which.
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

fn check_level_axes(log: &Log, correlation: &Matrix2<f64>, findings: &mut Findings) {
    let c = correlation;
    let expected = "accelerometers that feel brakings forward and turns to the right";
    let mut warn = |found: String, cause: String| {
        findings.warn(findings.imu("accel", expected, found, cause));
    };
    let axes = log.meta.body_axes;
    let (a, b) = (c[(0, 1)], c[(1, 0)]);
    if a.abs() > CLEAR && b.abs() > CLEAR {
        let [right, forward] = [a, b].map(|value| if value < 0.0 { "-" } else { "" });
        let found = format!(
            "{right}right where forward is, {forward}forward where right is (correlations \
             {a:.2}, {b:.2})"
        );
        let mut all = BodyAxes::ALL.into_iter();
        let cause = match all.find(|other| turned_by(axes, *other, c)) {
            Some(other) => format!(
                "body_axes = \"{other}\" would fit; as it is heading and the names of the axes \
                 are a quarter turn off"
            ),
            None if a * b > 0.0 => {
                "accel_x and accel_y are swapped, and gyro_x and gyro_y may be".to_owned()
            }
            None => "columns of another order, or a unit mounted across".to_owned(),
        };
        warn(found, cause);
        return;
    }
    for (axis, name) in [(0, "right"), (1, "forward")] {
        if c[(axis, axis)] < -CLEAR {
            let other = c[(1 - axis, 1 - axis)];
            let cause = if other < -CLEAR {
                "mounted backwards, or both level accelerometers of the wrong sign: heading is \
                 half a turn off"
                    .to_owned()
            } else {
                format!("accel_{} has the wrong sign", axes.letter(axis))
            };
            let found = format!("the opposite {name} (correlation {:.2})", c[(axis, axis)]);
            warn(found, cause);
            if other < -CLEAR {
                return;
            }
        }
    }
}

/// Whether columns in `other` axes that are read as `axes` would correlate with the signs of `c`.
fn turned_by(axes: BodyAxes, other: BodyAxes, c: &Matrix2<f64>) -> bool {
    let true_rfu = |read| other.to_rfu(axes.from_rfu(Vector3::ith(read, 1.0)));
    let seen = |felt: usize| true_rfu(felt)[1 - felt] * c[(felt, 1 - felt)] > 0.5;
    // Gravity is where it should be.
    true_rfu(2).z > 0.0 && seen(0) && seen(1)
}

/// Gravity turns in the body as the gyros say: where they show plainly the opposite, one of the
/// two has a sign that it should not have.
fn check_turning_gravity(log: &Log, rates: &Rates, findings: &mut Findings) {
    let blocks: Vec<Block> = blocks(rates).collect();
    let names = [("right", "forward"), ("forward", "right")];
    for (axis, (name, about)) in names.into_iter().enumerate() {
        let changes = || blocks.windows(2).map(|pair| gravity_change(pair, axis));
        // A degree and a half in a block: far above a road's unevenness.
        let clear = changes().filter(|(turned, _)| turned.abs() > 0.25).count();
        let correlation = Line::from_origin(changes()).correlation;
        if clear < INTERVALS || correlation > -CLEAR {
            continue;
        }
        let found = format!("the opposite {name} (correlation {correlation:.2})");
        let cause = format!(
            "the accelerometer {name} or the gyro {about} has the wrong sign against body_axes = \"{}\"",
            log.meta.body_axes
        );
        let expected = "gravity that turns in the body as the gyros say";
        findings.warn(findings.imu("gyro, accel", expected, found, cause));
    }
}

/// Shorter than an attitude changes, longer than vibration.
const BLOCK_S: f64 = 0.2;

/// Mean rate and specific force.
type Block = (Vector3<f64>, Vector3<f64>);

/// Change of gravity on an axis from block to block: by the gyros, and as felt.
fn gravity_change(pair: &[Block], axis: usize) -> (f64, f64) {
    let (last, block) = (&pair[0], &pair[1]);
    let turned = -0.5 * (last.0 + block.0) * BLOCK_S;
    let force = 0.5 * (last.1 + block.1);
    (turned.cross(&force)[axis], (block.1 - last.1)[axis])
}

fn blocks(rates: &Rates) -> impl Iterator<Item = Block> {
    #[allow(clippy::cast_possible_truncation)] // Seconds of a log.
    let number = |rate: &Rate| (rate.time_s / BLOCK_S) as i64;
    let mut rates = rates.iter().peekable();
    std::iter::from_fn(move || {
        let first = rates.next()?;
        let (mut gyro, mut accel, mut n) = (first.gyro_radps, first.accel_mps2, 1.0);
        while let Some(rate) = rates.next_if(|rate| number(rate) == number(&first)) {
            gyro += rate.gyro_radps;
            accel += rate.accel_mps2;
            n += 1.0;
        }
        Some((gyro / n, accel / n))
    })
}

// --- All that GNSS shows, however the unit is mounted and whatever moves it: a wrong sign makes of the
// sensors' axes a left-handed frame, in which no mount explains what was seen. ---

/// Evidence that readings are others than they are said to be: so much more of it, in all, and
/// beyond what chance adds to a motion of a minute.
const TIMES: f64 = 1.05;
const MORE: f64 = 20.0;
/// Ten times the offset of a consumer gyro, rad/s.
const NO_OFFSET_RADPS: f64 = 0.1;
/// As much of a log as tells, s.
const TRIED_S: f64 = 1800.0;

/// Readings as they might be meant.
struct Guess {
    cause: String,
    column: &'static str,
    /// Whether they cannot be used as they are.
    refused: bool,
    read: Box<dyn Fn(&mut Rate)>,
}

impl Guess {
    fn new(column: &'static str, cause: String, read: impl Fn(&mut Rate) + 'static) -> Self {
        Self {
            cause,
            column,
            refused: false,
            read: Box::new(read),
        }
    }
}

/// Says so where other readings of the channels would explain the motion far better.
pub(super) fn check_readings(
    log: &Log,
    rates: &Rates,
    findings: &mut Findings,
) -> Result<(), LogError> {
    let tried = rates.until(TRIED_S);
    let mut clocks = Clocks::new(log, &tried);
    let as_it_is = clocks.finer(clocks.at(0.0));
    let mut best: Option<(Shift, Guess)> = None;
    for guess in guesses(log, rates) {
        clocks.read_anew(&tried.read_as(&guess.read));
        let rough = clocks.at(as_it_is.s);
        if rough.evidence < as_it_is.evidence {
            continue;
        }
        let shift = clocks.finer(rough);
        if guess.refused && !(shift.decides_over(&as_it_is) && clocks.explained_by(&shift)) {
            continue;
        }
        let better = |(best, _): &(Shift, Guess)| shift.evidence > best.evidence;
        if best.as_ref().is_none_or(better) {
            best = Some((shift, guess));
        }
    }
    let least = TIMES * as_it_is.evidence.max(0.0) + MORE;
    let Some((shift, guess)) = best.filter(|(shift, _)| shift.evidence > least) else {
        return Ok(());
    };
    let expected = "sensors that feel the motion that GNSS shows";
    let found = format!(
        "other readings that explain it far better (evidence {:.0} against {:.0})",
        shift.evidence, as_it_is.evidence
    );
    let defect = findings.imu(guess.column, expected, found, guess.cause);
    if guess.refused {
        return Err(defect);
    }
    findings.warn(LogError {
        doubt: true,
        ..defect
    });
    Ok(())
}

fn guesses(log: &Log, rates: &Rates) -> Vec<Guess> {
    let name = |component: usize| log.meta.body_axes.letter(component);
    let all = "all gyros have the wrong sign".to_owned();
    let mut guesses = vec![Guess::new("gyro", all, |rate| rate.gyro_radps *= -1.0)];
    for axis in 0..3 {
        let sign = format!("gyro_{} has the wrong sign", name(axis));
        let turned = move |rate: &mut Rate| rate.gyro_radps[axis] *= -1.0;
        guesses.push(Guess::new("gyro", sign, turned));
        let next = (axis + 1) % 3;
        let swap = format!("gyro_{} and gyro_{} are swapped", name(axis), name(next));
        let swapped = move |rate: &mut Rate| rate.gyro_radps.swap_rows(axis, next);
        guesses.push(Guess::new("gyro", swap, swapped));
    }
    for axis in 0..2 {
        let sign = format!("accel_{} has the wrong sign", name(axis));
        let turned = move |rate: &mut Rate| rate.accel_mps2[axis] *= -1.0;
        guesses.push(Guess::new("accel", sign, turned));
    }
    let swap = format!("accel_{} and accel_{} are swapped", name(0), name(1));
    let swapped = |rate: &mut Rate| rate.accel_mps2.swap_rows(0, 1);
    guesses.push(Guess::new("accel", swap, swapped));
    let offset = rates.typical.gyro_radps;
    if offset.norm() > NO_OFFSET_RADPS {
        let cause = format!(
            "gyro offsets of {:.1} deg/s, beyond any class",
            offset.norm().to_degrees()
        );
        let less = move |rate: &mut Rate| rate.gyro_radps -= offset;
        guesses.push(Guess::new("gyro", cause, less));
    }
    guesses.extend(gyro_units(rates).map(|(times, cause)| Guess {
        refused: true,
        ..Guess::new("gyro", cause, move |rate| rate.gyro_radps /= times)
    }));
    guesses
}
