//! Results of the estimators: a value, its sigma, and whether it is observable yet.

use nalgebra::Vector3;

use crate::config::Config;
use crate::earth::GRAVITY_EQUATOR_MPS2;
use crate::increments::Interval;
use crate::parameters::{Parameters, index};
use crate::solution::Phase;

/// Whether an estimate can be used, and if not, what the vehicle has to do for it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Observability {
    /// The value is determined by data.
    Observable,
    /// Known exactly beforehand: its sigma in the [`Config`] is zero.
    Given,
    /// Only more running time with GNSS velocity helps.
    #[default]
    NeedsTime,
    /// A straight start or braking shows it.
    NeedsAcceleration,
    /// A turn of 90 degrees or more shows it.
    NeedsTurn,
    /// The quantity has no source in this log (no vertical velocity, say).
    NeedsVerticalVelocity,
}

impl Observability {
    /// One plain sentence for a person.
    pub const fn why(self) -> &'static str {
        match self {
            Self::Observable => "observable",
            Self::Given => "given by the configuration",
            Self::NeedsTime => "needs more time with GNSS velocity",
            Self::NeedsAcceleration => "needs starts and brakings, or turns at speed",
            Self::NeedsTurn => "needs a turn",
            Self::NeedsVerticalVelocity => "needs GNSS vertical velocity",
        }
    }
}

/// One estimated quantity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Estimate {
    /// Best value now; SI units.
    pub value: f64,
    /// One standard deviation of `value`, same unit.
    pub sigma: f64,
    /// Whether `value` is determined by data.
    pub observability: Observability,
}

/// Estimated errors of the sensors, body axes right-forward-up, SI units.
///
/// Biases are measured minus true: subtract them from readings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Estimates {
    /// Computed minus true heading, rad, that an INS would have now had it kept its starting heading and
    /// had its gyros been compensated from the start.
    pub azimuth_error_rad: Estimate,
    /// Accelerometer biases x, y, z, m/s^2.
    pub accel_bias_mps2: [Estimate; 3],
    /// Gyro biases x, y, z, rad/s.
    pub gyro_bias_radps: [Estimate; 3],
    /// GNSS latency, s: a fix stamped t shows the motion at t minus this. Negative if the
    /// inertial stamps are the late ones.
    ///
    /// Mean since it was last aligned: where the two clocks drift apart, see `clock_drift`.
    pub gnss_latency_s: Estimate,
    /// The latency at the last fix, s.
    pub gnss_latency_now_s: Estimate,
    /// Delay of positions beyond that of the velocities beside them, s; negative: earlier.
    pub gnss_position_delay_s: Estimate,
    /// Growth of the latency, s/s: the inertial clock loses this on GNSS time.
    pub clock_drift: Estimate,
    /// Smoothing by the receiver: variance of the delays that one output averages, s^2.
    pub gnss_smoothing_s2: Estimate,
    /// Scale errors of the x, y and z accelerometers, 1, acting on the force beyond that at the level
    /// attitude.
    pub accel_scale: [Estimate; 3],
    /// Scale error of the gyros in turns about the vertical of the mount, 1.
    pub turn_scale: Estimate,
    /// Scale errors of the x, y and z gyros in all other turns, 1.
    pub gyro_scale: [Estimate; 3],
    /// Misalignments of the gyros, rad: the part of all other turns, about the x, y and z axis, that they
    /// sense about the vertical.
    pub gyro_misalignment_rad: [Estimate; 3],
    /// Antenna position right, forward and up of the inertial sensors, m.
    pub lever_arm_m: [Estimate; 3],
    /// Specific force in the body at the level attitude of the mount, m/s^2: there the effect of the
    /// accelerometers' scale errors is part of the biases.
    pub level_force_mps2: Vector3<f64>,
}

/// Sigma below which the azimuth is observable, rad.
const AZIMUTH_SIGMA_RAD: f64 = 0.035;
/// Part of the prior sigma below which an estimate is.
const KNOWN: f64 = 0.33;

impl Estimates {
    /// An interval compensated for all observable errors of the sensors.
    #[must_use]
    pub fn corrected(&self, interval: &Interval) -> Interval {
        let value = |estimate: &Estimate| match estimate.observability {
            Observability::Observable => estimate.value,
            _ => 0.0,
        };
        let vector = |three: &[Estimate; 3]| Vector3::from(three.each_ref().map(value));
        let gyro = vector(&self.gyro_bias_radps);
        let mut corrected = interval.without_bias(&gyro, &vector(&self.accel_bias_mps2));
        let beyond_level = interval.force_mps - self.level_force_mps2 * interval.seconds;
        corrected.force_mps -= vector(&self.accel_scale).component_mul(&beyond_level);
        if let Some(up) = self
            .level_force_mps2
            .try_normalize(GRAVITY_EQUATOR_MPS2 / 2.0)
        {
            let turn_rad = up.dot(&interval.angle_rad);
            let level_turn_rad = interval.angle_rad - turn_rad * up;
            corrected.angle_rad -= value(&self.turn_scale) * turn_rad * up
                + vector(&self.gyro_scale).component_mul(&level_turn_rad)
                + vector(&self.gyro_misalignment_rad).dot(&level_turn_rad) * up;
        }
        corrected
    }

    pub(crate) fn from_parameters(p: &Parameters, config: &Config, phase: Phase) -> Self {
        let prior = config.prior_sigma();
        let navigating = phase == Phase::Navigating;
        let estimate = |i: usize, good: bool, missing: Observability| Estimate {
            value: p.value(i),
            sigma: p.sigma(i),
            observability: if good {
                Observability::Observable
            } else if config.is_given(i) {
                Observability::Given
            } else {
                missing
            },
        };
        let known = |i: usize, missing: Observability| {
            let believed = prior.get(i).map_or(0.0, |sigma| f64::from(*sigma));
            let good = navigating && p.sigma(i) < KNOWN * believed;
            estimate(i, good, missing)
        };
        let three = |first: usize, missing| [0, 1, 2].map(|axis| known(first + axis, missing));
        let azimuth = navigating && p.sigma(index::AZIMUTH) < AZIMUTH_SIGMA_RAD;
        Self {
            azimuth_error_rad: estimate(index::AZIMUTH, azimuth, Observability::NeedsAcceleration),
            accel_bias_mps2: [
                known(index::ACCEL, Observability::NeedsTurn),
                known(index::ACCEL + 1, Observability::NeedsTurn),
                known(index::ACCEL + 2, Observability::NeedsVerticalVelocity),
            ],
            gyro_bias_radps: [
                known(index::GYRO, Observability::NeedsTime),
                known(index::GYRO + 1, Observability::NeedsTime),
                known(index::GYRO + 2, Observability::NeedsAcceleration),
            ],
            gnss_latency_s: known(index::LATENCY, Observability::NeedsAcceleration),
            gnss_latency_now_s: known(index::LATENCY, Observability::NeedsAcceleration),
            gnss_position_delay_s: known(index::POSITION_DELAY, Observability::NeedsAcceleration),
            clock_drift: known(index::CLOCK_DRIFT, Observability::NeedsTime),
            gnss_smoothing_s2: known(index::SMOOTHING, Observability::NeedsAcceleration),
            accel_scale: three(index::ACCEL_SCALE, Observability::NeedsAcceleration),
            turn_scale: known(index::TURN_SCALE, Observability::NeedsTurn),
            gyro_scale: three(index::GYRO_SCALE, Observability::NeedsTurn),
            gyro_misalignment_rad: three(index::GYRO_MISALIGNMENT, Observability::NeedsTurn),
            lever_arm_m: three(index::LEVER_ARM, Observability::NeedsTurn),
            level_force_mps2: Vector3::zeros(),
        }
    }
}
