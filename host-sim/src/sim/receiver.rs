//! What receivers do beside white noise: an error-model file may say so in `[gnss.habits]`.

use serde::{Deserialize, Serialize};

/// Noise with a memory, a Gauss-Markov process.
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

/// What stands where vertical velocity should.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Up {
    #[default]
    Given,
    Missing,
    /// Zero, whatever it is.
    Zero,
    /// Vertical velocity, down positive.
    Down,
}

/// The noise that a receiver says its fixes have.
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

/// What a row of the log is filled with while something is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Wrong {
    /// The velocity is zero, the position goes on.
    ZeroVelocity,
    /// Velocity and position are off by so much, ENU, and the position by more every second.
    Off {
        velocity_mps: [f64; 3],
        position_m: [f64; 3],
    },
    /// Latitude, longitude, height and velocity are zero.
    Zeros,
    /// The last fix before goes on under new stamps.
    Stuck,
    /// Neither position nor height.
    NoPosition,
    /// Noise, white and correlated, is so many times what it is elsewhere; the stated one is not.
    Noisy(f64),
    /// The last velocity before goes on, and the position with it: a receiver that bridges a tunnel.
    Coasting,
    /// The position is off by so much, ENU, m, and as much is stated: ambiguities are not fixed.
    Float([f64; 3]),
}

/// A time at which something is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trouble {
    pub start_s: f64,
    pub duration_s: f64,
    pub wrong: Wrong,
}

impl Trouble {
    pub fn holds(&self, time_s: f64) -> bool {
        (self.start_s..self.start_s + self.duration_s).contains(&time_s)
    }
}

/// Single fixes far off.
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
    /// Velocity noise on top of the white one, each component, m/s.
    pub velocity: Correlated,
    /// Noise of east and north position on top of the white one, m.
    pub horizontal: Correlated,
    /// Noise of height on top of the white one, m.
    pub vertical: Correlated,
    /// Whether the noise of positions jumps from value to value, as satellites come and go, instead
    /// of wandering; what it remembers is the same.
    pub position_jumps: bool,
    /// Time constant with which the receiver smooths position and velocity, s.
    pub smoothing_s: f64,
    pub smooths_position: bool,
    /// Whether a velocity is the way from the last position, by the time between.
    pub velocity_by_differences: bool,
    /// Slower than this the position stands still and the velocity is zero, m/s.
    pub holds_below_mps: f64,
    /// Antenna from the inertial sensors, body axes, m.
    pub lever_arm_m: [f64; 3],
    /// What the receiver's clock gains on that of the inertial stamps, s/s: the latency grows.
    pub clock_drift: f64,
    /// How much later than its stamp a fix arrives, s; drawn anew for each, but none overtakes.
    pub delay_s: [f64; 2],
    pub gives_position: bool,
    pub gives_height: bool,
    pub gives_velocity: bool,
    pub up: Up,
    pub stated: Stated,
    pub outliers: Outliers,
    pub troubles: Vec<Trouble>,
    /// Every fix is logged so often, under stamps of its own until the next.
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
