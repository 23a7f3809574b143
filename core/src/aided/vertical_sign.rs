//! Sign of the GNSS vertical velocity, and whether there is one.
//!
//! Receivers and drivers differ in whether up or down is positive. The wrong sign makes a climb look like a
//! vertical accelerometer bias, and a heave like half a wave of latency. Likelihoods of the sign come from
//! heights against the integrated velocity, and from changes of the velocity against the accelerometers.

use nalgebra::Vector3;

use super::comparison::AVERAGING_S;
use crate::config::Config;
use crate::history::PastState;
use crate::innovations::MANOEUVRE_S;
use crate::math;
use crate::samples::GnssFix;
use crate::time::Time;

/// Longest time of integration, s: heights wander.
const WINDOW_S: f64 = 30.0;
/// Longest interval between two velocities that are integrated, s.
const LONGEST_INTERVAL_S: f64 = 3.0;
/// Log odds that decide, one in 3000, and their bound.
const DECIDING_ODDS: f64 = 8.0;
const MOST_ODDS: f64 = 24.0;
/// Bound on the normalized square of a height's residual: of an outlier neither sign is right, and one must
/// not decide.
const LARGEST_SQUARE: f64 = 12.0;
/// Changes are used whose square is this times the variance of what the motion leaves unknown; and memory,
/// in changes: with a longer one, a slightly better fit, as of swings that a receiver smooths and delays,
/// would decide.
const LEAST_SIGNAL: f64 = 9.0;
const MEMORY_CHANGES: f64 = 32.0;
/// Changes for which the configured noise counts as much as the residuals.
const PRIOR_CHANGES: f64 = 4.0;
/// Prior log odds: one receiver in twenty has the wrong sign.
const PRIOR_ODDS: f64 = 3.0;
/// Exact zeros in a row that a moving vehicle's vertical velocity may have: rounded to a centimetre a
/// second, one in twelve is.
const ZEROS: u8 = 3;
/// Log odds from which on a velocity is used: with less its gain would be below a twentieth, or negative.
const LEAST_ODDS: f64 = 0.1;

/// Vertical velocity of a fix beside the INS of its time.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ClimbSample {
    pub time: Time,
    pub up_mps: f64,
    pub ins_mps: f64,
    pub accel_mps2: f64,
    /// Partial by each component of the lever arm, 1/s.
    pub swing: Vector3<f64>,
}

impl ClimbSample {
    pub fn of(past: &PastState, up_mps: f64) -> Self {
        Self {
            time: past.time,
            up_mps,
            ins_mps: past.velocity_mps.z,
            accel_mps2: past.accel_mps2.z,
            swing: past.attitude_rate.row(2).transpose(),
        }
    }
}

/// State of the sign test.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct VerticalSign {
    /// Log odds by heights, of the windows so far.
    log_odds: f64,
    /// The same, of the present window.
    open_odds: f64,
    window: Option<Window>,
    last: Option<Last>,
    accel_test: AccelTest,
    /// Zeros still allowed; none before the first other value.
    zeros_left: u8,
}

#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Window {
    start: Time,
    height_m: f64,
    /// Integrated velocity.
    climbed_m: f64,
}

impl Window {
    /// Mean velocity so far, and less in a short window.
    fn climb_mps(&self, now: Time) -> f64 {
        self.climbed_m / math::max(now.seconds_since(self.start), MANOEUVRE_S)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Last {
    time: Time,
    up_mps: f64,
}

/// Sums of squared residuals of velocity changes against the accelerometers, for either sign, in the
/// configured variance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct AccelTest {
    changes: f64,
    if_up: f64,
    if_down: f64,
    /// Log odds, with the variance estimated by the residuals.
    log_odds: f64,
}

impl VerticalSign {
    /// Takes a fix. Variance to be added to its vertical velocity; none: not to be used.
    pub fn take(&mut self, fix: &GnssFix, config: &Config) -> Option<f64> {
        let up_mps = fix.velocity_up_mps?;
        // Receivers without one write zero. At rest all may be zero.
        let is_zero = |mps: f64| math::abs(mps) <= 0.0;
        let stands = fix
            .velocity_en_mps
            .is_some_and(|level| level.iter().copied().all(is_zero));
        if !is_zero(up_mps) {
            self.zeros_left = ZEROS;
        } else if !stands {
            self.zeros_left = self.zeros_left.checked_sub(1)?;
        }
        let now = Last {
            time: fix.time,
            up_mps,
        };
        let last = self.last.replace(now);
        let change_mps = last.map_or(0.0, |last| up_mps - last.up_mps);
        let seconds = last.map_or(0.0, |last| fix.time.seconds_since(last.time));
        if seconds > LONGEST_INTERVAL_S {
            self.close();
        } else if let Some(window) = &mut self.window {
            window.climbed_m += seconds * (up_mps - 0.5 * change_mps);
        }
        if let Some(height_m) = fix.height_m {
            self.test_height(fix.time, height_m, config);
        }
        let sum = self.log_odds();
        if sum > DECIDING_ODDS {
            return Some(0.0);
        }
        // The larger of two: noise that makes one smaller would raise its weight. The sign is common to all
        // fixes of a climb: it counts once per manoeuvre.
        let before_mps = up_mps - change_mps;
        let most = math::max(up_mps * up_mps, before_mps * before_mps);
        let climb_mps = self.window.map_or(0.0, |window| window.climb_mps(fix.time));
        let fixes = MANOEUVRE_S / math::max(seconds, AVERAGING_S);
        (sum > LEAST_ODDS).then(|| (most + climb_mps * climb_mps * fixes) * sign_factor(sum))
    }

    /// Log odds of the right sign.
    fn log_odds(&self) -> f64 {
        PRIOR_ODDS + self.log_odds + self.open_odds + self.accel_test.log_odds
    }

    /// Whether the sign is known to be wrong.
    pub fn is_wrong(&self) -> bool {
        self.log_odds() < -DECIDING_ODDS
    }

    /// Whether the sign is known.
    pub fn is_known(&self) -> bool {
        math::abs(self.log_odds()) > DECIDING_ODDS
    }

    /// Adds a velocity change of GNSS beside that of the accelerometers, unless it is too small: with the
    /// variance of the noise, and of what the motion leaves unknown.
    pub fn test_accel(
        &mut self,
        change_mps: f64,
        ins_change_mps: f64,
        noise: f64,
        motion_variance: f64,
    ) {
        if ins_change_mps * ins_change_mps < LEAST_SIGNAL * motion_variance {
            return;
        }
        let square = |off_mps: f64| off_mps * off_mps / (noise + motion_variance);
        let keep = 1.0 - 1.0 / MEMORY_CHANGES;
        let felt = &mut self.accel_test;
        felt.changes = keep * felt.changes + 1.0;
        felt.if_up = keep * felt.if_up + square(change_mps - ins_change_mps);
        felt.if_down = keep * felt.if_down + square(change_mps + ins_change_mps);
        let [up, down] = [felt.if_up, felt.if_down].map(|square| PRIOR_CHANGES + square);
        felt.log_odds = 0.5 * felt.changes * libm::log(down / up);
    }

    /// Tests a height against the integrated velocity of the window.
    fn test_height(&mut self, time: Time, height_m: f64, config: &Config) {
        if let Some(window) = &self.window {
            // Two heights, each perhaps noisier than configured.
            let variance = 4.0 * config.gnss.height_m.variance();
            let rise_m = height_m - window.height_m;
            let misfit = |climbed_m: f64| {
                let off_m = rise_m - climbed_m;
                math::min(off_m * off_m / variance, LARGEST_SQUARE)
            };
            self.open_odds = 0.5 * (misfit(-window.climbed_m) - misfit(window.climbed_m));
            if time.seconds_since(window.start) > WINDOW_S {
                self.close();
            }
        }
        self.window.get_or_insert(Window {
            start: time,
            height_m,
            climbed_m: 0.0,
        });
    }

    /// Ends the window.
    fn close(&mut self) {
        self.log_odds = math::clamp(self.log_odds + self.open_odds, [-MOST_ODDS, MOST_ODDS]);
        self.open_odds = 0.0;
        self.window = None;
    }
}

/// Variance of a velocity by the prior odds of its sign, (m/s)^2.
pub fn sign_variance(up_mps: f64) -> f64 {
    up_mps * up_mps * sign_factor(PRIOR_ODDS)
}

/// Variance of a velocity of unknown sign, over its square: the mean of the sign is `tanh(log_odds / 2)`,
/// that of its square one; as a measurement divided by that mean.
fn sign_factor(log_odds: f64) -> f64 {
    // Hyperbolic sine, to a thirtieth where it matters.
    let square = 0.25 * log_odds * log_odds;
    let times = 1.0 + square / 6.0 * (1.0 + square / 20.0 * (1.0 + square / 42.0));
    1.0 / (square * times * times)
}

#[cfg(test)]
#[path = "../../tests/unit/vertical_sign.rs"]
mod tests;
