//! Kinds of measurements in a fix.

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
    /// All of them, in the order of their updates.
    pub const ALL: [Self; 4] = [Self::Velocity, Self::Climb, Self::Position, Self::Height];

    /// Velocity or position.
    pub fn measured(self) -> Measured {
        match self {
            Self::Velocity | Self::Climb => Measured::Velocity,
            Self::Position | Self::Height => Measured::Position,
        }
    }

    /// Vertical, else east and north.
    pub fn is_up(self) -> bool {
        matches!(self, Self::Climb | Self::Height)
    }

    /// Configured noise of the receiver.
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
    /// Number of fixes in the mean.
    pub fixes: f64,
    /// Stated variance of one component of one fix, positive.
    pub stated_variance: Option<f64>,
    /// Additional variance.
    pub extra_variance: f64,
    /// Whether lever arm and latency apply.
    pub from_receiver: bool,
    /// Latency already compensated, s.
    pub latency_applied_s: f64,
}
