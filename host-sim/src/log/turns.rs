//! Turns seen by the gyros against turns seen by GNSS: unit and sign of the gyros.

use nalgebra::Vector2;

use super::Log;
use super::curve::{Curve, intervals, turned};
use super::error::LogError;
use super::findings::Findings;
use super::rates::Rates;
use super::typical::{SHORT_S, likeliest, within};
use crate::statistics::Line;

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
    match fit {
        // Below 0.8 the track does not follow the nose well enough to judge a scale.
        Some(fit) if fit.correlation.abs() >= 0.8 => check_scale(fit, rates, findings),
        Some(fit) => {
            check_range(rates, findings)?;
            // Half of the turns in common is no chance.
            if !together && fit.correlation.abs() < 0.5 {
                warn_of_strangers(fit, findings);
            }
            Ok(())
        }
        None => {
            check_range(rates, findings)?;
            // A shorter one may be a single turn.
            if duration_s > SHORT_S {
                check_offset(rates, findings);
            }
            Ok(())
        }
    }
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
    Err(findings
        .imu("angular rates in rad/s", found, cause)
        .in_column("gyro"))
}

fn check_offset(rates: &Rates, findings: &mut Findings) {
    let mean = rates.typical.mean_gyro_radps;
    // 6 deg/s, ten times the bias of a consumer gyro.
    if mean.norm() > 0.1 {
        let expected = "a mean angular rate near zero while GNSS sees no turn";
        let found = format!("{:.3} rad/s", mean.norm());
        let cause = "degrees for radians, or a gyro bias beyond any grade";
        findings.warn(findings.imu(expected, found, cause).in_column("gyro"));
    }
}

fn warn_of_strangers(fit: &Line, findings: &mut Findings) {
    let found = format!("a correlation of {:.2} between the two", fit.correlation);
    let cause = "files of different drives, clocks that differ, or a vehicle whose nose does not \
                 follow its track (multirotor, boat)";
    let expected = "gyros that turn about the vertical as GNSS does";
    findings.warn(findings.gnss(expected, found, cause));
}

fn check_scale(fit: &Line, rates: &Rates, findings: &mut Findings) -> Result<(), LogError> {
    let found = format!(
        "{:.4} times the turn rate of the GNSS track (correlation {:.2})",
        fit.slope, fit.correlation
    );
    let defect = |cause: &str| {
        let expected = "gyros that turn about the vertical as GNSS does";
        findings
            .imu(expected, found.clone(), cause)
            .in_column("gyro")
    };
    if fit.slope < 0.0 {
        return Err(defect(
            "gyros and accelerometers of opposite sign or other axes: the vertical is taken from \
             the accelerometers, so check the sign of both against body_axes",
        ));
    }
    match likeliest(gyro_units(rates), fit.slope, 1.3) {
        Some(cause) => Err(defect(&cause)),
        None if within(fit.slope, 1.0, 1.5) => Ok(()),
        None => {
            findings.warn(defect(
                "another unit, or a track that does not follow the nose",
            ));
            Ok(())
        }
    }
}

/// What gyros are mistaken for, and how many times too much they say then.
pub(super) fn gyro_units(rates: &Rates) -> impl Iterator<Item = (f64, String)> {
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
pub(super) type Leg = [(f64, Vector2<f64>); 2];

/// Short intervals in motion.
pub(super) fn legs(log: &Log) -> Vec<Leg> {
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
        .filter(|[from, to]| angles.reaches(from.0) && angles.reaches(to.0))
        .map(|leg @ [from, to]| {
            let turned = angles.at(to.0) - angles.at(from.0);
            (rate_radps(leg), turned / (to.0 - from.0))
        })
        .collect();
    let line = Line::through(&pairs);
    (pairs.len() >= 10 && line.correlation.is_finite()).then_some(line)
}
