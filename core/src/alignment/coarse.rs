//! Levelling in motion.
//!
//! In a frame that the gyros hold, the mean specific force over a time `T` is gravity plus `dv / T`, with
//! the velocity gained `dv`, however the vehicle turns, banks or shakes: the tilt error is `|dv| / (g T)`,
//! and `|dv|` is known by GNSS without a heading. Gyro biases tilt the held frame by `b T / 2` in the mean
//! over `T`, and by as much again since. So long means are good in turns, short ones with poor gyros, and
//! the sum of both variances decides.

use nalgebra::{UnitQuaternion, Vector2, Vector3};

use super::levelling::level;
use crate::attitude::{euler, matrix, renormalized, small_rotation};
use crate::earth::GRAVITY_EQUATOR_MPS2;
use crate::increments::Interval;
use crate::math;

/// Least time of a mean, s: longer than bumps.
const LEAST_S: f64 = 2.0;
/// Longest time of a mean, s.
const LONGEST_S: f64 = 8.0;
/// Acceleration of a vehicle without GNSS velocity, m/s^2.
const UNSEEN_MPS2: f64 = 2.0;

/// The mean so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct CoarseLevel {
    seconds: f64,
    /// Heading turned during the means before, rad.
    turned_before_rad: f64,
    /// Attitude relative to the start of the mean.
    turned: Option<UnitQuaternion<f64>>,
    /// Velocity gained by specific force, axes of the start, m/s.
    force_mps: Vector3<f64>,
    /// Velocity at the start, E and N.
    first_mps: Option<Vector2<f64>>,
    last_mps: Option<Vector2<f64>>,
}

/// An attitude with zero heading at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Level {
    pub(crate) attitude: UnitQuaternion<f64>,
    pub(crate) tilt_sigma_rad: f64,
}

impl CoarseLevel {
    /// Takes an interval; restarts a mean that has become too long.
    pub(crate) fn on_interval(&mut self, interval: &Interval) {
        if self.seconds >= LONGEST_S {
            *self = Self {
                turned_before_rad: self.heading_rad(),
                first_mps: self.last_mps,
                last_mps: self.last_mps,
                ..Self::default()
            };
        }
        let turned = self.turned.unwrap_or_default();
        self.force_mps += matrix(&turned) * interval.velocity_mps();
        let next = turned.as_ref() * small_rotation(&interval.rotation_rad());
        self.turned = Some(renormalized(next));
        self.seconds += interval.seconds;
    }

    /// GNSS has measured a velocity.
    pub(crate) fn on_velocity(&mut self, velocity_mps: &Vector2<f64>) {
        self.first_mps.get_or_insert(*velocity_mps);
        self.last_mps = Some(*velocity_mps);
    }

    /// The attitude now, with zero heading at the very first interval.
    fn attitude(&self) -> Option<UnitQuaternion<f64>> {
        let up = level(&self.force_mps, self.turned_before_rad);
        Some(renormalized(up.as_ref() * self.turned?.as_ref()))
    }

    /// The heading now, with zero at the very first interval, rad.
    pub(crate) fn heading_rad(&self) -> f64 {
        self.attitude().map_or(0.0, |a| euler(&a).heading_rad)
    }

    /// The attitude now, if the mean is long enough; `bias_radps` is the sigma of the gyro biases.
    pub(crate) fn level(&self, bias_radps: f64) -> Option<Level> {
        if self.seconds < LEAST_S {
            return None;
        }
        let gained = match (self.first_mps, self.last_mps) {
            (Some(first), Some(last)) => math::sqrt((last - first).norm_squared()),
            _ => UNSEEN_MPS2 * self.seconds,
        };
        let pushed = gained / (GRAVITY_EQUATOR_MPS2 * self.seconds);
        let turned = 0.5 * bias_radps * self.seconds;
        let variance = pushed * pushed + turned * turned;
        Some(Level {
            attitude: self.attitude()?,
            tilt_sigma_rad: math::sqrt(variance),
        })
    }

    /// Whether the mean is as long as it gets.
    pub(crate) fn is_long(&self) -> bool {
        self.seconds > LONGEST_S - 0.5
    }
}
