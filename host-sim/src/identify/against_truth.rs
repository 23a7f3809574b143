//! The solution against the log's reference motion: damped all along, and left free half way.

use ins_core::config::DampingConfig;
use ins_core::{Solution, Time};
use serde::Serialize;

use crate::identify::free_inertial::feed;
use crate::identify::held_ins::{HeldIns, LevelError};
use crate::identify::row::{self, Row};
use crate::log::Log;
use crate::sim::ideal::displaced;
use crate::statistics::rms;

/// Between two points of the curves, s.
const EVERY_S: f64 = 1.0;
/// A hole in the reference that nothing is interpolated over, s.
const HOLE_S: f64 = 2.0;

/// Errors of the solution, and of two INS that go on free from its middle, at a true height.
#[derive(Clone, Debug, PartialEq)]
pub struct AgainstTruth {
    /// From here on nothing damps the free ones.
    pub free_from: Time,
    pub damped: Vec<Point>,
    /// Free, less the errors of the sensors as known by then.
    pub free: Vec<Point>,
    /// Free, readings as logged.
    pub logged: Vec<Point>,
}

/// Horizontal error at a time.
pub type Point = (Time, LevelError);

/// Root mean squares over the second half of the solution, all over one span: a hole in the samples ends it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TruthErrors {
    pub damped: LevelError,
    /// Free, less the errors of the sensors as known when GNSS goes.
    pub free: LevelError,
    /// Free, readings as logged.
    pub as_logged: LevelError,
}

impl AgainstTruth {
    /// Root mean squares from where the free ones begin to where they end.
    pub fn errors(&self) -> TruthErrors {
        let until = self.free.last().map_or(self.free_from, |(time, _)| *time);
        let rms = |points: &[Point]| {
            let inside = |time: &Time| (self.free_from..=until).contains(time);
            let late = || points.iter().filter(|(time, _)| inside(time));
            LevelError {
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
            damped.push((solution.time, LevelError::of(solution, &truth)));
        }
    }
    let free = |history: &[Row]| {
        let mut ins = HeldIns::new(start);
        let mut errors = Vec::new();
        let mut height_m = start.position.height_m;
        // Where samples end or are missing, so do the errors.
        let _ = feed(log, start.time, history, |interval, time| {
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

/// The reference at a time, between rows that are no further apart than a hole.
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
