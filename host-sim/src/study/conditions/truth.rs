//! What an estimator should find, where several errors are one number.
//!
//! A vehicle that stays about level shows of accelerometers only what they read there. With the
//! matrix `A` of their scale errors and misalignments, `u` the mean up direction in the axes of the
//! unit and `g` gravity, a bias `b` is felt as `b + g A u`. Who states a bias says of which `u`: one
//! that circles to the left for ten minutes and then to the right has two.
//!
//! Gyros with such a matrix `G`, turning about `u`, keep a platform tilted by what of `G u` is across
//! `u`, and the accelerometers seem biased by as much of `g`: nobody sees it, and who states a
//! sigma has it in there.

use ins_core::Solution;
use ins_core::earth::Geodetic;
use nalgebra::Vector3;

use super::World;
use crate::sim::{SensorErrors, SimulatedDrive, mean_up};

/// The truth of one run, body axes of the unit, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Of gyros and accelerometers, at the end.
    pub sensors: SensorErrors,
    /// Where gravity is that of the run.
    pub origin: Geodetic,
    /// At the end. A receiver that smooths lags by what depends on the motion, and one whose fixes
    /// are logged several times shows several: anything between is right.
    pub latency_s: [f64; 2],
    /// Antenna from the unit.
    pub lever_arm_m: Vector3<f64>,
    /// Up on the whole, and as it is at the end.
    pub up: Vector3<f64>,
}

impl Truth {
    pub fn new(world: &World, drive: &SimulatedDrive) -> Self {
        let errors = &drive.errors;
        let holds_s = world.slip.map_or(0.0, |s| s.start_s + s.duration_s);
        let as_at_end = |s: &&Solution| s.time.as_seconds() >= holds_s;
        // An aircraft flies nose up, a road rises and falls.
        let up = mean_up(drive.truth.iter().filter(as_at_end));
        let latency_s = errors.gnss_latency_end_s;
        Self {
            sensors: *errors,
            origin: world.origin,
            latency_s: [latency_s, latency_s + errors.gnss_lag_s],
            lever_arm_m: world.lever_arm_m(),
            up,
        }
    }

    /// What the accelerometers are felt to be biased by where this is up.
    pub fn accel_bias_mps2(&self, up: &Vector3<f64>) -> Vector3<f64> {
        self.sensors.effective_accel_bias_mps2(&self.origin, up)
    }
}
