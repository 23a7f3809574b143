//! The parameters that are estimated jointly.

use crate::math;
use nalgebra::{ArrayStorage, SVector, Vector3};

/// How many there are.
pub const COUNT: usize = 24;
/// Elements of a triangular matrix over them.
pub const PAIRS: usize = COUNT * (COUNT + 1) / 2;

/// Gate of a direct measurement, sigmas.
pub(crate) const AGREES_SIGMAS: f64 = 4.0;

/// Place of each in a parameter vector. First those that change with every fix, for which the least squares
/// are then cheapest; last those that are most often configured as known, where they cost nothing.
pub mod index {
    /// Azimuth error `Phi_UP` of the platform now, rad.
    pub const AZIMUTH: usize = 0;
    /// GNSS latency now, s.
    pub const LATENCY: usize = 1;
    /// First of three gyro biases, rad/s.
    pub const GYRO: usize = 2;
    /// First of three accelerometer biases at the level attitude of the mount, m/s^2.
    pub const ACCEL: usize = 5;
    /// Smoothing by the receiver: variance of the delays that its output averages, s^2.
    pub const SMOOTHING: usize = 8;
    /// By how much positions are later than the velocities beside them, s.
    pub const POSITION_DELAY: usize = 9;
    /// Rate at which the latency grows: what the inertial clock loses on that of GNSS, s/s.
    pub const CLOCK_DRIFT: usize = 10;
    /// First of three lever-arm components (right, forward, up), m.
    pub const LEVER_ARM: usize = 11;
    /// First of three scale errors of the accelerometers.
    pub const ACCEL_SCALE: usize = 14;
    /// Scale error of the gyros in turns about the vertical axis of the mount.
    pub const TURN_SCALE: usize = 17;
    /// First of three scale errors of the gyros in all other turns.
    pub const GYRO_SCALE: usize = 18;
    /// First of three misalignments: part of all other rotations, about each axis of the body, that is
    /// sensed about the vertical, rad.
    pub const GYRO_MISALIGNMENT: usize = 21;
}

/// Values and standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Parameters {
    /// SI units, see [`index`].
    pub value: SVector<f64, COUNT>,
    /// One standard deviation of each; zero: known exactly, and not estimated.
    pub sigma: SVector<f32, COUNT>,
}

impl Parameters {
    /// Zeros.
    pub const NONE: Self = Self {
        value: SVector::from_array_storage(ArrayStorage([[0.0; COUNT]])),
        sigma: SVector::from_array_storage(ArrayStorage([[0.0; COUNT]])),
    };

    pub fn value(&self, parameter: usize) -> f64 {
        self.value.get(parameter).copied().unwrap_or(0.0)
    }

    pub fn sigma(&self, parameter: usize) -> f64 {
        self.sigma
            .get(parameter)
            .map_or(0.0, |sigma| f64::from(*sigma))
    }

    /// Three values from `first` on.
    pub fn vector(&self, first: usize) -> Vector3<f64> {
        [0, 1, 2].map(|axis| self.value(first + axis)).into()
    }

    /// Their standard deviations.
    pub fn sigmas(&self, first: usize) -> Vector3<f64> {
        [0, 1, 2].map(|axis| self.sigma(first + axis)).into()
    }

    /// Lever arm, right, forward and up, m.
    pub fn lever_arm(&self) -> Vector3<f64> {
        self.vector(index::LEVER_ARM)
    }

    pub fn shift(&mut self, parameter: usize, by: f64) {
        if let Some(value) = self.value.get_mut(parameter) {
            *value += by;
        }
    }

    /// Adds an independent variance.
    pub fn widen(&mut self, parameter: usize, variance: f64) {
        let sigma = self.sigma(parameter);
        let sigma = math::sqrt(sigma * sigma + variance);
        self.set(parameter, self.value(parameter), sigma);
    }

    /// Gate of an independent measurement of one parameter.
    pub fn agrees(&self, parameter: usize, measured: f64, variance: f64) -> bool {
        let (off, sigma) = (measured - self.value(parameter), self.sigma(parameter));
        off * off < AGREES_SIGMAS * AGREES_SIGMAS * (sigma * sigma + variance)
    }

    pub fn set(&mut self, parameter: usize, value: f64, sigma: f64) {
        if let (Some(v), Some(s)) = (self.value.get_mut(parameter), self.sigma.get_mut(parameter)) {
            (*v, *s) = (value, math::single(sigma));
        }
    }
}
