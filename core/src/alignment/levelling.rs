//! Levelling and gyrocompassing: attitude from the sensors at rest.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::rest::{self, RestBlock};
use crate::attitude::{Euler, from_euler};
use crate::config::SensorConfig;
use crate::earth::{GRAVITY_EQUATOR_MPS2, LocalEarth};
use crate::math;

/// Turn about up of a vehicle that passes for rest, rad/s: a third of a degree per second. Nothing shows
/// it: a boat at anchor swings as smoothly as a gyro bias.
pub(crate) const UNSEEN_RADPS: f64 = 6e-3;
/// Rest after which the scatter of blocks separates noise from waves, s.
const LEAST_SCATTER_S: f64 = 4.0;
/// Gate of a block against the mean, sigmas: beyond, the bias or the motion has changed.
const AGREES_SIGMAS: f64 = 6.0;

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
    /// Sum over blocks of the squared rate's distance from the mean, per axis.
    scatter: Vector3<f64>,
}

impl RestMean {
    pub fn add(&mut self, block: &RestBlock) {
        self.seconds += block.seconds;
        let part = block.seconds / self.seconds;
        let off = block.rate_radps - self.rate_radps;
        self.rate_radps += part * off;
        self.scatter += (1.0 - part) * block.seconds * off.component_mul(&off);
        self.force_mps2 += part * (block.force_mps2 - self.force_mps2);
    }

    /// Whether the rate of a block agrees with the mean so far.
    pub fn agrees(&self, block: &RestBlock, sensors: &SensorConfig) -> bool {
        let noise = rest::gyro_variance(sensors, block.seconds);
        let variance = self.gyro_variance(sensors);
        let off = block.rate_radps - self.rate_radps;
        let limit = AGREES_SIGMAS * AGREES_SIGMAS;
        self.seconds <= 0.0
            || off
                .iter()
                .zip(&variance)
                .all(|(off, variance)| off * off <= limit * (variance + noise))
    }

    /// Variance of the mean rate as a gyro bias, per axis, `(rad/s)^2`: noise or the scatter of the blocks
    /// (waves), and a slow turn about the up axis, wherever that is in the body.
    pub(crate) fn gyro_variance(&self, sensors: &SensorConfig) -> Vector3<f64> {
        let noise = rest::gyro_variance(sensors, self.seconds);
        let unseen = UNSEEN_RADPS * UNSEEN_RADPS;
        // Few blocks have no scatter; their mean may be that of a wave.
        if self.seconds < LEAST_SCATTER_S {
            return Vector3::repeat(noise + unseen);
        }
        let up = self.force_mps2.try_normalize(GRAVITY_EQUATOR_MPS2 / 2.0);
        let scatter = self.scatter / (self.seconds * (self.seconds - 2.0));
        up.unwrap_or_default().zip_map(&scatter, |part, scatter| {
            math::max(noise, scatter) + part * part * unseen
        })
    }
}

/// Roll and pitch of a mean specific force, with a given heading.
pub fn level(force: &Vector3<f64>, heading_rad: f64) -> UnitQuaternion<f64> {
    // C^T (0, 0, g) = g (-cos p sin r, sin p, cos p cos r).
    let across = math::sqrt(force.x * force.x + force.z * force.z);
    from_euler(&Euler {
        roll_rad: math::atan2(-force.x, force.z),
        pitch_rad: math::atan2(force.y, across),
        heading_rad,
    })
}

/// Heading by the Earth rate of a levelled platform at rest, rad; `level_attitude` has heading zero.
pub fn gyrocompass(level_attitude: &Matrix3<f64>, rate_radps: &Vector3<f64>) -> f64 {
    // With heading H the level axes sense (-sin H, cos H) of the horizontal Earth rate.
    let rate = level_attitude * rate_radps;
    math::atan2(-rate.x, rate.y)
}

/// Standard deviation of a gyrocompassed heading, rad, after `seconds` at rest: by gyro bias and noise.
pub fn gyrocompass_sigma(sensors: &SensorConfig, earth: &LocalEarth, seconds: f64) -> f64 {
    let by_bias = sensors.gyro_bias_radps / earth.earth_rate().y;
    let by_noise = gyrocompass_noise(sensors, earth, seconds);
    math::sqrt(by_bias * by_bias + by_noise * by_noise)
}

/// By noise alone, rad.
pub fn gyrocompass_noise(sensors: &SensorConfig, earth: &LocalEarth, seconds: f64) -> f64 {
    sensors.mean_gyro_noise() / (math::sqrt(seconds) * earth.earth_rate().y)
}
