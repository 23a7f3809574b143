//! Rest or a slow turn: what the gyros at rest can say of their bias about the up axis.
//!
//! About a level axis a turn shows in the direction of gravity. About the up axis nothing shows
//! it: a boat at anchor swings at tenths of a degree per second, as smoothly as a gyro bias. But
//! it swings back. A swing `A cos(w t + p)` of rate has a slope `-A w sin` and a curvature
//! `-A w^2 cos`, so that `A^2 = (slope / w)^2 + (curvature / w^2)^2`: what slope and curvature of
//! the rates may be, given their noise, bounds what turn may hide in their mean.

use nalgebra::{Matrix3, Vector3};

use crate::math;

/// Time constant `1 / w` of the slowest swing, s: a vessel at anchor takes minutes.
const SLOWEST_S: f64 = 50.0;
/// Turn of a vehicle that passes for rest, rad/s: a third of a degree per second.
pub(super) const UNSEEN_RADPS: f64 = 6e-3;
/// Blocks that a parabola uses up, and one more.
const LEAST_BLOCKS: f64 = 4.0;

/// Sums over the rates about up of successive blocks at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Swing {
    seconds: f64,
    gram: Matrix3<f64>,
    with_rate: Vector3<f64>,
    square: f64,
}

impl Swing {
    /// Adds the mean rate of a block that `seconds` long.
    pub(crate) fn add(&mut self, seconds: f64, rate_radps: f64) {
        let time = (self.seconds + 0.5 * seconds) / SLOWEST_S;
        let basis = Vector3::new(1.0, time, 0.5 * time * time);
        self.seconds += seconds;
        self.gram += basis * basis.transpose();
        self.with_rate += rate_radps * basis;
        self.square += rate_radps * rate_radps;
    }

    /// Variance of the turn that may hide in the mean rate, `(rad/s)^2`; `noise_radps` is the least
    /// noise of a block's mean.
    pub(crate) fn variance(&self, noise_radps: f64) -> f64 {
        let unseen = UNSEEN_RADPS * UNSEEN_RADPS;
        let count = self.gram.m11;
        if count < LEAST_BLOCKS {
            return unseen;
        }
        let Some(inverse) = self.gram.try_inverse() else {
            return unseen;
        };
        let fit = inverse * self.with_rate;
        let left = math::max(self.square - fit.dot(&self.with_rate), 0.0) / (count - 3.0);
        let least = noise_radps * noise_radps;
        let noise = math::max(left, least);
        // What a parabola leaves of a swing is as large as what its mean may hide.
        let waves = noise - least;
        let middle = 0.5 * self.seconds / SLOWEST_S;
        let slope = fit.y + middle * fit.z;
        let slope_variance =
            inverse.m22 + 2.0 * middle * inverse.m23 + middle * middle * inverse.m33;
        let swing = slope * slope + fit.z * fit.z + waves + noise * (slope_variance + inverse.m33);
        math::min(swing, unseen)
    }
}
