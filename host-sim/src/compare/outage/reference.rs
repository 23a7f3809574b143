//! Where the vehicle really was.

use ins_core::earth::Geodetic;
use ins_core::{Solution, Time};
use nalgebra::Vector2;

use super::drift::{Drift, OUTAGE_S};
use crate::log::Log;

/// Age at which a point no longer stands for the end of an outage, s.
const LATE_S: f64 = 1.5;

/// The motion at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    time: Time,
    position: Geodetic,
    velocity_en_mps: Vector2<f64>,
}

/// The motion, point by point in order of time.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    points: Vec<Point>,
}

impl Reference {
    pub fn of_truth(log: &Log) -> Self {
        let point = |truth: &Solution| Point {
            time: truth.time,
            position: truth.position,
            velocity_en_mps: truth.velocity_enu_mps.xy(),
        };
        Self {
            points: log.truth.iter().map(point).collect(),
        }
    }

    /// Fixes that are whole, each at its own moment.
    pub fn of_fixes(log: &Log, latency_s: f64) -> Self {
        let points = log.gnss.iter().filter_map(|fix| {
            Some(Point {
                time: fix.time.plus_seconds(-latency_s),
                position: fix.geodetic_or(0.0)?,
                velocity_en_mps: fix.velocity_en_mps?,
            })
        });
        Self {
            points: points.collect(),
        }
    }

    /// Whether a point stands for a time.
    pub fn reaches(&self, time: Time) -> bool {
        let next = self.points.partition_point(|point| point.time <= time);
        let last = self.points[..next].last();
        last.is_some_and(|point| time.seconds_since(point.time) < LATE_S)
    }

    /// Compares an outage that begins at `start`.
    pub fn meter(&self, start: Time, log_start: Time) -> Meter<'_> {
        let end = start.plus_seconds(OUTAGE_S);
        let from = self.points.partition_point(|point| point.time <= start);
        let to = self.points.partition_point(|point| point.time <= end);
        Meter {
            points: &self.points[from..to],
            drift: Drift {
                start_s: start.seconds_since(log_start),
                ..Drift::default()
            },
        }
    }
}

/// Compares solutions with the reference as they come.
#[derive(Debug)]
pub struct Meter<'a> {
    points: &'a [Point],
    drift: Drift,
}

impl Meter<'_> {
    /// Takes the next solution; false once there is nothing more to compare.
    pub fn take(&mut self, solution: &Solution) -> bool {
        while let Some((point, rest)) = self.points.split_first() {
            if solution.time < point.time {
                return true;
            }
            // At most a sample late.
            let since_s = solution.time.seconds_since(point.time);
            let velocity = solution.velocity_enu_mps.xy();
            let position = solution.position.enu_from(&point.position).xy() - since_s * velocity;
            let drift = &mut self.drift;
            drift.position_end_m = position.norm();
            drift.velocity_end_mps = (velocity - point.velocity_en_mps).norm();
            drift.position_max_m = drift.position_max_m.max(drift.position_end_m);
            drift.velocity_max_mps = drift.velocity_max_mps.max(drift.velocity_end_mps);
            self.points = rest;
        }
        false
    }

    pub fn drift(self) -> Drift {
        self.drift
    }
}
