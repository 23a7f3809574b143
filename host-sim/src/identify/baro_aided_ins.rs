//! A free INS with its vertical channel damped by a barometer: alone it is unstable.

use ins_core::Solution;
use ins_core::config::DampingConfig;
use ins_core::damping::{self, Differences};
use ins_core::increments::Interval;
use ins_core::mechanization::Mechanization;
use nalgebra::Vector2;
use serde::Serialize;

/// Horizontal error of an INS.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct HorizontalError {
    pub position_m: f64,
    pub velocity_mps: f64,
}

impl HorizontalError {
    pub fn of(solution: &Solution, truth: &Solution) -> Self {
        let velocity = solution.velocity_enu_mps - truth.velocity_enu_mps;
        Self {
            position_m: solution.position.enu_from(&truth.position).xy().norm(),
            velocity_mps: velocity.xy().norm(),
        }
    }
}

/// The INS; its barometer has no errors.
#[derive(Clone, Copy, Debug)]
pub struct BaroAidedIns(Mechanization);

impl BaroAidedIns {
    pub fn new(start: &Solution) -> Self {
        Self(Mechanization::new(
            start.position,
            start.velocity_enu_mps,
            start.attitude,
        ))
    }

    /// Advances over an interval that begins at the true height `height_m`.
    pub fn step(&mut self, interval: &Interval, height_m: f64, config: &DampingConfig) {
        let above_m = self.0.position.height_m - height_m;
        let barometer = Differences {
            height_m: Some(above_m),
            ..Differences::default()
        };
        let controls = damping::controls(&barometer, interval.seconds, config);
        self.0.step(interval, &controls);
    }

    pub fn velocity_error_mps(&self, truth: &Solution) -> Vector2<f64> {
        (self.0.velocity_enu_mps - truth.velocity_enu_mps).xy()
    }

    pub fn error(&self, truth: &Solution) -> HorizontalError {
        HorizontalError {
            position_m: self.0.position.enu_from(&truth.position).xy().norm(),
            velocity_mps: self.velocity_error_mps(truth).norm(),
        }
    }
}
