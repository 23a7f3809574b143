//! An error-state Kalman filter over the core's mechanization: what the core is compared with.
//!
//! Sixteen errors always: position, velocity and attitude (computed minus true,
//! `C' = (I - [Phi x]) C`), what is left of accelerometer and gyro biases and of the latency of
//! GNSS in the compensated readings. Further ones where [`Noise`] says that there is something to
//! find: clock drift, lever arm, scale errors, and coloured noise of each part of a fix
//! ([`Layout`]). The parts of a fix are compared with the INS of the fix's own moment ([`seen`]),
//! and the errors found are taken out of the INS at once. At rest the gyros are read directly, as
//! in the core. [`smoother`] goes back over the log.

pub mod dynamics;
pub mod filter;
pub mod known;
pub mod layout;
pub mod noise;
pub mod run;
pub mod seen;
pub mod smoother;

pub use filter::{Correction, Filter};
pub use known::Known;
pub use layout::{Layout, Part, index};
pub use noise::{Noise, PartNoise};
pub use run::Run;
pub use smoother::{Record, Smoothed, smooth};

use nalgebra::{DMatrix, DVector};

/// One value for each error.
pub type States = DVector<f64>;
/// Covariance or transition of the errors.
pub type StateMatrix = DMatrix<f64>;

/// Product with a matrix that is mostly zero. Written out, for `nalgebra` multiplies large
/// matrices in an order that depends on the processor.
pub(crate) fn times(sparse: &StateMatrix, dense: &StateMatrix) -> StateMatrix {
    let mut entries = Vec::new();
    for (column, values) in sparse.column_iter().enumerate() {
        for (row, value) in values
            .iter()
            .enumerate()
            .filter(|(_, value)| **value != 0.0)
        {
            entries.push((row, column, *value));
        }
    }
    let mut product = StateMatrix::zeros(sparse.nrows(), dense.ncols());
    for (mut to, from) in product.column_iter_mut().zip(dense.column_iter()) {
        for (row, column, value) in &entries {
            to[*row] += value * from[*column];
        }
    }
    product
}

/// `F P F^T`.
pub(crate) fn propagated(transition: &StateMatrix, covariance: &StateMatrix) -> StateMatrix {
    let half = times(transition, covariance);
    times(transition, &half.transpose())
}

/// One sigma of each error.
pub(crate) fn sigmas(covariance: &StateMatrix) -> States {
    covariance
        .diagonal()
        .map(|variance| variance.max(0.0).sqrt())
}
