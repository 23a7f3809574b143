//! What comes in: inertial samples and GNSS fixes.

use nalgebra::{Vector2, Vector3};

use crate::config::Config;
use crate::earth::Geodetic;
use crate::time::Time;

/// What the two vectors of an [`ImuSample`] are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ImuOutput {
    /// Instantaneous angular rate (rad/s) and specific force (m/s^2) at the stamp.
    #[default]
    Rates,
    /// Angle (rad) and velocity (m/s) gained over the interval that ends at the stamp.
    Increments,
}

/// One reading of the inertial sensors, body axes right-forward-up.
///
/// Units follow [`ImuOutput`] of the configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ImuSample {
    /// Stamp of the reading, or end of its interval.
    pub time: Time,
    /// Angular rate of the body against inertial space, rad/s, or its increment, rad.
    pub gyro: Vector3<f64>,
    /// Specific force, m/s^2 (at rest: +g on the up axis), or its increment, m/s.
    pub accel: Vector3<f64>,
}

/// One GNSS fix. Every part may be missing; a fix with no part is refused.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GnssFix {
    /// Stamp of the fix, on the same scale as the inertial stamps.
    pub time: Time,
    /// Antenna position on the ellipsoid.
    pub position: Option<Geodetic>,
    /// East and north velocity, m/s.
    pub velocity_en_mps: Option<Vector2<f64>>,
    /// Vertical velocity, up positive, m/s.
    pub velocity_up_mps: Option<f64>,
    /// One-sigma noise of a velocity component as the receiver states it, m/s.
    pub velocity_sigma_mps: Option<f64>,
}

/// Speed above which GNSS says that the vehicle moves, m/s, and sigmas of its noise on top.
const MOTION_MPS: f64 = 0.2;
const MOTION_SIGMAS: f64 = 4.0;

impl GnssFix {
    /// Velocity ENU, m/s; zero where a component is missing.
    pub fn velocity_enu_mps(&self) -> Vector3<f64> {
        let level = self.velocity_en_mps.unwrap_or_default();
        Vector3::new(level.x, level.y, self.velocity_up_mps.unwrap_or_default())
    }

    /// Horizontal speed, m/s.
    pub fn speed_mps(&self) -> f64 {
        self.velocity_en_mps.unwrap_or_default().norm()
    }

    /// Whether the speed is above its noise.
    pub(crate) fn is_moving(&self, config: &Config) -> bool {
        let velocity = self.velocity_en_mps.unwrap_or_default();
        let least = MOTION_MPS + MOTION_SIGMAS * config.gnss.velocity_sigma_mps;
        velocity.norm_squared() > least * least
    }
}
