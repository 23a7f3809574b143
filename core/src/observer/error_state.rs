//! State of the observer: INS error and correlated GNSS noise. Its sensitivities to the parameters have the
//! same form.

use nalgebra::{RealField, SVector, Scalar, Vector2, Vector3};

use crate::channel::Measured;
use crate::error_model::InsError;
use crate::measurement::Kind;
use crate::parameters::{COUNT, index};

/// State of the observer, ENU; the noise has the sign that it has in INS minus GNSS.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ErrorState<T: Scalar> {
    /// Error of the INS.
    pub error: InsError<T>,
    /// Correlated noise of GNSS velocity, m/s.
    pub velocity_noise: Vector3<T>,
    /// Of GNSS position, m.
    pub position_noise: Vector3<T>,
}

impl<T: RealField + Copy> ErrorState<T> {
    /// Its part in INS minus GNSS: `H x`.
    pub fn measurement(&self, measured: Measured) -> Vector3<T> {
        match measured {
            Measured::Velocity => self.error.velocity_mps + self.velocity_noise,
            Measured::Position => self.error.position_m + self.position_noise,
        }
    }

    /// Multiplies the noise of velocity and position by these.
    pub fn decay(&mut self, level: [T; 2], up: [T; 2]) {
        let ([velocity, position], [velocity_up, position_up]) = (level, up);
        self.velocity_noise
            .component_mul_assign(&Vector3::new(velocity, velocity, velocity_up));
        self.position_noise
            .component_mul_assign(&Vector3::new(position, position, position_up));
    }

    /// Refers the position error of a kind to another time.
    pub fn advance_position(&mut self, kind: Kind, seconds: T) {
        let InsError {
            position_m,
            velocity_mps,
            ..
        } = &mut self.error;
        let moved = *velocity_mps * seconds;
        if kind.is_up() {
            position_m.z += moved.z;
        } else {
            position_m.x += moved.x;
            position_m.y += moved.y;
        }
    }

    /// Corrects east and north, or up, by their innovations: `dV_N' = g Phi_E` and `dV_E' = -g Phi_N`.
    #[inline]
    pub fn correct<const R: usize>(&mut self, gains: &SVector<T, 5>, by: &[T; R]) {
        let Self {
            error,
            velocity_noise,
            position_noise,
        } = self;
        let of_axes = [
            (&mut error.position_m, gains.x),
            (&mut error.velocity_mps, gains.y),
            (velocity_noise, gains.w),
            (position_noise, gains.a),
        ];
        match by.as_slice() {
            [east, north] => {
                for (v, gain) in of_axes {
                    v.x += gain * *east;
                    v.y += gain * *north;
                }
                error.tilt_rad.y -= gains.z * *east;
                error.tilt_rad.x += gains.z * *north;
            }
            [up] => {
                for (v, gain) in of_axes {
                    v.z += gain * *up;
                }
            }
            _ => {}
        }
    }

    /// Channel states of one axis, with the signs of [`Self::correct`].
    pub fn states(&self, axis: usize) -> SVector<T, 5> {
        let of = |v: &Vector3<T>| v.get(axis).copied().unwrap_or_else(T::zero);
        let tilt = &self.error.tilt_rad;
        SVector::from([
            of(&self.error.position_m),
            of(&self.error.velocity_mps),
            match axis {
                0 => -tilt.y,
                1 => tilt.x,
                _ => T::zero(),
            },
            of(&self.velocity_noise),
            of(&self.position_noise),
        ])
    }

    /// Adds `factor` times another.
    pub fn add_scaled(&mut self, other: &Self, factor: T) {
        self.error.add_scaled(&other.error, factor);
        self.velocity_noise += other.velocity_noise * factor;
        self.position_noise += other.position_noise * factor;
    }
}

impl ErrorState<f64> {
    /// Correlated noise of one kind.
    pub fn noise(&self, kind: Kind) -> Vector2<f64> {
        let noise = match kind.measured() {
            Measured::Velocity => &self.velocity_noise,
            Measured::Position => &self.position_noise,
        };
        if kind.is_up() {
            Vector2::new(noise.z, 0.0)
        } else {
            noise.xy()
        }
    }
}

impl ErrorState<f32> {
    pub fn double(&self) -> ErrorState<f64> {
        let double = |v: &Vector3<f32>| v.map(f64::from);
        ErrorState {
            error: InsError {
                position_m: double(&self.error.position_m),
                velocity_mps: double(&self.error.velocity_mps),
                tilt_rad: double(&self.error.tilt_rad),
            },
            velocity_noise: double(&self.velocity_noise),
            position_noise: double(&self.position_noise),
        }
    }
}

/// At the start only the azimuth parameter has an effect: it is the azimuth error.
pub const INITIAL_SENSITIVITIES: [ErrorState<f32>; COUNT] = {
    const NONE: Vector3<f32> = Vector3::new(0.0, 0.0, 0.0);
    let mut sensitivities = [ErrorState {
        error: InsError {
            position_m: NONE,
            velocity_mps: NONE,
            tilt_rad: NONE,
        },
        velocity_noise: NONE,
        position_noise: NONE,
    }; COUNT];
    sensitivities[index::AZIMUTH].error.tilt_rad = Vector3::new(0.0, 0.0, 1.0);
    sensitivities
};
