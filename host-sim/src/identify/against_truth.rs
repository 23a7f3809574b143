//! The solution against the log's reference motion: damped throughout, and free from half way on.

use ins_core::config::DampingConfig;
use ins_core::{Solution, Time};
use serde::Serialize;

use crate::identify::baro_aided_ins::{BaroAidedIns, HorizontalError};
use crate::identify::free_inertial::feed_intervals;
use crate::identify::row::{self, Row};
use crate::log::Log;
use crate::sim::ideal::displaced;
use crate::statistics::rms;

/// Interval between points of the curves, s.
const EVERY_S: f64 = 1.0;
/// Longest gap in the reference that is interpolated, s.
const HOLE_S: f64 = 2.0;

/// Errors of the solution, and of two free INS that start from its middle, at a true height.
#[derive(Clone, Debug, PartialEq)]
pub struct AgainstTruth {
    /// Start of the free ones.
    pub free_from: Time,
    pub damped: Vec<Point>,
    /// Free, readings compensated by the estimates of that time.
    pub free: Vec<Point>,
    /// Free, readings as logged.
    pub logged: Vec<Point>,
}

/// Horizontal error at a time.
pub type Point = (Time, HorizontalError);

/// Root mean squares over the second half of the solution, all over one span: a gap in the samples ends it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TruthErrors {
    pub damped: HorizontalError,
    /// Free, readings compensated by the estimates at the end of GNSS.
    pub free: HorizontalError,
    /// Free, readings as logged.
    pub as_logged: HorizontalError,
}

impl AgainstTruth {
    /// Root mean squares from where the free ones begin to where they end.
    pub fn errors(&self) -> TruthErrors {
        let until = self.free.last().map_or(self.free_from, |(time, _)| *time);
        let rms = |points: &[Point]| {
            let inside = |time: &Time| (self.free_from..=until).contains(time);
            let late = || points.iter().filter(|(time, _)| inside(time));
            HorizontalError {
                position_m: rms(late().map(|(_, error)| error.position_m)),
                velocity_mps: rms(late().map(|(_, error)| error.velocity_mps)),
            }
        };
        TruthErrors {
            damped: rms(&self.damped),
            free: rms(&self.free),
            as_logged: rms(&self.logged),
        }
    }
}

/// Compares; `None` without a reference, or where it does not cover the second half.
pub fn check(
    log: &Log,
    solutions: &[Solution],
    history: &[Row],
    config: &DampingConfig,
) -> Option<AgainstTruth> {
    let start = solutions.get(solutions.len() / 2)?;
    let known = history.partition_point(|row| row.time <= start.time);
    let mut damped = Vec::new();
    for solution in solutions {
        if let Some(truth) =
            truth_at(&log.truth, solution.time).filter(|_| due(&damped, solution.time))
        {
            damped.push((solution.time, HorizontalError::of(solution, &truth)));
        }
    }
    let free = |history: &[Row]| {
        let mut ins = BaroAidedIns::new(start);
        let mut errors = Vec::new();
        let mut height_m = start.position.height_m;
        // The errors end where samples end or are missing.
        let _ = feed_intervals(log, start.time, history, |interval, time| {
            ins.step(interval, height_m, config);
            if let Some(truth) = truth_at(&log.truth, time) {
                height_m = truth.position.height_m;
                if due(&errors, time) {
                    errors.push((time, ins.error(&truth)));
                }
            }
            true
        });
        errors
    };
    let (free, logged) = (free(&history[..known]), free(&[]));
    let free_from = start.time;
    (!free.is_empty()).then_some(AgainstTruth {
        free_from,
        damped,
        free,
        logged,
    })
}

fn due(points: &[Point], now: Time) -> bool {
    row::due(points.last().map(|(last, _)| *last), now, EVERY_S)
}

/// The reference interpolated at a time; `None` in a gap longer than `HOLE_S`.
pub(crate) fn truth_at(truth: &[Solution], time: Time) -> Option<Solution> {
    let after = truth.partition_point(|row| row.time <= time);
    let before = truth.get(after.checked_sub(1)?)?;
    let since_s = time.seconds_since(before.time);
    if since_s == 0.0 {
        return Some(*before);
    }
    let next = truth.get(after)?;
    let span_s = next.time.seconds_since(before.time);
    if span_s > HOLE_S {
        return None;
    }
    let part = since_s / span_s;
    let way = part * next.position.enu_from(&before.position);
    Some(Solution {
        time,
        position: displaced(&before.position, &way),
        velocity_enu_mps: before.velocity_enu_mps.lerp(&next.velocity_enu_mps, part),
        attitude: before.attitude.nlerp(&next.attitude, part),
    })
}
