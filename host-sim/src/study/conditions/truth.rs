//! What an estimator should find, where several errors are one number.
//!
//! A vehicle that stays about level shows of accelerometers only what they read there. With the
//! matrix `A` of their scale errors and misalignments, `u` the up direction in the axes of the
//! unit and `g` gravity, a bias `b` is felt as `b + g A u`.
//!
//! Gyros with such a matrix `G`, turning at a rate `w` about `u`, read `w G u` too much. Let `p` be
//! the part of `G u` across `u`, and `C' = C (I + [e x])` the attitude that they carry on, `C` the
//! true one: `e' = w p - w u x e` stands still at `e = -u x p`, for `u x (-u x p) = p`. Whatever
//! turns there are about the vertical, an INS that starts at this tilt `e` keeps it: gyros cannot
//! be told from ones without error in axes that are turned by `e`. In these axes the true specific
//! force is `f - e x f`, so accelerometers that read `f` read `e x f` too much, which is
//! `-(u x p) x g u = g u x (u x p) = -g p`. The bias felt in all is `b + g A u - g p`, and the
//! attitude that belongs to it is `C (I + [e x])`.

use ins_core::earth::LocalEarth;
use nalgebra::{UnitQuaternion, Vector3};

use super::World;
use crate::sim::SensorErrors;

/// The truth of one run, body axes of the unit, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// As felt by the level vehicle.
    pub accel_bias_mps2: Vector3<f64>,
    /// At the end.
    pub gyro_bias_radps: Vector3<f64>,
    /// At the end.
    pub latency_s: f64,
    /// Antenna from the unit.
    pub lever_arm_m: Vector3<f64>,
    /// From the axes that gyros and accelerometers agree on to those of the unit.
    pub axes: UnitQuaternion<f64>,
}

impl Truth {
    /// Of a world whose sensors had these errors.
    pub fn new(world: &World, errors: &SensorErrors) -> Self {
        let at = &world.origin;
        let gravity = LocalEarth::at(at.latitude_rad, at.height_m).gravity_mps2;
        let up = world.mount.inverse() * Vector3::z();
        let turn = errors.gyro_matrix * up;
        let across = turn - up * up.dot(&turn);
        let proportional = gravity * (errors.accel_matrix * up - across);
        Self {
            accel_bias_mps2: Vector3::from(errors.accel_bias_mps2) + proportional,
            gyro_bias_radps: errors.gyro_bias_radps.into(),
            latency_s: errors.gnss_latency_end_s,
            lever_arm_m: world.lever_arm_m(),
            axes: UnitQuaternion::from_scaled_axis(-up.cross(&across)),
        }
    }
}
