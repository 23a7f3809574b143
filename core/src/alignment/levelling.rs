//! Levelling and gyrocompassing: attitude from what the sensors read at rest.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::rest::RestBlock;
use crate::attitude::{Euler, from_euler};
use crate::config::SensorConfig;
use crate::earth::LocalEarth;
use crate::math;

/// Means over all blocks at rest so far, body axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RestMean {
    /// Time averaged over, s.
    pub seconds: f64,
    /// Mean angular rate, rad/s.
    pub rate_radps: Vector3<f64>,
    /// Mean specific force, m/s^2.
    pub force_mps2: Vector3<f64>,
}

impl RestMean {
    /// Adds a block.
    pub fn add(&mut self, block: &RestBlock) {
        self.seconds += block.seconds;
        let part = block.seconds / self.seconds;
        self.rate_radps += part * (block.rate_radps - self.rate_radps);
        self.force_mps2 += part * (block.force_mps2 - self.force_mps2);
    }
}

/// Roll and pitch that make a mean specific force point up, with a given heading.
pub fn level(force: &Vector3<f64>, heading_rad: f64) -> UnitQuaternion<f64> {
    // C^T (0, 0, g) = g (-cos p sin r, sin p, cos p cos r).
    let across = math::sqrt(force.x * force.x + force.z * force.z);
    from_euler(&Euler {
        roll_rad: math::atan2(-force.x, force.z),
        pitch_rad: math::atan2(force.y, across),
        heading_rad,
    })
}

/// Heading from the Earth rate that a levelled platform at rest senses, rad; `level_attitude`
/// has heading zero.
pub fn gyrocompass(level_attitude: &Matrix3<f64>, rate_radps: &Vector3<f64>) -> f64 {
    // With heading H the level axes see (-sin H, cos H) of the horizontal Earth rate.
    let rate = level_attitude * rate_radps;
    math::atan2(-rate.x, rate.y)
}

/// Standard deviation of a gyrocompassed heading, rad, after `seconds` at rest.
pub fn gyrocompass_sigma(sensors: &SensorConfig, earth: &LocalEarth, seconds: f64) -> f64 {
    let variance = sensors.gyro_bias_radps * sensors.gyro_bias_radps
        + sensors.mean_gyro_noise() * sensors.mean_gyro_noise() / seconds;
    math::sqrt(variance) / earth.earth_rate().y
}
