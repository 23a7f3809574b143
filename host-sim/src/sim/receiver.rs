//! Receiver behaviour beside white noise: `[gnss.habits]` of an error-model file.

use serde::{Deserialize, Serialize};

/// Correlated noise, a Gauss-Markov process.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Correlated {
    pub sigma: f64,
    pub time_s: f64,
}

impl Default for Correlated {
    fn default() -> Self {
        Self {
            sigma: 0.0,
            time_s: 1.0,
        }
    }
}

/// Content of the vertical velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Up {
    #[default]
    Given,
    Missing,
    /// Always zero.
    Zero,
    /// Vertical velocity, down positive.
    Down,
}

/// Sigmas that a receiver states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Stated {
    Nothing,
    /// That of level velocity, its white part.
    #[default]
    LevelVelocity,
    /// The white part of each.
    White,
    /// White and correlated parts.
    All,
}

/// Receiver faults, by their effect on the log.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Wrong {
    /// The velocity is zero, the position correct.
    ZeroVelocity,
    /// Offsets of velocity and position, ENU; the position also drifts with the velocity offset.
    Off {
        velocity_mps: [f64; 3],
        position_m: [f64; 3],
    },
    /// Latitude, longitude, height and velocity are zero.
    Zeros,
    /// The last fix before is repeated with new stamps.
    Stuck,
    /// Neither position nor height.
    NoPosition,
    /// Factor on white and correlated noise, which the stated sigmas do not show.
    Noisy(f64),
    /// Extrapolation with the last velocity before: a receiver that bridges a tunnel.
    Coasting,
    /// Position offset, ENU, m, and a stated sigma to match: float ambiguities.
    Float([f64; 3]),
}

/// A receiver fault in an interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trouble {
    pub start_s: f64,
    pub duration_s: f64,
    pub wrong: Wrong,
}

impl Trouble {
    pub fn contains(&self, time_s: f64) -> bool {
        (self.start_s..self.start_s + self.duration_s).contains(&time_s)
    }
}

/// Outliers: single fixes with large errors, one sigma.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outliers {
    /// Part of all fixes, 0 to 1.
    pub fraction: f64,
    pub velocity_mps: f64,
    pub position_m: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[allow(clippy::struct_excessive_bools)]
pub struct Habits {
    /// Velocity noise in addition to the white one, each component, m/s.
    pub velocity: Correlated,
    /// Noise of east and north position in addition to the white one, m.
    pub horizontal: Correlated,
    /// Noise of height in addition to the white one, m.
    pub vertical: Correlated,
    /// Whether the correlated noise of positions jumps, as satellites rise and set, instead of being
    /// Gauss-Markov; its autocorrelation is the same.
    pub position_jumps: bool,
    /// Time constant with which the receiver smooths position and velocity, s.
    pub smoothing_s: f64,
    pub smooths_position: bool,
    /// Whether velocities are differences of positions.
    pub velocity_by_differences: bool,
    /// Position hold: below this speed the position is constant and the velocity zero, m/s.
    pub holds_below_mps: f64,
    /// Antenna from the inertial sensors, body axes, m.
    pub lever_arm_m: [f64; 3],
    /// Drift of the receiver's clock against that of the inertial stamps, s/s: the latency grows.
    pub clock_drift: f64,
    /// Bounds of the delay of arrival after the stamp, s; drawn for each fix, but the order is kept.
    pub delay_s: [f64; 2],
    pub gives_position: bool,
    pub gives_height: bool,
    pub gives_velocity: bool,
    pub up: Up,
    pub stated: Stated,
    pub outliers: Outliers,
    pub troubles: Vec<Trouble>,
    /// Number of times that every fix is logged, with stamps of its own until the next.
    pub logged_times: u32,
}

impl Default for Habits {
    fn default() -> Self {
        Self {
            velocity: Correlated::default(),
            horizontal: Correlated::default(),
            vertical: Correlated::default(),
            position_jumps: false,
            smoothing_s: 0.0,
            smooths_position: true,
            velocity_by_differences: false,
            holds_below_mps: 0.0,
            lever_arm_m: [0.0; 3],
            clock_drift: 0.0,
            delay_s: [0.0; 2],
            gives_position: true,
            gives_height: true,
            gives_velocity: true,
            up: Up::Given,
            stated: Stated::LevelVelocity,
            outliers: Outliers::default(),
            troubles: Vec::new(),
            logged_times: 1,
        }
    }
}
