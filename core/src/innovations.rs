//! Innovations: how noisy GNSS is, which fixes are credible, and whether the INS is.

use nalgebra::Vector2;

use crate::config::Noise;
use crate::math;
use crate::time::Time;

/// Shortest and longest memory of the measured noise, in fixes: first what is configured counts
/// for some, then a noise that changes from street to street is followed.
const FIRST_MEMORY: f64 = 30.0;
const LONGEST_MEMORY: f64 = 400.0;
/// Innovations beyond this many sigma weigh less (Huber); a normal one is, once in 400.
const ROBUST_SIGMAS: f64 = 3.0;
/// Innovations beyond this many sigma are refused.
const GATE_SIGMAS: f64 = 8.0;
/// So long must refused fixes agree with each other on where the INS is to be believed, s. Wrong
/// fixes come in bursts of seconds; an INS that has lost its way stays lost.
pub const AGREEING_S: f64 = 15.0;
/// An ordinary manoeuvre takes so long, s, and surprise is averaged over it.
pub const MANOEUVRE_S: f64 = 10.0;
/// Average square of the innovations, in their variances, beyond which the INS errs.
const DIVERGED_NIS: f64 = 9.0;
/// Memory of the correlation of neighbours, in fixes.
const CORRELATION_MEMORY: f64 = 200.0;
/// Fixes over which the stated noise is averaged, and range of its ratio to the average, in
/// variance.
const STATED_MEMORY: f64 = 100.0;
const STATED_RANGE: [f64; 2] = [0.1, 100.0];

/// How a fix of one kind is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GateResult {
    /// With white noise of this variance.
    Accepted(f64),
    /// Not credible.
    Rejected,
    /// Not credible, like all before it for so long that it is the INS which is wrong, by this.
    Diverged(Vector2<f64>),
}

/// Fixes refused of which most agree with each other: since when, by how many more, and the last, with
/// what had changed since the one before.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct RejectedRun {
    since: Time,
    majority: u8,
    residual: Vector2<f64>,
    change: Vector2<f64>,
}

/// Whether an innovation of this variance, all components together, is taken as it is.
pub fn is_inlier(innovation: &Vector2<f64>, total: f64) -> bool {
    innovation.norm_squared() <= ROBUST_SIGMAS * ROBUST_SIGMAS * total
}

/// Running measurement of the innovations of one kind.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Innovations {
    /// Variance of GNSS noise against the configured one, as measured.
    pub scale: f64,
    memory: f64,
    /// Variance that the receiver states, on average; zero before it does.
    stated: f64,
    /// Correlation of neighbours, and the last innovation in its sigmas.
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
    /// Judges an innovation at a moment: of `components`, with this variance of each from the INS
    /// and from GNSS noise that is not white, and with `white` noise on top.
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
        let ordinary = |residual: Vector2<f64>, fixes: f64| is_inlier(&residual, fixes * total);
        // Wrong fixes agree if the way the INS went between them explains the change, or if it runs
        // away as it did before.
        let agrees = |run: &RejectedRun| {
            let change = innovation - run.residual;
            ordinary(change, 2.0) || ordinary(change - run.change, 6.0)
        };
        let (since, majority) = match &mut self.rejected {
            Some(run) if agrees(run) => (run.since, run.majority.saturating_add(1)),
            // A wrong fix among right ones.
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

    /// How many times noisier than others a fix of this stated variance is, in variance. The scale of
    /// what is stated is not believed unless the user says so, its changes are.
    pub fn ratio_to_average(&mut self, variance: f64) -> f64 {
        if self.stated <= 0.0 {
            self.stated = variance;
        }
        let relative = math::clamp(variance / self.stated, STATED_RANGE);
        let memory = math::min(self.memory, STATED_MEMORY);
        self.stated += (relative - 1.0) * self.stated / memory;
        relative
    }

    /// Learns from an innovation that was taken: its square against its whole variance, per
    /// component, the share that white noise has of that variance, and itself in sigmas. A step of
    /// Fisher's scoring: where the INS is uncertain little is said of the noise.
    pub fn learn(&mut self, square: f64, share: f64, sigmas: &Vector2<f64>, range: [f64; 2]) {
        // A single wild innovation must not open the gate for the next.
        let bounded = math::min(square, ROBUST_SIGMAS * ROBUST_SIGMAS);
        let scale = self.scale * (1.0 + share * (bounded - 1.0) / self.memory);
        self.scale = math::clamp_variance(scale, range);
        self.memory = math::min(self.memory + share * share, LONGEST_MEMORY);
        let likeness = math::clamp(0.5 * sigmas.dot(&self.last), [-3.0, 3.0]);
        let memory = math::min(self.memory, CORRELATION_MEMORY);
        self.correlation += (likeness - self.correlation) / memory;
        self.last = *sigmas;
    }

    /// By how much the INS and fixes that agree on it differ at a moment, while these are refused,
    /// and at what rate it runs away from them, if its acceleration does not change.
    pub fn rejected_offset(&self, now: Time) -> [Vector2<f64>; 2] {
        let agreed = self.rejected.filter(|run| run.majority > 1);
        agreed.map_or_else(Default::default, |run| {
            let seconds = math::max(now.seconds_since(run.since), 1.0);
            [run.residual, run.residual * (2.0 / seconds)]
        })
    }

    /// Whether one was taken of late: such as others are held against before they are believed.
    pub fn is_recent(&self, now: Time) -> bool {
        self.last_accepted
            .is_some_and(|taken| now.seconds_since(taken) < AGREEING_S)
    }

    /// Whether there were any.
    pub fn has_learnt(&self) -> bool {
        self.memory > FIRST_MEMORY
    }

    /// Factor by which colour makes rows less informative than white ones.
    pub fn inflation(&self) -> f64 {
        let rho = math::clamp(self.correlation, [0.0, 0.9]);
        (1.0 + rho) / (1.0 - rho)
    }
}

/// How many times noisier than described a fix of this stated variance is, in variance: less only down to
/// the `least` in standard deviation, more as it says. Who says that he does not know is to be believed.
pub fn ratio_to_configured(variance: f64, noise: &Noise, least: f64) -> f64 {
    math::max(variance / noise.variance(), least * least)
}

/// How often in a row the INS was doubted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Resets {
    /// When it was last.
    pub last: Option<Time>,
    in_a_row: u8,
}

/// Time within which the next doubt shows that the last has not mended the INS, s; and such doubts in
/// a row after which nothing will.
const RESET_MEMORY_S: f64 = 60.0;
const MOST_RESETS: u8 = 3;

impl Resets {
    /// Part of it is doubted now, and mended with that.
    pub fn note(&mut self, now: Time) {
        let recently = |last: Time| now.seconds_since(last) < RESET_MEMORY_S;
        if !self.last.is_some_and(recently) {
            self.in_a_row = 0;
        }
        self.last = Some(now);
    }

    /// All of it is doubted now.
    pub fn add(&mut self, now: Time) {
        self.note(now);
        self.in_a_row = self.in_a_row.saturating_add(1);
    }

    /// Whether it has to be aligned anew.
    pub fn is_exceeded(&self) -> bool {
        self.in_a_row >= MOST_RESETS
    }
}

/// Whether innovations are, over seconds, what they should be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct NisTest {
    /// Average square, 1 where all is well.
    pub mean: f64,
    /// Time for which they have not been.
    pub exceeded_s: f64,
}

impl NisTest {
    /// Takes the square of an innovation in its variances, `seconds` after the last.
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
