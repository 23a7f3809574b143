//! True values of the estimates, where several errors are observable only as their sum.
//!
//! In a vehicle that stays about level, only the apparent bias of the accelerometers is observable: with the
//! matrix `A` of their scale errors and misalignments, the mean up direction `u` in the axes of the unit and
//! gravity `g`, a bias `b` appears as `b + g A u`. An estimate states its `u`: an aircraft that circles to the
//! left for ten minutes and then to the right has two.
//!
//! Gyros with such a matrix `G`, turning about `u`, keep the platform tilted by the part of `G u` normal to
//! `u`, and the apparent bias includes the gravity component of that tilt. It is unobservable, and the stated
//! sigma must include it.

use ins_core::Solution;
use ins_core::earth::Geodetic;
use nalgebra::Vector3;

use super::Scenario;
use crate::sim::{SensorErrors, SimulatedDrive, mean_up};

/// The truth of one run, body axes of the unit, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Of gyros and accelerometers at the end.
    pub sensors: SensorErrors,
    /// Place of the run, for its gravity.
    pub origin: Geodetic,
    /// Bounds at the end. The lag of a receiver that smooths depends on the motion, and fixes that are
    /// logged several times have several latencies: any value between is correct.
    pub latency_s: [f64; 2],
    /// Antenna from the unit.
    pub lever_arm_m: Vector3<f64>,
    /// Mean up direction, in the final mount.
    pub up: Vector3<f64>,
}

impl Truth {
    pub fn new(scenario: &Scenario, drive: &SimulatedDrive) -> Self {
        let errors = &drive.errors;
        let final_mount_s = scenario.slip.map_or(0.0, |s| s.start_s + s.duration_s);
        let in_final_mount = |s: &&Solution| s.time.as_seconds() >= final_mount_s;
        // The mean includes the pitch of an aircraft and the grades of a road.
        let up = mean_up(drive.truth.iter().filter(in_final_mount));
        let latency_s = errors.gnss_latency_end_s;
        Self {
            sensors: *errors,
            origin: scenario.origin,
            latency_s: [latency_s, latency_s + errors.gnss_lag_s],
            lever_arm_m: scenario.lever_arm_m(),
            up,
        }
    }

    /// Apparent biases of the gyros with this up direction.
    pub fn gyro_bias_radps(&self, up: &Vector3<f64>) -> Vector3<f64> {
        self.sensors.effective_gyro_bias_radps(&self.origin, up)
    }

    /// Apparent biases of the accelerometers with this up direction.
    pub fn accel_bias_mps2(&self, up: &Vector3<f64>) -> Vector3<f64> {
        self.sensors.effective_accel_bias_mps2(&self.origin, up)
    }
}
