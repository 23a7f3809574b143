//! Whether the vertical velocity of GNSS is one, and goes the way of heights and accelerometers.
//!
//! Receivers and their drivers disagree on whether up or down is positive, and a climb with the
//! wrong sign looks like a bias of the vertical accelerometer, a heave with it like half a wave of
//! latency. Heights tell: of the climb that the velocities add up to they show either that or its
//! opposite. So does what the accelerometers feel from fix to fix.

use nalgebra::Vector3;

use super::comparison::AVERAGING_S;
use crate::config::Config;
use crate::history::PastState;
use crate::innovations::MANOEUVRE_S;
use crate::math;
use crate::samples::GnssFix;
use crate::time::Time;

/// Longest time over which velocities are added up, s: heights wander.
const WINDOW_S: f64 = 30.0;
/// Longest time between two velocities that are added up, s.
const HOLE_S: f64 = 3.0;
/// Difference of log-likelihoods that decides, odds of one in 3000, and most that is kept.
const DECIDING_ODDS: f64 = 8.0;
const MOST_ODDS: f64 = 24.0;
/// Largest square of a height's error, in its variance, that counts: of a wrong one neither sign is
/// right, and a single one does not decide.
const LARGEST_SQUARE: f64 = 12.0;
/// Changes whose square is this times that of what is not known of them are felt; and over how many of
/// them they are summed up: with more, what hardly fits better with one sign, such as swings that a receiver
/// smooths and delays, would decide.
const LEAST_SIGNAL: f64 = 9.0;
const MEMORY_CHANGES: f64 = 32.0;
/// Changes for which the noise that is configured counts as much as what is seen.
const PRIOR_CHANGES: f64 = 4.0;
/// Difference of log-likelihoods before anything is seen: of twenty receivers one has the wrong sign.
const PRIOR_ODDS: f64 = 3.0;
/// Vertical velocities that may be zero to the last bit one after the other, of a vehicle that moves: rounded to
/// a centimetre a second, one in twelve is.
const ZEROS: u8 = 3;
/// Odds from which on a velocity is used: with less it would tell a twentieth of itself, or the opposite.
const LEAST_ODDS: f64 = 0.1;

/// A fix's vertical velocity beside the INS of its moment.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ClimbSample {
    pub time: Time,
    pub up_mps: f64,
    pub ins_mps: f64,
    pub accel_mps2: f64,
    /// What a unit of each component of the antenna's arm adds to it, 1/s.
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

/// What tells of vertical velocities so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct VerticalSign {
    /// Difference of log-likelihoods of the two signs by heights, from windows that are over.
    log_odds: f64,
    /// The same, of the window going on.
    open_odds: f64,
    window: Option<Window>,
    last: Option<Last>,
    accel_test: AccelTest,
    /// How many more may be zero; before the first that is not, none.
    zeros_left: u8,
}

#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Window {
    start: Time,
    height_m: f64,
    /// What the velocities add up to.
    climbed_m: f64,
}

impl Window {
    /// Mean velocity so far, and less before it has lasted for long.
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

/// What changes of the velocity leave of those that the accelerometers feel, with either sign: sums of
/// squares, in the variance of the noise as it is configured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct AccelTest {
    changes: f64,
    if_up: f64,
    if_down: f64,
    /// Difference of log-likelihoods, of noise as strong as it turns out to be.
    log_odds: f64,
}

impl VerticalSign {
    /// Takes a fix. Variance to be added to that of its vertical velocity; none: not to be used.
    pub fn take(&mut self, fix: &GnssFix, config: &Config) -> Option<f64> {
        let up_mps = fix.velocity_up_mps?;
        // A receiver that has none writes zero. One that stands may write zeros of all.
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
        if seconds > HOLE_S {
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
        // Not by this one alone: noise that makes it smaller would then count for more. The sign of a climb is
        // that of all fixes in it: it counts once in a manoeuvre, not with each.
        let before_mps = up_mps - change_mps;
        let most = math::max(up_mps * up_mps, before_mps * before_mps);
        let climb_mps = self.window.map_or(0.0, |window| window.climb_mps(fix.time));
        let fixes = MANOEUVRE_S / math::max(seconds, AVERAGING_S);
        (sum > LEAST_ODDS).then(|| (most + climb_mps * climb_mps * fixes) * sign_factor(sum))
    }

    /// Difference of log-likelihoods.
    fn log_odds(&self) -> f64 {
        PRIOR_ODDS + self.log_odds + self.open_odds + self.accel_test.log_odds
    }

    /// Whether vertical velocities are known to have the wrong sign.
    pub fn is_wrong(&self) -> bool {
        self.log_odds() < -DECIDING_ODDS
    }

    /// Whether it is known which way is positive.
    pub fn is_known(&self) -> bool {
        math::abs(self.log_odds()) > DECIDING_ODDS
    }

    /// Takes what the accelerometers feel of a change of the climb as GNSS has it, unless they cannot tell:
    /// with a variance of the noise, and another of what changes with the motion.
    pub fn test_accel(&mut self, change_mps: f64, felt_mps: f64, noise: f64, motion_variance: f64) {
        if felt_mps * felt_mps < LEAST_SIGNAL * motion_variance {
            return;
        }
        let square = |off_mps: f64| off_mps * off_mps / (noise + motion_variance);
        let keep = 1.0 - 1.0 / MEMORY_CHANGES;
        let felt = &mut self.accel_test;
        felt.changes = keep * felt.changes + 1.0;
        felt.if_up = keep * felt.if_up + square(change_mps - felt_mps);
        felt.if_down = keep * felt.if_down + square(change_mps + felt_mps);
        let [up, down] = [felt.if_up, felt.if_down].map(|square| PRIOR_CHANGES + square);
        felt.log_odds = 0.5 * felt.changes * libm::log(down / up);
    }

    /// Holds a height against what has been climbed since that at the start of the window.
    fn test_height(&mut self, time: Time, height_m: f64, config: &Config) {
        if let Some(window) = &self.window {
            // Two heights, neither as good as is configured for sure.
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

/// Variance of a velocity at first, (m/s)^2.
pub fn sign_variance(up_mps: f64) -> f64 {
    up_mps * up_mps * sign_factor(PRIOR_ODDS)
}

/// Variance of a velocity of unknown sign in its square: the sign is `tanh(log_odds / 2)` in the mean, and the
/// rest of its mean square, one, is that of a velocity as much smaller.
fn sign_factor(log_odds: f64) -> f64 {
    // Its hyperbolic sine, to a thirtieth where they decide.
    let square = 0.25 * log_odds * log_odds;
    let times = 1.0 + square / 6.0 * (1.0 + square / 20.0 * (1.0 + square / 42.0));
    1.0 / (square * times * times)
}

#[cfg(test)]
#[path = "../../tests/unit/vertical_sign.rs"]
mod tests;
