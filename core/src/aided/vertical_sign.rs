//! Whether the vertical velocity of GNSS goes the way of its heights.
//!
//! Receivers and their drivers disagree on whether up or down is positive, and a climb with the
//! wrong sign looks like a bias of the vertical accelerometer. Heights tell: of the climb that the
//! velocities add up to they show either that or its opposite.

use crate::config::Config;
use crate::math;
use crate::samples::GnssFix;
use crate::time::Time;

/// Longest time over which velocities are added up, s: heights wander.
const WINDOW_S: f64 = 30.0;
/// Longest time between two velocities that are added up, s.
const HOLE_S: f64 = 3.0;
/// Difference of log-likelihoods that decides, odds of one in 3000, and most that is kept.
const DECIDED: f64 = 8.0;
const MOST: f64 = 24.0;
/// Largest square of a height's error, in its variance, that counts: of a wrong one neither sign is
/// right, and a single one does not decide.
const ROBUST: f64 = 12.0;
/// Vertical velocities within this many sigma of zero have no sign.
const SIGMAS: f64 = 3.0;

/// Heights against vertical velocities, so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct VerticalSign {
    /// Difference of log-likelihoods of the two signs, from windows that are over.
    odds: f64,
    /// The same, of the window going on.
    open: f64,
    window: Option<Window>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Window {
    start: Time,
    height_m: f64,
    last: Time,
    last_mps: f64,
    /// What the velocities add up to.
    climbed_m: f64,
}

impl VerticalSign {
    /// Takes a fix. Variance to be added to that of its vertical velocity; none: not to be used.
    pub fn take(&mut self, fix: &GnssFix, config: &Config) -> Option<f64> {
        let up_mps = fix.velocity_up_mps?;
        // Not by this velocity: noise that makes it smaller would then count for more.
        let before_mps = self.window.map_or(up_mps, |window| window.last_mps);
        if let Some(height_m) = fix.height_m {
            self.compare(fix.time, up_mps, height_m, config);
        }
        if self.is_wrong() {
            return None;
        }
        if self.odds + self.open > DECIDED || self.window.is_none() {
            return Some(0.0);
        }
        Some(unsigned(before_mps, config))
    }

    /// Whether vertical velocities are known to have the wrong sign.
    pub fn is_wrong(&self) -> bool {
        self.odds + self.open < -DECIDED
    }

    fn compare(&mut self, time: Time, up_mps: f64, height_m: f64, config: &Config) {
        let fresh = Window {
            start: time,
            height_m,
            last: time,
            last_mps: up_mps,
            climbed_m: 0.0,
        };
        let Some(window) = &mut self.window else {
            self.window = Some(fresh);
            return;
        };
        let seconds = time.seconds_since(window.last);
        if seconds > HOLE_S {
            *window = fresh;
        } else {
            window.climbed_m += 0.5 * seconds * (up_mps + window.last_mps);
            (window.last, window.last_mps) = (time, up_mps);
            // Two heights, neither as good as is configured for sure.
            let variance = 4.0 * config.gnss.height_m.variance();
            let rise_m = height_m - window.height_m;
            let misfit = |climbed_m: f64| {
                let off_m = rise_m - climbed_m;
                math::min(off_m * off_m / variance, ROBUST)
            };
            self.open = 0.5 * (misfit(-window.climbed_m) - misfit(window.climbed_m));
        }
        if time.seconds_since(window.start) > WINDOW_S || seconds > HOLE_S {
            self.odds = math::within(self.odds + self.open, [-MOST, MOST]);
            self.open = 0.0;
            *window = fresh;
        }
    }
}

/// Variance of a vertical velocity whose sign is not known, (m/s)^2.
pub fn unsigned(up_mps: f64, config: &Config) -> f64 {
    let noise = SIGMAS * config.gnss.velocity_up_mps.white;
    let beyond = 2.0 * math::max(math::abs(up_mps) - noise, 0.0);
    beyond * beyond
}

#[cfg(test)]
#[path = "../../tests/unit/vertical_sign.rs"]
mod tests;
