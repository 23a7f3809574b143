//! The navigation solution.

use nalgebra::{UnitQuaternion, Vector3};

use crate::attitude;
use crate::earth::Geodetic;
use crate::time::Time;

/// Progress of the navigator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Phase {
    /// Finding roll and pitch (and, at rest, gyro biases); no solution yet, or after divergence the last
    /// one known, propagated.
    #[default]
    Levelling,
    /// Roll and pitch known, heading still to be found from motion; the same of the solution.
    FindingHeading,
    /// Navigating, damped by GNSS.
    Navigating,
}

/// Position, velocity and attitude.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Solution {
    /// Its time: the stamp of the last inertial sample, with increments less its jitter.
    pub time: Time,
    /// Position on the ellipsoid.
    pub position: Geodetic,
    /// Velocity against the Earth, east-north-up, m/s.
    pub velocity_enu_mps: Vector3<f64>,
    /// Rotation from body (right-forward-up) to ENU.
    pub attitude: UnitQuaternion<f64>,
}

impl Solution {
    /// Roll, pitch and heading, rad: see [`attitude::euler`].
    pub fn euler(&self) -> attitude::Euler {
        attitude::euler(&self.attitude)
    }
}

/// One standard deviation of each part of a [`Solution`], ENU.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SolutionSigma {
    /// Position, m.
    pub position_m: Vector3<f64>,
    /// Velocity, m/s.
    pub velocity_mps: Vector3<f64>,
    /// Attitude, rad: x and y are the tilts about east and north, z is the heading.
    pub attitude_rad: Vector3<f64>,
}

/// Compensated sensor readings; body axes right-forward-up. Means over the interval that ends at `time`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BodyMotion {
    /// Stamp of the inertial sample.
    pub time: Time,
    /// Angular rate against inertial space, rad/s.
    pub rate_radps: Vector3<f64>,
    /// Specific force, m/s^2.
    pub force_mps2: Vector3<f64>,
}
