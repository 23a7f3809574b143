//! An error-state Kalman filter over the core's mechanization: what the core is compared with.
//!
//! Sixteen errors always: position, velocity and attitude (computed minus true,
//! `C' = (I - [Phi x]) C`), what is left of accelerometer and gyro biases and of the latency of
//! GNSS in the compensated readings. Further ones where [`Noise`] says that there is something to
//! find: clock drift, lever arm, scale errors, and coloured noise of each part of a fix
//! ([`Layout`]). The parts of a fix are compared with the INS of the fix's own moment ([`model`]),
//! and the errors found are taken out of the INS at once. At rest the gyros are read directly, as
//! in the core. [`smooth`] goes back over the log.

pub mod filter;
pub mod known;
pub mod model;
pub mod noise;
pub mod run;

pub use filter::Filter;
pub use known::Known;
pub use noise::Noise;
pub use run::{Record, Run, smooth};

use core::ops::Range;

use nalgebra::{DMatrix, DVector};

pub type States = DVector<f64>;
/// Covariance or transition of the errors.
pub type StateMatrix = DMatrix<f64>;

/// Errors that are always there; the first of three, ENU or right-forward-up.
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

/// A part of a fix: what comes together, with a noise of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// East and north velocity.
    Velocity,
    VelocityUp,
    /// East and north position.
    Position,
    Height,
}

impl Part {
    /// In the order in which they are taken.
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

    /// The errors of the INS that it shows directly.
    pub fn states(self) -> Range<usize> {
        let first = [index::POSITION, index::VELOCITY][usize::from(self.is_velocity())];
        first + self.axes().start..first + self.axes().end
    }
}

/// Places of the errors that may be there; `None` where nothing is unknown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Growth of the latency, s/s.
    pub clock_drift: Option<usize>,
    /// First of three: antenna from the sensors, body, m.
    pub lever_arm: Option<usize>,
    /// First of three: scale errors of the accelerometers, body, 1.
    pub accel_scale: Option<usize>,
    /// First of three: scale errors of the gyros, body, 1.
    pub gyro_scale: Option<usize>,
    /// First of the coloured noise of each part of a fix, in the order of [`Part::ALL`].
    pub colour: [Option<usize>; 4],
    pub size: usize,
}

impl Layout {
    /// Errors of a part's coloured noise, in the order of its axes; none where it has none.
    pub(crate) fn colour(&self, part: Part) -> Range<usize> {
        self.colour[part as usize].map_or(0..0, |first| first..first + part.axes().len())
    }

    /// All errors that are coloured noise, each with the part of a fix that it is in.
    pub(crate) fn coloured(&self) -> impl Iterator<Item = (Part, usize)> {
        let of = |part: Part| self.colour(part).map(move |state| (part, state));
        Part::ALL.into_iter().flat_map(of)
    }
}

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

pub(crate) fn sigmas(covariance: &StateMatrix) -> States {
    covariance
        .diagonal()
        .map(|variance| variance.max(0.0).sqrt())
}
