//! Detection of rest, and means of the sensors meanwhile.

use nalgebra::Vector3;

use crate::config::SensorConfig;
use crate::increments::Interval;

/// Length of a block, s.
const BLOCK_S: f64 = 1.0;
/// Largest spread of specific force within a block at rest with the engine running, m/s^2.
const ACCEL_SPREAD_MPS2: f64 = 0.5;
/// Largest spread of angular rate, rad/s.
const GYRO_SPREAD_RADPS: f64 = 0.02;
/// Largest change of the mean specific force from block to block, m/s^2.
const ACCEL_STEP_MPS2: f64 = 0.15;
/// Largest change of the mean angular rate from block to block, rad/s.
const GYRO_STEP_RADPS: f64 = 0.003;

/// Sway of a vehicle standing with people in it, rad/s in the mean of a second.
const SWAY_RADPS: f64 = 3e-4;

/// Variance of a gyro bias measured at rest for some time, (rad/s)^2.
pub(crate) fn gyro_variance(sensors: &SensorConfig, seconds: f64) -> f64 {
    (sensors.mean_gyro_noise() * sensors.mean_gyro_noise() + SWAY_RADPS * SWAY_RADPS) / seconds
}

/// Means over one block of a second, body axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RestBlock {
    /// Duration, s.
    pub seconds: f64,
    /// Mean angular rate, rad/s.
    pub rate_radps: Vector3<f64>,
    /// Mean specific force, m/s^2.
    pub force_mps2: Vector3<f64>,
}

/// Result of a finished block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// The block before was at rest, confirmed by this one.
    Rest(RestBlock),
    /// Quiet, to be confirmed by the next block.
    Perhaps(RestBlock),
    /// Moving.
    Motion(RestBlock),
}

impl Verdict {
    /// Whether it is motion.
    pub fn moves(&self) -> bool {
        matches!(self, Self::Motion(_))
    }

    /// The block, or the one before.
    pub fn block(&self) -> &RestBlock {
        match self {
            Self::Rest(block) | Self::Perhaps(block) | Self::Motion(block) => block,
        }
    }
}

/// Classifies one-second blocks. A block counts as rest only after the next one was quiet too: GNSS speed
/// is late, and the start of a motion must not be averaged in.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RestDetector {
    seconds: f64,
    angle: Vector3<f64>,
    force: Vector3<f64>,
    /// Integrals of squared rate and force.
    rate_power: f64,
    force_power: f64,
    moving: bool,
    before: Option<RestBlock>,
}

impl RestDetector {
    /// GNSS has shown a speed above its noise: this block is not rest.
    pub fn on_motion(&mut self) {
        self.moving = true;
        self.before = None;
    }

    /// Adds an interval; answers once per block. `raw` is uncompensated.
    pub fn on_interval(&mut self, raw: &Interval) -> Option<Verdict> {
        self.seconds += raw.seconds;
        self.angle += raw.angle_rad;
        self.force += raw.force_mps;
        self.rate_power += raw.angle_rad.norm_squared() / raw.seconds;
        self.force_power += raw.force_mps.norm_squared() / raw.seconds;
        (self.seconds >= BLOCK_S).then(|| self.close())
    }

    fn close(&mut self) -> Verdict {
        let block = RestBlock {
            seconds: self.seconds,
            rate_radps: self.angle / self.seconds,
            force_mps2: self.force / self.seconds,
        };
        let rate_variance = self.rate_power / self.seconds - block.rate_radps.norm_squared();
        let force_variance = self.force_power / self.seconds - block.force_mps2.norm_squared();
        let quiet = !self.moving
            && rate_variance < GYRO_SPREAD_RADPS * GYRO_SPREAD_RADPS
            && force_variance < ACCEL_SPREAD_MPS2 * ACCEL_SPREAD_MPS2;
        let before = self.before;
        *self = Self::default();
        if !quiet {
            return Verdict::Motion(block);
        }
        self.before = Some(block);
        match before {
            Some(earlier) if shared(&earlier, &block) => Verdict::Rest(earlier),
            _ => Verdict::Perhaps(block),
        }
    }
}

fn shared(a: &RestBlock, b: &RestBlock) -> bool {
    (a.force_mps2 - b.force_mps2).norm() < ACCEL_STEP_MPS2
        && (a.rate_radps - b.rate_radps).norm() < GYRO_STEP_RADPS
}
