//! Multiple-model estimation of the latency: candidates with different latencies, weighed by their
//! likelihoods.
//!
//! A candidate corrects its latency by linear steps, which works only while the motion changes little
//! meanwhile; the manoeuvres of a quadrotor are over in a second. The candidates cover from a second of a
//! receiver that is late to half a second of inertial stamps that are, where only buffers make them late;
//! one further off would fit an antenna that swings the wrong way round. The result is the mean of the
//! mixture, and its variance includes the spread of the candidates. All start at one time and take the same
//! observations, each once the motion at its own time for them has been integrated. A step of work is one
//! node or one observation of one candidate.

use super::candidate::{Candidate, Found, Start};
use super::nodes::Nodes;
use super::observations::{Observation, Observations};
use crate::config::Config;
use crate::earth::wrap_pi;
use crate::math;
use crate::parameters::{Parameters, index};
use crate::time::Time;

/// Initial latencies, s, and the sigma of each: half the distance of two.
const LATENCIES_S: [f64; 3] = [0.25, -0.25, 0.75];
const LATENCY_SIGMA_S: f64 = 0.25;
/// Time before the first observation, s: every candidate must have begun.
const LEAD_S: f64 = 1.0;
/// Memory of the residuals, s.
const RESIDUAL_MEMORY_S: f64 = 10.0;
/// Bounds of the noise ratio of GNSS, in variance: velocities have a stated noise, but the wander of
/// positions within a second differs by a factor of ten between receivers.
const LARGEST_EXCESS: f32 = 400.0;
const LEAST_EXCESS: f32 = 1.0;
const LEAST_EXCESS_OF_MEANS: f32 = 0.04;
/// Gain of speed that shows that the vehicle moves, sigmas of an observation.
const MOVED_SIGMAS: f32 = 5.0;
/// Sigmas of the length of cosine and sine beyond which, with adapted noise, the start was wrong.
const LENGTH_SIGMAS: f64 = 4.0;
/// Error of that length by the scale errors of both sensors.
const LENGTH_ERROR: f64 = 0.1;

/// Sigmas to navigate on at once: within them the estimators are linear.
const ROTATION_SIGMA_RAD: f64 = 0.06;
const TILT_SIGMA_RAD: f64 = 0.05;
const FOUND_LATENCY_SIGMA_S: f64 = 0.1;
/// Time in motion after which twice as much is accepted, and so on, up to the largest factor: 0.36 rad of
/// heading, 0.3 of tilt, 0.6 s.
const PATIENCE_S: f64 = 30.0;
const LARGEST_FACTOR: f64 = 6.0;

/// The candidates.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Bank {
    start: Time,
    candidates: [Candidate; LATENCIES_S.len()],
    /// The candidate that was last worked on.
    turn: u8,
    /// Observations that all have taken.
    taken: u32,
    first: Option<Observation>,
    excess: f32,
    /// Time in motion, s.
    moving_s: f32,
    last_observation: Time,
    up_rate_radps: f32,
    /// All have taken one observation more since the last answer.
    due: bool,
    /// The likeliest at the last answer.
    leader: u8,
}

/// Mean of the mixture, and its likeliest candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Mixture {
    pub(crate) best: u8,
    /// Of the best.
    pub(crate) found: Found,
    pub(crate) rotation_sigma_rad: f64,
    pub(crate) latency_s: f64,
    pub(crate) latency_sigma_s: f64,
}

/// Result of the search so far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Answer {
    /// Not yet.
    Wait,
    /// Yes.
    Ready(Mixture),
    /// The observations do not fit: the start was wrong.
    Wrong,
}

impl Bank {
    /// Starts all at one time.
    pub(crate) fn new(start: &Start, known: &Parameters, config: &Config) -> Self {
        // One made and copied: all made would lie on the stack first.
        let mut candidates =
            [Candidate::new(start, LATENCY_SIGMA_S, known, config); LATENCIES_S.len()];
        for (candidate, latency_s) in candidates.iter_mut().zip(LATENCIES_S) {
            candidate.latency_s = math::single(latency_s);
        }
        Self {
            start: start.time,
            candidates,
            turn: 0,
            taken: 0,
            first: None,
            excess: 1.0,
            moving_s: 0.0,
            last_observation: start.time,
            up_rate_radps: math::single(start.earth_rate_radps.y),
            due: false,
            leader: 0,
        }
    }

    /// Whether GNSS has seen it move.
    pub(crate) fn has_moved(&self) -> bool {
        self.moving_s > 0.0
    }

    /// A new observation: only tests for motion, the candidates take it later.
    pub(crate) fn on_observation(&mut self, observation: &Observation, number: u32) {
        let needed_s = LEAD_S + f64::from(observation.span_s);
        if self.first.is_none() && observation.time.seconds_since(self.start) > needed_s {
            self.first = Some(*observation);
            self.taken = number;
            for candidate in &mut self.candidates {
                candidate.observation = number;
            }
        }
        if let Some(first) = &self.first {
            let gained = (observation.velocity_mps - first.velocity_mps).norm_squared();
            let least = MOVED_SIGMAS * observation.sigma_mps;
            let since_s = observation.time.seconds_since(self.last_observation);
            if gained > self.excess * least * least {
                self.moving_s += math::single(math::min(since_s, 5.0));
            }
        }
        self.last_observation = observation.time;
    }

    /// One step of work; true if there is a new answer.
    #[inline(never)]
    pub(crate) fn work(
        &mut self,
        nodes: &Nodes,
        observations: &Observations,
        known: &Parameters,
        config: &Config,
    ) -> bool {
        if self.due {
            self.due = false;
            return true;
        }
        for _ in 0..LATENCIES_S.len() {
            let last = usize::from(self.turn) + 1 == LATENCIES_S.len();
            self.turn = if last { 0 } else { self.turn + 1 };
            if self.work_on(self.turn, nodes, observations, known, config) {
                break;
            }
        }
        let all = self.candidates.iter().map(|c| c.observation).min();
        let taken = all.unwrap_or(self.taken);
        self.due = taken > self.taken && self.first.is_some();
        self.taken = taken;
        false
    }

    /// One step of one candidate, if there is any.
    fn work_on(
        &mut self,
        which: u8,
        nodes: &Nodes,
        observations: &Observations,
        known: &Parameters,
        config: &Config,
    ) -> bool {
        let leads = self.leader == which;
        let Some(candidate) = self.candidates.get_mut(usize::from(which)) else {
            return false;
        };
        let Some(node) = nodes.get(candidate.node) else {
            return false;
        };
        let next = self.first.and_then(|_| {
            if candidate.observation < observations.oldest() {
                candidate.observation = observations.oldest();
            }
            observations.get(candidate.observation)
        });
        if let Some(observation) = next {
            let seconds = candidate.seconds_to(observation.time);
            if seconds < -node.seconds() {
                candidate.observation += 1;
                return true;
            }
            if seconds < node.seconds() {
                let misfit = candidate.compare(observation, self.excess, node);
                if leads {
                    if candidate.is_degenerate() {
                        self.restart_search(known);
                    }
                    self.adapt_noise(misfit, observation);
                }
                return true;
            }
        } else if !nodes.must_advance(candidate.node) {
            return false;
        }
        candidate.advance(node, f64::from(self.up_rate_radps), config);
        true
    }

    /// Restarts all: what has misled the likeliest has misled all.
    #[inline(never)]
    fn restart_search(&mut self, known: &Parameters) {
        for candidate in &mut self.candidates {
            candidate.restart_search(known);
        }
    }

    /// Adapts the noise ratio to the residuals.
    fn adapt_noise(&mut self, misfit: f32, observation: &Observation) {
        let since_s = math::max(f64::from(observation.span_s), 0.2);
        let part = math::single(math::min(since_s / RESIDUAL_MEMORY_S, 0.5));
        // Bounded, for a single residual.
        let excess = self.excess * (1.0 + part * (math::min(misfit, 9.0) - 1.0));
        let least = if observation.span_s > 0.0 {
            LEAST_EXCESS_OF_MEANS
        } else {
            LEAST_EXCESS
        };
        self.excess = excess.clamp(least, LARGEST_EXCESS);
    }

    /// The likeliest at the last answer.
    pub(crate) fn leader(&self) -> Option<&Candidate> {
        self.candidate(self.leader)
    }

    pub(crate) fn candidate(&self, which: u8) -> Option<&Candidate> {
        self.candidates.get(usize::from(which))
    }

    /// Advances one candidate by a node, without observations; true if it did.
    pub(crate) fn catch_up(&mut self, which: u8, nodes: &Nodes, config: &Config) -> bool {
        let up_rate = f64::from(self.up_rate_radps);
        let Some(candidate) = self.candidates.get_mut(usize::from(which)) else {
            return false;
        };
        let Some(node) = nodes.get(candidate.node) else {
            return false;
        };
        candidate.advance(node, up_rate, config);
        true
    }

    /// Whether they have found enough.
    #[inline(never)]
    pub(crate) fn answer(&mut self, known: &Parameters) -> Answer {
        let mixture = self.mixture(known);
        self.leader = mixture.best;
        let is_falling = self.leader().is_some_and(|c| c.is_falling(self.start));
        if is_falling || !mixture.rotation_sigma_rad.is_finite() {
            return Answer::Wrong;
        }
        if !self.has_moved() {
            return Answer::Wait;
        }
        let factor = 1.0 + f64::from(self.moving_s) / PATIENCE_S;
        let factor = math::min(factor, LARGEST_FACTOR);
        let found = &mixture.found;
        let good = mixture.rotation_sigma_rad < factor * ROTATION_SIGMA_RAD
            && found.tilt_sigma_rad < factor * TILT_SIGMA_RAD
            && mixture.latency_sigma_s < factor * FOUND_LATENCY_SIGMA_S;
        if !good {
            return Answer::Wait;
        }
        let off = math::abs(found.length - 1.0);
        if off < LENGTH_ERROR + LENGTH_SIGMAS * found.length_sigma {
            Answer::Ready(mixture)
        } else {
            Answer::Wrong
        }
    }

    /// Mean and variance of the mixture, of the rotation about the likeliest.
    fn mixture(&self, known: &Parameters) -> Mixture {
        let all = self.candidates.each_ref().map(|candidate| {
            let found = candidate.found();
            (evidence(candidate, &found, known), found)
        });
        let [(mut top, mut found), ..] = all;
        let mut best = 0;
        for (which, (evidence, other)) in (0..).zip(&all) {
            if *evidence > top {
                (best, top, found) = (which, *evidence, *other);
            }
        }
        let (mut sum, mut turn, mut late, mut late_square) = (0.0, 0.0, 0.0, 0.0);
        for (evidence, other) in &all {
            let weight = libm::exp(evidence - top);
            let off = wrap_pi(other.rotation_rad - found.rotation_rad);
            let sigma = other.rotation_sigma_rad;
            sum += weight;
            turn += weight * (off * off + sigma * sigma);
            late += weight * other.latency_s;
            let sigma = other.latency_sigma_s;
            late_square += weight * (other.latency_s * other.latency_s + sigma * sigma);
        }
        let latency_s = late / sum;
        let variance = late_square / sum - latency_s * latency_s;
        Mixture {
            best,
            found,
            rotation_sigma_rad: math::sqrt(turn / sum),
            latency_s,
            latency_sigma_s: math::sqrt(math::max(variance, 0.0)),
        }
    }
}

/// Log prior of a latency, with long tails: what is known of it is what is usual, or was so far.
fn prior(found: &Found, known: &Parameters) -> f64 {
    let off_s = found.latency_s - known.value(index::LATENCY);
    let ratio = off_s / math::max(known.sigma(index::LATENCY), 1e-3);
    -libm::log(1.0 + ratio * ratio)
}

/// Log weight of a candidate, with the constraint on the length of its cosine and sine.
fn evidence(candidate: &Candidate, found: &Found, known: &Parameters) -> f64 {
    let off = (found.length - 1.0) / (found.length_sigma + LENGTH_ERROR);
    let unlikely = math::min(off * off, LENGTH_SIGMAS * LENGTH_SIGMAS);
    f64::from(candidate.log_likelihood) - 0.5 * unlikely + prior(found, known)
}
