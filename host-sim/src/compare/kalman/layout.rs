//! Where each error stands.

use core::ops::Range;

/// Errors that are always there; the first of three, ENU or right-forward-up.
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
    /// How many there are.
    pub const COUNT: usize = 16;
}

/// A part of a fix: what comes together, with a noise of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// East and north velocity.
    Velocity,
    /// Vertical velocity.
    VelocityUp,
    /// East and north position.
    Position,
    /// Height.
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

    /// Whether it is of the velocity.
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
    /// How many errors there are.
    pub size: usize,
}

impl Layout {
    /// First error of a part's coloured noise.
    pub fn colour(&self, part: Part) -> Option<usize> {
        self.colour[part as usize]
    }
}
