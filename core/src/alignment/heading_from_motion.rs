//! Heading from motion, for any unknown heading.
//!
//! The levelled INS sees its velocity `u` in a frame that points anywhere; GNSS sees the same
//! velocity `v` in the true one. A constant, a slope and a curvature of time are taken out of
//! both, per axis: start velocity, tilt and gyro bias. What is left differs by the rotation
//! `atan2(SUM u x v, SUM u . v)` alone. Sums only: no sample is kept.

use nalgebra::{Matrix3, Matrix3x2, Vector2, Vector3};

use crate::math;

/// Fixes needed beyond those that the polynomials use up.
const LEAST_FIXES: f64 = 10.0;
/// Least length of a window, s.
const LEAST_SECONDS: f64 = 5.0;
/// Largest standard deviation of a heading that is taken, rad.
const HEADING_SIGMA_RAD: f64 = 0.03;
/// Acceleration below which a vehicle moves steadily, m/s^2.
const STEADY_MPS2: f64 = 0.3;
/// Least correlation of the two velocities.
const CORRELATION: f64 = 0.95;

/// Sums over one window.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MotionSums {
    seconds: f64,
    gram: Matrix3<f64>,
    ins: Matrix3x2<f64>,
    gnss: Matrix3x2<f64>,
    dot: f64,
    cross: f64,
    ins_power: f64,
    gnss_power: f64,
}

/// What a window says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Rotation from the wandering to the true frame, counter-clockwise, rad.
    pub rotation_rad: f64,
    /// Its standard deviation, rad.
    pub sigma_rad: f64,
    /// Rate at which the rotated INS velocity ran away from GNSS at the end, E and N, m/s^2.
    pub slope_mps2: Vector2<f64>,
}

impl MotionSums {
    /// Length of the window so far, s.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Adds the two velocities (E, N) at `seconds` after the window's start.
    pub fn add(&mut self, seconds: f64, ins: &Vector2<f64>, gnss: &Vector2<f64>) {
        let basis = Vector3::new(1.0, seconds, seconds * seconds);
        self.seconds = seconds;
        self.gram += basis * basis.transpose();
        self.ins += basis * ins.transpose();
        self.gnss += basis * gnss.transpose();
        self.dot += ins.dot(gnss);
        self.cross += ins.perp(gnss);
        self.ins_power += ins.norm_squared();
        self.gnss_power += gnss.norm_squared();
    }

    /// Fits the rotation; `None` while the window cannot show it.
    pub fn fit(&self) -> Option<Fit> {
        let count = self.gram.m11;
        if count < LEAST_FIXES || self.seconds < LEAST_SECONDS {
            return None;
        }
        let inverse = self.gram.try_inverse()?;
        let (ins, gnss) = (inverse * self.ins, inverse * self.gnss);
        let explained = self.ins.tr_mul(&gnss);
        let dot = self.dot - explained.trace();
        let cross = self.cross - (explained.m12 - explained.m21);
        let ins_power = self.ins_power - self.ins.tr_mul(&ins).trace();
        let gnss_power = self.gnss_power - self.gnss.tr_mul(&gnss).trace();
        let common = math::sqrt(dot * dot + cross * cross);
        // Least residual power over all rotations.
        let residual = math::max(ins_power + gnss_power - 2.0 * common, 0.0);
        let variance = residual / (2.0 * count - 7.0);
        let sigma_rad = math::sqrt(variance / gnss_power);
        let correlation = common / math::sqrt(ins_power * gnss_power);
        let rotation_rad = math::atan2(cross, dot);
        let (sin, cos) = math::sin_cos(rotation_rad);
        let u = slope(&ins, self.seconds);
        let turned = Vector2::new(cos * u.x - sin * u.y, sin * u.x + cos * u.y);
        // Written so that NaN fails.
        (sigma_rad < HEADING_SIGMA_RAD && correlation > CORRELATION).then(|| Fit {
            rotation_rad,
            sigma_rad,
            slope_mps2: turned - slope(&gnss, self.seconds),
        })
    }

    /// How the INS ran away from a vehicle that hardly accelerated; `None` if it did.
    pub fn runaway(&self) -> Option<Runaway> {
        let inverse = self.gram.try_inverse()?;
        let (ins, gnss) = (inverse * self.ins, inverse * self.gnss);
        let accel_mps2 = slope(&gnss, self.seconds).norm();
        (accel_mps2 < STEADY_MPS2).then(|| Runaway {
            slope_mps2: slope(&ins, self.seconds),
            curvature_mps3: 2.0 * ins.row(2).transpose(),
        })
    }
}

/// Growth of the INS velocity at a window's end, E and N, of a vehicle in steady motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Runaway {
    /// By tilt, m/s^2.
    pub slope_mps2: Vector2<f64>,
    /// By gyro biases, m/s^3.
    pub curvature_mps3: Vector2<f64>,
}

/// Slope of fitted velocities at the end of a window.
fn slope(fitted: &Matrix3x2<f64>, seconds: f64) -> Vector2<f64> {
    Vector2::new(fitted.m21, fitted.m22) + 2.0 * seconds * Vector2::new(fitted.m31, fitted.m32)
}
