//! From sensor readings to the rotation and the velocity gained over one interval.

use nalgebra::Vector3;

use crate::samples::{ImuOutput, ImuSample};

/// Longest interval, as a multiple of the usual one, that still counts as no sample missing.
const MISSING_RATIO: f64 = 1.5;

/// Motion over one interval, body axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Interval {
    /// Duration, s.
    pub seconds: f64,
    /// Integral of angular rate against inertial space, rad.
    pub angle_rad: Vector3<f64>,
    /// Integral of specific force, m/s.
    pub force_mps: Vector3<f64>,
    /// What the rotation vector has beyond `angle_rad`, rad.
    pub coning_rad: Vector3<f64>,
    /// What the velocity gained has beyond `force_mps` and its rotation, m/s.
    pub sculling_mps: Vector3<f64>,
}

impl Interval {
    /// The interval with constant biases subtracted.
    #[must_use]
    pub fn without_bias(&self, gyro_radps: &Vector3<f64>, accel_mps2: &Vector3<f64>) -> Self {
        Self {
            angle_rad: self.angle_rad - self.seconds * gyro_radps,
            force_mps: self.force_mps - self.seconds * accel_mps2,
            ..*self
        }
    }

    /// Rotation vector over the interval, rad.
    pub fn rotation_rad(&self) -> Vector3<f64> {
        self.angle_rad + self.coning_rad
    }

    /// Velocity gained from specific force, in the body axes of the interval's start, m/s.
    pub fn velocity_mps(&self) -> Vector3<f64> {
        let rotated = self.angle_rad.cross(&self.force_mps);
        self.force_mps + 0.5 * rotated + self.angle_rad.cross(&rotated) / 6.0 + self.sculling_mps
    }
}

/// Turns readings, rates or increments, into [`Interval`]s; remembers one reading.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Increments {
    output: ImuOutput,
    gyro: Vector3<f64>,
    accel: Vector3<f64>,
    /// Interval of the remembered reading, s; zero if it is the first.
    previous_s: f64,
    /// Usual interval, s; zero until known.
    usual_s: f64,
}

impl Increments {
    /// Starts from a first reading, whose own interval is unknown: it gives no motion.
    pub fn new(output: ImuOutput, first: &ImuSample) -> Self {
        Self {
            output,
            gyro: first.gyro,
            accel: first.accel,
            previous_s: 0.0,
            usual_s: 0.0,
        }
    }

    /// Begins again at a reading after a hole; the usual interval stays known.
    pub fn restart(&mut self, first: &ImuSample) {
        self.gyro = first.gyro;
        self.accel = first.accel;
        self.previous_s = 0.0;
    }

    /// Whether an interval of `seconds` has samples missing in it.
    pub fn has_hole(&self, seconds: f64) -> bool {
        self.usual_s > 0.0 && seconds > MISSING_RATIO * self.usual_s
    }

    /// The interval of `seconds` (positive) that ends at `sample`.
    ///
    /// Rates are taken as linear between their stamps, increments as those of a rate linear over
    /// the last two intervals (Savage 1998, two-sample coning and sculling); both give the same
    /// second-order terms, with `scale` as their only difference. A hole between increments is
    /// filled with the mean rate of its two ends.
    pub fn interval(&mut self, sample: &ImuSample, seconds: f64) -> Interval {
        let hole = self.has_hole(seconds);
        let (angle, force, scale) = match self.output {
            ImuOutput::Rates => (
                0.5 * seconds * (self.gyro + sample.gyro),
                0.5 * seconds * (self.accel + sample.accel),
                seconds * seconds / 12.0,
            ),
            ImuOutput::Increments if hole => {
                let ends = if self.previous_s > 0.0 { 2.0 } else { 1.0 };
                let previous = ends - 1.0;
                let fill = (seconds / self.usual_s - 1.0) / ends;
                (
                    sample.gyro + fill * (previous * self.gyro + sample.gyro),
                    sample.accel + fill * (previous * self.accel + sample.accel),
                    0.0,
                )
            }
            ImuOutput::Increments => {
                // A first reading is taken to span an interval like this one.
                let before = if self.previous_s > 0.0 { self.previous_s } else { seconds };
                let scale = seconds * seconds / (6.0 * before * (before + seconds));
                (sample.gyro, sample.accel, scale)
            }
        };
        let coning = scale * self.gyro.cross(&sample.gyro);
        let sculling = scale * (self.gyro.cross(&sample.accel) + self.accel.cross(&sample.gyro));
        self.gyro = sample.gyro;
        self.accel = sample.accel;
        self.previous_s = if hole { self.usual_s } else { seconds };
        self.learn_usual(seconds);
        Interval { seconds, angle_rad: angle, force_mps: force, coning_rad: coning, sculling_mps: sculling }
    }

    /// Follows the usual interval slowly, so that one hole does not move it far.
    fn learn_usual(&mut self, seconds: f64) {
        self.usual_s = if self.usual_s > 0.0 {
            let step = seconds - self.usual_s;
            let bounded = if step > self.usual_s { self.usual_s } else { step };
            self.usual_s + bounded / 16.0
        } else {
            seconds
        };
    }
}
