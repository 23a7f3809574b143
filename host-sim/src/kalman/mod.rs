//! An error-state Kalman filter over the core's mechanization: what the core is compared with.
//!
//! Sixteen errors: position, velocity and attitude (computed minus true, `C' = (I - [Phi x]) C`),
//! what is left of accelerometer and gyro biases and of the latency of GNSS in the compensated
//! readings. Velocity and position of a fix are compared with the INS of the fix's own moment,
//! and the errors found are taken out of the INS at once. [`smoother`] goes back over the log.

pub mod dynamics;
pub mod filter;
pub mod noise;
pub mod run;
pub mod smoother;

pub use filter::{Correction, Filter, Known};
pub use noise::Noise;
pub use run::Run;
pub use smoother::{Record, Smoothed, smooth};

use nalgebra::{SMatrix, SVector};

/// Number of errors.
pub const STATES: usize = 16;
/// One value for each error.
pub type States = SVector<f64, STATES>;
/// Covariance or transition of the errors.
pub type StateMatrix = SMatrix<f64, STATES, STATES>;

/// Where each error stands; the first of three, ENU or right-forward-up.
pub mod index {
    /// Position, ENU, m.
    pub const POSITION: usize = 0;
    /// Velocity, ENU, m/s.
    pub const VELOCITY: usize = 3;
    /// `Phi`, ENU, rad.
    pub const ATTITUDE: usize = 6;
    /// Accelerometer biases, body, m/s^2.
    pub const ACCEL: usize = 9;
    /// Gyro biases, body, rad/s.
    pub const GYRO: usize = 12;
    /// Latency of GNSS, s.
    pub const LATENCY: usize = 15;
}
