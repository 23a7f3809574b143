//! An error-state Kalman filter over the core's mechanization: the baseline for the core.
//!
//! Always sixteen states: errors of position, velocity and attitude (computed minus true,
//! `C' = (I - [Phi x]) C`), residual accelerometer and gyro biases and residual GNSS latency. Further ones
//! where [`Noise`] has a prior for them: clock drift, lever arm, scale errors, and coloured noise of each
//! kind of measurement ([`Layout`]). A fix is compared with the INS of its own time ([`model`]), and
//! estimates are fed back to the nominal state ([`Nominal`]) at once. At rest there is a zero-rate update
//! by the gyros, as in the core. [`smooth`] is the smoother.

pub mod filter;
pub mod model;
pub mod noise;
pub mod nominal;
pub mod run;

pub use filter::Filter;
pub use noise::Noise;
pub use nominal::Nominal;
pub use run::{Record, Run, smooth};

use core::ops::Range;

use nalgebra::{DMatrix, DVector};

pub type States = DVector<f64>;
/// Covariance or transition matrix of the errors.
pub type StateMatrix = DMatrix<f64>;

/// Indices of the states that are always there; of vectors the first of three, ENU or right-forward-up.
pub mod index {
    pub const POSITION: usize = 0;
    pub const VELOCITY: usize = 3;
    /// `Phi`, ENU, rad.
    pub const ATTITUDE: usize = 6;
    pub const ACCEL: usize = 9;
    pub const GYRO: usize = 12;
    pub const LATENCY: usize = 15;
    pub const COUNT: usize = 16;
}

/// Kind of measurement in a fix, with a noise model of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// East and north velocity.
    Velocity,
    VelocityUp,
    /// East and north position.
    Position,
    Height,
}

impl Kind {
    /// In the order of the sequential updates.
    pub const ALL: [Self; 4] = [
        Self::Velocity,
        Self::VelocityUp,
        Self::Position,
        Self::Height,
    ];

    /// Axes of ENU.
    pub fn axes(self) -> Range<usize> {
        match self {
            Self::Velocity | Self::Position => 0..2,
            Self::VelocityUp | Self::Height => 2..3,
        }
    }

    pub fn is_velocity(self) -> bool {
        matches!(self, Self::Velocity | Self::VelocityUp)
    }

    /// States of the INS errors that it measures directly.
    pub fn states(self) -> Range<usize> {
        let first = [index::POSITION, index::VELOCITY][usize::from(self.is_velocity())];
        first + self.axes().start..first + self.axes().end
    }
}

/// Indices of the optional states; `None` where a parameter is not estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Rate of the latency, s/s.
    pub clock_drift: Option<usize>,
    /// First of three: antenna from the sensors, body, m.
    pub lever_arm: Option<usize>,
    /// First of three: scale errors of the accelerometers, body, 1.
    pub accel_scale: Option<usize>,
    /// First of three: scale errors of the gyros, body, 1.
    pub gyro_scale: Option<usize>,
    /// First of the coloured noise of each kind, in the order of [`Kind::ALL`].
    pub coloured: [Option<usize>; 4],
    pub size: usize,
}

impl Layout {
    /// States of a kind's coloured noise, in the order of its axes; none where it has none.
    pub(crate) fn coloured(&self, kind: Kind) -> Range<usize> {
        self.coloured[kind as usize].map_or(0..0, |first| first..first + kind.axes().len())
    }

    /// All states of coloured noise, each with its kind.
    pub(crate) fn coloured_states(&self) -> impl Iterator<Item = (Kind, usize)> {
        let of = |kind: Kind| self.coloured(kind).map(move |state| (kind, state));
        Kind::ALL.into_iter().flat_map(of)
    }
}

/// Product with a sparse matrix. Written out, for `nalgebra` multiplies large matrices in an order that
/// depends on the processor.
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

pub(crate) fn sigmas(covariance: &StateMatrix) -> States {
    covariance
        .diagonal()
        .map(|variance| variance.max(0.0).sqrt())
}
