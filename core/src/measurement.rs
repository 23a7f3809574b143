//! What a fix measures, kind by kind.

use nalgebra::Vector3;

use crate::channel::Measured;
use crate::config::{Config, Noise};

/// One kind of measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Kind {
    /// Velocity east and north.
    Velocity,
    /// Vertical velocity.
    Climb,
    /// Position east and north.
    Position,
    /// Height.
    Height,
}

impl Kind {
    /// All of them, in the order in which they are taken.
    pub const ALL: [Self; 4] = [Self::Velocity, Self::Climb, Self::Position, Self::Height];

    /// Velocity or position.
    pub fn measured(self) -> Measured {
        match self {
            Self::Velocity | Self::Climb => Measured::Velocity,
            Self::Position | Self::Height => Measured::Position,
        }
    }

    /// Up, else east and north.
    pub fn is_up(self) -> bool {
        matches!(self, Self::Climb | Self::Height)
    }

    /// What the receiver is configured to have of it.
    pub fn noise(self, config: &Config) -> &Noise {
        let gnss = &config.gnss;
        match self {
            Self::Velocity => &gnss.velocity_mps,
            Self::Climb => &gnss.velocity_up_mps,
            Self::Position => &gnss.position_m,
            Self::Height => &gnss.height_m,
        }
    }
}

/// INS minus GNSS of one kind, ENU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// m/s or m.
    pub value: Vector3<f64>,
    /// How many fixes it is the mean of.
    pub fixes: f64,
    /// Variance of one component of one fix as the receiver states it, positive.
    pub stated_variance: Option<f64>,
    /// Variance that it has on top.
    pub extra_variance: f64,
    /// Whether it is of an antenna and by the receiver's clock.
    pub from_receiver: bool,
    /// Latency already taken out by the choice of the moment, s.
    pub latency_applied_s: f64,
}
