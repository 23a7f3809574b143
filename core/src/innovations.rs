//! Innovations: noise of GNSS, gate, and divergence of the INS.

use nalgebra::Vector2;

use crate::config::Noise;
use crate::math;
use crate::time::Time;

/// Shortest and longest memory of the noise estimate, in fixes: at first the configured noise counts, later
/// changes from street to street are followed.
const FIRST_MEMORY: f64 = 30.0;
const LONGEST_MEMORY: f64 = 400.0;
/// Beyond this many sigmas innovations weigh less (Huber): normal ones once in 400.
const ROBUST_SIGMAS: f64 = 3.0;
/// Gate, sigmas.
const GATE_SIGMAS: f64 = 8.0;
/// Time for which refused fixes must agree until the INS is wrong, s: outliers come in bursts of seconds,
/// and a diverged INS stays so.
pub const AGREEING_S: f64 = 15.0;
/// Duration of an ordinary manoeuvre, s, over which the NIS is averaged.
pub const MANOEUVRE_S: f64 = 10.0;
/// Mean NIS beyond which the INS has diverged.
const DIVERGED_NIS: f64 = 9.0;
/// Memory of the correlation of successive innovations, in fixes.
const CORRELATION_MEMORY: f64 = 200.0;
/// Fixes over which the stated variance is averaged, and bounds of its ratio to the average.
const STATED_MEMORY: f64 = 100.0;
const STATED_RANGE: [f64; 2] = [0.1, 100.0];

/// Result of the gate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GateResult {
    /// With this variance of the white noise, larger beyond the robust threshold.
    Accepted(f64),
    /// An outlier.
    Rejected,
    /// One of a run of refused fixes so long that the INS is wrong, by this.
    Diverged(Vector2<f64>),
}

/// Run of refused fixes of which most agree: since when, by what majority, and the last, with its change.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct RejectedRun {
    since: Time,
    majority: u8,
    residual: Vector2<f64>,
    change: Vector2<f64>,
}

/// Whether an innovation of this variance, of all components, is within the robust threshold.
pub fn is_inlier(innovation: &Vector2<f64>, total: f64) -> bool {
    innovation.norm_squared() <= ROBUST_SIGMAS * ROBUST_SIGMAS * total
}

/// Statistics of the innovations of one kind.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Innovations {
    /// Measured variance of GNSS noise over the configured one.
    pub scale: f64,
    memory: f64,
    /// Mean stated variance; zero before the first.
    stated: f64,
    /// Correlation of successive innovations, and the last one, normalized.
    correlation: f64,
    last: Vector2<f64>,
    last_accepted: Option<Time>,
    rejected: Option<RejectedRun>,
}

impl Default for Innovations {
    fn default() -> Self {
        Self {
            scale: 1.0,
            memory: FIRST_MEMORY,
            stated: 0.0,
            correlation: 0.0,
            last: Vector2::zeros(),
            last_accepted: None,
            rejected: None,
        }
    }
}

impl Innovations {
    /// Gate of an innovation of `components`, given per component the variance `predicted`, with correlated
    /// noise, and that of `white` noise.
    pub fn gate(
        &mut self,
        now: Time,
        innovation: &Vector2<f64>,
        components: f64,
        predicted: f64,
        white: f64,
    ) -> GateResult {
        let total = components * (predicted + white);
        let power = innovation.norm_squared();
        if power <= GATE_SIGMAS * GATE_SIGMAS * total {
            self.rejected = None;
            self.last_accepted = Some(now);
            let beyond = math::max(math::sqrt(power / total) / ROBUST_SIGMAS, 1.0);
            return GateResult::Accepted(white * beyond * beyond);
        }
        let inlier = |residual: Vector2<f64>, fixes: f64| is_inlier(&residual, fixes * total);
        // Refused fixes agree if the INS, unchanged or diverging at an even rate, explains their change.
        let agrees = |run: &RejectedRun| {
            let change = innovation - run.residual;
            inlier(change, 2.0) || inlier(change - run.change, 6.0)
        };
        let (since, majority) = match &mut self.rejected {
            Some(run) if agrees(run) => (run.since, run.majority.saturating_add(1)),
            // An outlier within the run.
            Some(run) if run.majority > 1 => {
                run.majority -= 1;
                return GateResult::Rejected;
            }
            _ => (now, 1),
        };
        let before = self.rejected.map_or(*innovation, |run| run.residual);
        self.rejected = Some(RejectedRun {
            since,
            majority,
            residual: *innovation,
            change: innovation - before,
        });
        if now.seconds_since(since) < AGREEING_S {
            return GateResult::Rejected;
        }
        self.rejected = None;
        GateResult::Diverged(*innovation)
    }

    /// Ratio of a stated variance to its average: only its changes are used, unless the user trusts its
    /// scale.
    pub fn ratio_to_average(&mut self, variance: f64) -> f64 {
        if self.stated <= 0.0 {
            self.stated = variance;
        }
        let relative = math::clamp(variance / self.stated, STATED_RANGE);
        let memory = math::min(self.memory, STATED_MEMORY);
        self.stated += (relative - 1.0) * self.stated / memory;
        relative
    }

    /// Scoring step by an accepted innovation: its normalized square per component, the share of white
    /// noise in its variance, and itself, normalized. Where the INS is uncertain it says little of the
    /// noise.
    pub fn learn(&mut self, square: f64, share: f64, sigmas: &Vector2<f64>, range: [f64; 2]) {
        // One outlier must not open the gate for the next.
        let bounded = math::min(square, ROBUST_SIGMAS * ROBUST_SIGMAS);
        let scale = self.scale * (1.0 + share * (bounded - 1.0) / self.memory);
        self.scale = math::clamp_variance(scale, range);
        self.memory = math::min(self.memory + share * share, LONGEST_MEMORY);
        let lag_product = math::clamp(0.5 * sigmas.dot(&self.last), [-3.0, 3.0]);
        let memory = math::min(self.memory, CORRELATION_MEMORY);
        self.correlation += (lag_product - self.correlation) / memory;
        self.last = *sigmas;
    }

    /// Difference of the INS from fixes that agree while they are refused, and its rate of change under a
    /// constant acceleration.
    pub fn rejected_offset(&self, now: Time) -> [Vector2<f64>; 2] {
        let agreed = self.rejected.filter(|run| run.majority > 1);
        agreed.map_or_else(Default::default, |run| {
            let seconds = math::max(now.seconds_since(run.since), 1.0);
            [run.residual, run.residual * (2.0 / seconds)]
        })
    }

    /// Whether one was accepted of late.
    pub fn is_recent(&self, now: Time) -> bool {
        self.last_accepted
            .is_some_and(|last| now.seconds_since(last) < AGREEING_S)
    }

    /// Whether there were any.
    pub fn has_data(&self) -> bool {
        self.memory > FIRST_MEMORY
    }

    /// Inflation of the variance of estimates by the correlation of innovations.
    pub fn inflation(&self) -> f64 {
        let rho = math::clamp(self.correlation, [0.0, 0.9]);
        (1.0 + rho) / (1.0 - rho)
    }
}

/// Ratio of a stated variance to the configured one; a smaller one counts down to `least` in standard
/// deviation, a larger one always: a receiver that states to be worse is.
pub fn ratio_to_configured(variance: f64, noise: &Noise, least: f64) -> f64 {
    math::max(variance / noise.variance(), least * least)
}

/// Successive resets of the INS.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Resets {
    /// Time of the last.
    pub last: Option<Time>,
    in_a_row: u8,
}

/// Time within which another reset shows that the last has not helped, s; and how many of them lead to a
/// new alignment.
const RESET_MEMORY_S: f64 = 60.0;
const MOST_RESETS: u8 = 3;

impl Resets {
    /// A reset of a part.
    pub fn note(&mut self, now: Time) {
        let recently = |last: Time| now.seconds_since(last) < RESET_MEMORY_S;
        if !self.last.is_some_and(recently) {
            self.in_a_row = 0;
        }
        self.last = Some(now);
    }

    /// A reset of all.
    pub fn add(&mut self, now: Time) {
        self.note(now);
        self.in_a_row = self.in_a_row.saturating_add(1);
    }

    /// Whether it needs a new alignment.
    pub fn is_exceeded(&self) -> bool {
        self.in_a_row >= MOST_RESETS
    }
}

/// Time average of the normalized innovation squared (NIS).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct NisTest {
    /// Mean, 1 if consistent.
    pub mean: f64,
    /// Time for which it was too large.
    pub exceeded_s: f64,
}

impl NisTest {
    /// Adds the NIS of an innovation, `seconds` after the last.
    pub fn add(&mut self, square: f64, seconds: f64) {
        let bounded = math::min(square, GATE_SIGMAS * GATE_SIGMAS);
        self.mean += (bounded - self.mean) * seconds / (seconds + MANOEUVRE_S);
        if self.mean > DIVERGED_NIS {
            self.exceeded_s += seconds;
        } else {
            self.exceeded_s = 0.0;
        }
    }
}

#[cfg(test)]
#[path = "../tests/unit/innovations.rs"]
mod tests;
