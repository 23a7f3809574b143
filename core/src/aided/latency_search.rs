//! Search for a latency that periodic motion hides. The antenna of somebody who walks swings with every
//! step: latencies a period apart, or half of one with the antenna on the other side, fit almost as well as
//! the true one, and the estimators, being linear, find the nearest.
//!
//! Probes, a fix every two seconds, are compared with the INS at a row of latencies, one per step of
//! work. At each of them the *changes* between successive probes are fitted by the arm of the antenna: in
//! changes the slow errors of INS and receiver do not matter. A latency that is far more likely than all
//! beyond its surroundings, for many probes, is found.

use nalgebra::{Vector2, Vector3};

use super::compensation::LATENCY_LIMIT_S;
use crate::config::Config;
use crate::history::{History, Missing};
use crate::least_squares::LeastSquares;
use crate::math::{self, singles};
use crate::parameters::index;
use crate::samples::GnssFix;
use crate::time::Time;

/// Latencies tried, as far as they can be compensated either way, in steps short against those of somebody who
/// runs, s.
const COUNT: usize = 32;
const STEP_S: f64 = 2.0 * LATENCY_LIMIT_S / 31.0;
/// Least and longest time between two probes, s: later the INS's own error has changed.
const INTERVAL_S: f64 = 1.9;
const LONGEST_INTERVAL_S: f64 = 2.5;
/// Probes before the first verdict, for which it must stay the same, until which there must be one, and
/// their memory.
const LEAST: u16 = 40;
const LASTING: u16 = 20;
const MOST: u16 = 400;
const MEMORY: f32 = 100.0;
/// Log of the likelihood of a latency over that of others, which must not be near: what is nearer is the same
/// minimum, the estimators' to find.
const LOG_LIKELIHOOD: f32 = 12.0;
const APART_S: f64 = 0.2;
/// How near the believed one must be to be confirmed, s.
const CONFIRMED_S: f64 = 1.5 * STEP_S;
/// How much worse it must be between two minima.
const BARRIER: f32 = 1.2;
/// Prior sigma of the arm for a noise of 1 m/s, m: no more than to have one.
const ARM_M: f32 = 20.0;
/// Mean change of the specific force within a fifth of a second, m/s^2: less than that of anybody who walks, more
/// than that of what rolls.
const SHAKING_MPS2: f64 = 0.7;
/// Change of velocity beyond which a fix is an outlier, m/s: a latency that is off by half a step of
/// walking makes less.
const OUTLIER_MPS: f32 = 2.0;

/// Velocities of GNSS and INS at one latency.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Fit {
    /// Of the last probe, level: GNSS beyond the INS, m/s, and by a unit of each component of the arm, 1/s.
    beyond_mps: [f32; 2],
    swing: [[f32; 2]; 3],
    /// Arm of the antenna by the changes of these.
    arm: LeastSquares<3, 6>,
    /// What it does not explain, (m/s)^2.
    residual: f32,
}

impl Fit {
    const EMPTY: Self = Self {
        beyond_mps: [0.0; 2],
        swing: [[0.0; 2]; 3],
        arm: LeastSquares::EMPTY,
        residual: 0.0,
    };

    fn restart(&mut self) {
        self.residual = 0.0;
        self.arm = LeastSquares::EMPTY;
        self.arm.set_prior(&Vector3::repeat(ARM_M));
    }

    fn add_change(&mut self, beyond_mps: Vector2<f32>, mut swing: [[f32; 2]; 3]) {
        let change = beyond_mps - Vector2::from(self.beyond_mps);
        for (now, before) in swing.iter_mut().flatten().zip(self.swing.iter().flatten()) {
            *now -= before;
        }
        let bound = OUTLIER_MPS * OUTLIER_MPS;
        let weight = bound / math::max(change.norm_squared(), bound);
        let added = self.arm.add(&mut swing, change.into(), [weight; 2]);
        let keep = 1.0 - 1.0 / MEMORY;
        self.arm.fade(keep);
        self.residual = keep * (self.residual + added.square);
    }
}

/// A fix that is compared.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Probe {
    stamp: Time,
    velocity_mps: Vector2<f32>,
    /// Velocity gained by the controls from the INS of the next latency to that of the believed one, m/s.
    control_mps: Vector2<f32>,
    /// Latencies that have been tried.
    tried: u8,
}

/// The search.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LatencySearch {
    probe: Option<Probe>,
    /// Stamps of the last fix that might have been one, and of the probe before.
    asked: Option<Time>,
    last: Option<Time>,
    /// Changes so far.
    probes: u16,
    /// The best latency, by its number, and for how many probes it has been convincing.
    best: u8,
    convincing: u16,
    fits: [Fit; COUNT],
}

/// A latency that was found, and the arm that goes with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    pub latency_s: f64,
    /// Body, m.
    pub arm_m: Vector3<f64>,
}

impl LatencySearch {
    /// Before the first probe.
    pub const EMPTY: Self = Self {
        probe: None,
        asked: None,
        last: None,
        probes: 0,
        best: 0,
        convincing: 0,
        fits: [Fit::EMPTY; COUNT],
    };

    /// Starts again; the fits do with their next probe.
    pub fn restart(&mut self) {
        self.probe = None;
        self.last = None;
        self.probes = 0;
        self.convincing = 0;
    }

    /// Takes a fix of a moving vehicle as the next probe, if one is due and steps shake the unit.
    pub fn on_fix<const N: usize>(&mut self, fix: &GnssFix, history: &History<N>, config: &Config) {
        if (self.asked).is_some_and(|asked| fix.time.seconds_since(asked) < INTERVAL_S) {
            return;
        }
        self.asked = Some(fix.time);
        if self.probe.is_none()
            && self.probes < MOST
            && history.shaking_mps2() > SHAKING_MPS2
            && !config.is_given(index::LATENCY)
        {
            self.probe = fix.velocity_en_mps.map(|velocity_mps| Probe {
                stamp: fix.time,
                velocity_mps: velocity_mps.map(math::single),
                control_mps: Vector2::zeros(),
                tried: 0,
            });
        }
    }

    /// Whether there is work.
    pub fn is_busy(&self) -> bool {
        self.probe.is_some()
    }

    /// One step: a latency of the probe, if the ring has reached it, or the verdict after the last: the latency
    /// that is found, far from the believed one.
    #[inline(never)]
    pub fn work<const N: usize>(&mut self, history: &History<N>, believed_s: f64) -> Option<Found> {
        let probe = self.probe.as_ref()?;
        if usize::from(probe.tried) < COUNT {
            self.compare(history, believed_s);
            return None;
        }
        let follows = self.follows(probe.stamp);
        self.last = Some(probe.stamp);
        self.probe = None;
        if !follows {
            return None;
        }
        self.probes += 1;
        self.verdict(believed_s)
    }

    /// Whether a probe is near enough to the one before.
    fn follows(&self, stamp: Time) -> bool {
        self.last
            .is_some_and(|last| stamp.seconds_since(last) < LONGEST_INTERVAL_S)
    }

    fn compare<const N: usize>(&mut self, history: &History<N>, believed_s: f64) {
        let Some(mut probe) = self.probe else { return };
        let time = probe.stamp.plus_seconds(-latency_s(probe.tried));
        let reference = probe.stamp.plus_seconds(-believed_s);
        if !history.covers(reference) {
            return;
        }
        let past = match history.at(time, false) {
            Ok(past) => past,
            Err(Missing::Future) => return,
            Err(Missing::TooOld) => {
                if probe.tried > 0 {
                    // The fits would not be of the same probes.
                    self.restart();
                }
                self.probe = None;
                return;
            }
        };
        let (from, to, sign) = if probe.tried == 0 {
            (time, reference, 1.0)
        } else {
            (time.plus_seconds(-STEP_S), time, -1.0)
        };
        if let Some((span, _)) = history.next_span(from, to, f64::MAX) {
            probe.control_mps += singles(&span.control_velocity_mps).xy() * sign;
        }
        let beyond_mps = probe.velocity_mps - singles(&past.velocity_mps).xy() - probe.control_mps;
        let arms: [[f64; 3]; 3] = past.attitude_rate.into();
        let swing = arms.map(|[east, north, _]| [east, north].map(math::single));
        let follows = self.follows(probe.stamp);
        let Some(fit) = self.fits.get_mut(usize::from(probe.tried)) else {
            return;
        };
        if follows {
            fit.add_change(beyond_mps, swing);
        } else if self.last.is_none() {
            fit.restart();
        }
        (fit.beyond_mps, fit.swing) = (beyond_mps.into(), swing);
        probe.tried += 1;
        self.probe = Some(probe);
    }

    /// Residuals at those latencies.
    fn residuals(&self, among: impl Fn(f64) -> bool) -> impl Iterator<Item = f32> {
        let those = (0..)
            .zip(&self.fits)
            .filter(move |(n, _)| among(latency_s(*n)));
        those.map(|(_, fit)| fit.residual)
    }

    fn verdict(&mut self, believed_s: f64) -> Option<Found> {
        let fits = (0..).zip(&self.fits);
        let (best, fit) = fits.min_by(|(_, a), (_, b)| a.residual.total_cmp(&b.residual))?;
        let found_s = latency_s(best);
        let arm_m = fit.arm.solve().map(f64::from);
        let off_s = math::abs(found_s - believed_s);
        let is_far = off_s > APART_S && self.is_behind_barrier(found_s, believed_s);
        let convinces =
            (is_far || off_s < CONFIRMED_S) && self.is_likely(best, found_s, fit.residual);
        let stays = best.abs_diff(self.best) <= 1;
        self.best = best;
        self.convincing = match convinces {
            true if stays => self.convincing + 1,
            true => 1,
            false => 0,
        };
        if self.convincing < LASTING {
            return None;
        }
        // Found or confirmed.
        self.probes = MOST;
        is_far.then_some(Found {
            latency_s: found_s,
            arm_m,
        })
    }

    /// Whether the best latency is far more likely than those beyond its surroundings, and none of the ends.
    fn is_likely(&self, best: u8, found_s: f64, residual: f32) -> bool {
        let elsewhere = self.residuals(|other_s| math::abs(other_s - found_s) > APART_S);
        // Of two components, whose variance is that of the residual.
        let log_ratio = LOG_LIKELIHOOD / math::min(f32::from(self.probes), MEMORY);
        let ratio = 1.0 + log_ratio * (1.0 + 0.5 * log_ratio);
        self.probes >= LEAST
            && best > 0
            && usize::from(best) + 1 < COUNT
            && elsewhere.fold(f32::MAX, math::min) > ratio * residual
    }

    /// Whether the way there is worse than the believed one: else the estimators would take it themselves.
    fn is_behind_barrier(&self, found_s: f64, believed_s: f64) -> bool {
        let here = self.residuals(|own_s| math::abs(own_s - believed_s) < 1.01 * STEP_S);
        let between = self.residuals(|own_s| (own_s - believed_s) * (own_s - found_s) < 0.0);
        between.fold(0.0, math::max) > BARRIER * here.fold(f32::MAX, math::min)
    }
}

/// A latency by its number, from the longest on, s.
fn latency_s(number: u8) -> f64 {
    LATENCY_LIMIT_S - STEP_S * f64::from(number)
}

#[cfg(test)]
#[path = "../../tests/unit/latency_search.rs"]
mod tests;
