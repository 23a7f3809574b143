//! Error of the INS and how it grows: (1)-(2), for large tilts to second order.

use nalgebra::{RealField, Scalar, Vector3};

use super::parameters::{Parameters, index};
use crate::history::Span;
use crate::math;

/// Error of the INS, ENU.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct InsError<T: Scalar = f64> {
    /// dV, m/s.
    pub velocity_mps: Vector3<T>,
    /// Phi, rad.
    pub tilt_rad: Vector3<T>,
}

/// What a span does to every error, whatever has caused it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage<T: Scalar = f64> {
    /// Integral of specific force, m/s.
    pub force_mps: Vector3<T>,
    /// Turn of the frame against inertial space, and half of what the platform turns against the
    /// frame: rotations do not commute, and Phi is the vector of one (Bortz, IEEE TAES 7, 1971).
    pub turn_rad: Vector3<T>,
}

/// What comes into the error of the INS over a span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forcing {
    /// Turn of the platform by the parameters, rad.
    drift_rad: Vector3<f64>,
    /// Turn of the platform by the controls, rad.
    control_tilt_rad: Vector3<f64>,
    /// By both, with what that turn did to the velocity, m/s.
    velocity_mps: Vector3<f64>,
}

impl Forcing {
    /// By the controls of a span and by `parameters`.
    pub fn over(span: &Span, parameters: &Parameters) -> Self {
        let mut forcing = Self {
            drift_rad: Vector3::zeros(),
            control_tilt_rad: span.control_tilt_rad,
            velocity_mps: span.control_velocity_mps,
        };
        for_each_input(span, |which, input| match input {
            Input::Tilt(by) => forcing.drift_rad += by * parameters.value(which),
            Input::Velocity(by) => forcing.velocity_mps += by * parameters.value(which),
        });
        forcing
    }
}

impl Passage {
    /// Over a span in a frame that turns at `frame_rate`.
    pub fn over(span: &Span, frame_rate_radps: &Vector3<f64>, forcing: &Forcing) -> Self {
        let platform_rad = forcing.control_tilt_rad + forcing.drift_rad;
        Self {
            force_mps: span.force_mps,
            turn_rad: frame_rate_radps * span.seconds + 0.5 * platform_rad,
        }
    }

    /// In single precision.
    pub fn single(&self) -> Passage<f32> {
        Passage {
            force_mps: single(&self.force_mps),
            turn_rad: single(&self.turn_rad),
        }
    }
}

/// What a unit of a parameter puts into (1)-(2) over a span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Input<T: Scalar = f64> {
    /// `-C dw`, rad.
    Tilt(Vector3<T>),
    /// `C df`, m/s.
    Velocity(Vector3<T>),
}

impl Input {
    /// In single precision.
    pub fn single(&self) -> Input<f32> {
        match self {
            Self::Tilt(tilt) => Input::Tilt(single(tilt)),
            Self::Velocity(velocity) => Input::Velocity(single(velocity)),
        }
    }
}

impl<T: RealField + Copy> InsError<T> {
    /// No error.
    pub fn zero() -> Self {
        Self {
            velocity_mps: Vector3::zeros(),
            tilt_rad: Vector3::zeros(),
        }
    }

    /// `dV' = f x Phi`, `Phi' = -w_in x Phi`.
    pub fn carry(&mut self, passage: &Passage<T>) {
        self.velocity_mps += passage.force_mps.cross(&self.tilt_rad);
        self.tilt_rad += self.tilt_rad.cross(&passage.turn_rad);
    }

    /// What came in evenly over a span that has been carried over.
    pub fn feed(&mut self, passage: &Passage<T>, input: &Input<T>) {
        match input {
            Input::Tilt(tilt) => {
                let half = nalgebra::convert::<f64, T>(0.5);
                self.velocity_mps += passage.force_mps.cross(&(tilt * half));
                self.tilt_rad += tilt;
            }
            Input::Velocity(velocity) => self.velocity_mps += velocity,
        }
    }

    /// Adds `factor` times another error.
    pub fn add_scaled(&mut self, other: &Self, factor: T) {
        self.velocity_mps += other.velocity_mps * factor;
        self.tilt_rad += other.tilt_rad * factor;
    }
}

impl InsError {
    /// The error at the end of a passage.
    #[must_use]
    pub fn after(&self, passage: &Passage, forcing: &Forcing) -> Self {
        let mut error = *self;
        error.carry(passage);
        // Second order: force is longer than its projection. Plus, for it is the one of the
        // tilted frame.
        let phi = &self.tilt_rad;
        error.velocity_mps += 0.5 * phi.cross(&passage.force_mps.cross(phi));
        error.feed(passage, &Input::Tilt(forcing.drift_rad));
        error.velocity_mps += forcing.velocity_mps;
        error.tilt_rad += forcing.control_tilt_rad;
        error
    }
}

/// Tells `visit` what a unit of each parameter puts in over a span; nothing for those not named.
pub fn for_each_input(span: &Span, mut visit: impl FnMut(usize, Input)) {
    // A span of no length has no inputs.
    let seconds = math::max(span.seconds, 1e-9);
    let turn_radps = span.turn_rad / seconds;
    for axis in 0..3 {
        let column = span.attitude_s.column(axis).into_owned();
        visit(index::GYRO + axis, Input::Tilt(-column));
        visit(index::GYRO_TURN + axis, Input::Tilt(-turn_radps * column));
        visit(index::ACCEL + axis, Input::Velocity(column));
        if axis < 2 {
            // C f_k, with f_k the specific force felt on the axis.
            let felt = column.dot(&span.force_mps) / (seconds * seconds);
            visit(index::ACCEL_SCALE + axis, Input::Velocity(felt * column));
        }
    }
}

/// In single precision.
pub fn single(v: &Vector3<f64>) -> Vector3<f32> {
    v.map(math::single)
}
