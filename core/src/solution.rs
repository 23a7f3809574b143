//! The navigation solution.

use nalgebra::{UnitQuaternion, Vector3};

use crate::attitude;
use crate::earth::Geodetic;
use crate::time::Time;

/// How far the navigator has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Phase {
    /// Finding roll and pitch (and, at rest, gyro biases); no solution yet.
    #[default]
    Levelling,
    /// Roll and pitch known, heading still to be found from motion; no solution yet.
    FindingHeading,
    /// Navigating, damped by GNSS.
    Navigating,
}

/// Where the vehicle is and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Solution {
    /// Stamp of the inertial sample that this solution belongs to.
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
