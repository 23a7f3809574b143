//! Positions against velocities: units, columns and signs of both.

use std::f64::consts::{FRAC_PI_2, PI};

use ins_core::GnssFix;
use nalgebra::{Matrix2, Vector2};

use super::Log;
use super::error::LogError;
use super::findings::Findings;
use super::typical::{likeliest, median, within};
use crate::statistics::Line;

/// Whether the way from position to position is the integral of velocity.
pub(super) fn check_paths(
    log: &Log,
    turning: Option<&Line>,
    findings: &mut Findings,
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
        return unequal_paths(ratio, within_radians(log), findings);
    }
    let apart = |turn: &Matrix2<f64>| {
        let degrees = |s: &Step| s.moved_m.angle(&(turn * s.integrated_m)).to_degrees();
        median(steps.iter().map(degrees))
    };
    // Courses agree to a few degrees where units and names are right.
    let as_is = apart(&Matrix2::identity());
    let guesses = guesses(turning).map(|(turn, cause)| (apart(&turn), cause));
    let [first, ..] = &guesses;
    let best = guesses.iter().fold(
        first,
        |best, guess| if guess.0 < best.0 { guess } else { best },
    );
    let defect = |cause: &str| {
        let expected = "velocity along the way from position to position";
        let found = format!("{as_is:.0} deg between them (median)");
        findings.gnss(expected, found, cause)
    };
    // A route along one diagonal hides swapped columns from its median, but not from a better one.
    if best.0 < 15.0 && as_is > 3.0 * best.0 + 10.0 {
        return Err(defect(best.1).in_column("lat_deg, lon_deg, ve, vn"));
    }
    if as_is > 30.0 {
        let cause = "velocity and position of different sources, clocks or axes";
        findings.warn(defect(cause).in_column("lat_deg, lon_deg, ve, vn"));
    }
    Ok(())
}

/// How velocities would have to be turned to go along the positions, and what that means. Gyros
/// tell a sign of velocity from one of positions: they turn as velocity does, or they do not.
fn guesses(turning: Option<&Line>) -> [(Matrix2<f64>, &'static str); 5] {
    let (west, south) = match turning.map(|fit| fit.slope > 0.0) {
        Some(true) => ("the sign of lon_deg is lost", "the sign of lat_deg is lost"),
        Some(false) => ("ve positive to the west", "vn positive to the south"),
        None => (
            "ve positive to the west, or the sign of lon_deg is lost",
            "vn positive to the south, or the sign of lat_deg is lost",
        ),
    };
    [
        (
            Matrix2::new(0.0, 1.0, 1.0, 0.0),
            "columns ve and vn swapped",
        ),
        (
            Matrix2::new(-1.0, 0.0, 0.0, -1.0),
            "velocity of the opposite sign",
        ),
        (Matrix2::new(-1.0, 0.0, 0.0, 1.0), west),
        (Matrix2::new(1.0, 0.0, 0.0, -1.0), south),
        (
            Matrix2::new(0.0, -1.0, -1.0, 0.0),
            "columns ve and vn swapped, with the opposite sign",
        ),
    ]
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
    findings: &mut Findings,
) -> Result<(), LogError> {
    let guesses = [
        (1.0 / 3.6, "km/h for m/s in ve and vn"),
        (0.5144, "knots for m/s in ve and vn"),
        (0.447, "miles per hour for m/s in ve and vn"),
        (0.3048, "ft/s for m/s in ve and vn"),
        (0.01, "cm/s for m/s in ve and vn"),
        (0.001, "mm/s for m/s in ve and vn"),
    ];
    let expected = "the way between positions to equal the integral of velocity";
    let found = format!("{ratio:.4} of it (median)");
    // Radians make the way east too long besides, by the cosine of the true latitude.
    let likely = if within_radians && (0.016..0.1).contains(&ratio) {
        Some("radians for degrees in lat_deg and lon_deg")
    } else {
        likeliest(guesses, ratio, 1.07)
    };
    let cause = likely.unwrap_or("another unit, or positions that do not follow the motion");
    let defect = findings.gnss(expected, found, cause);
    if likely.is_some() {
        return Err(defect.in_column("lat_deg, lon_deg, ve, vn"));
    }
    findings.warn(defect.in_column("lat_deg, lon_deg, ve, vn"));
    Ok(())
}
