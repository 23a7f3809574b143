//! Innovations: how noisy they are, which are credible, and whether they are white.

use nalgebra::Vector2;

use crate::math;

/// Longest memory of the measured noise, in fixes.
const NOISE_MEMORY: f32 = 400.0;
/// Fixes over which the likeness of neighbouring innovations is averaged: white ones then show
/// 0 +- 0.07.
const LIKENESS_MEMORY: f64 = 100.0;
/// Average likeness that is put up with.
const LIKENESS_TOLERATED: f64 = 0.1;
/// Steps of the logarithm of the roughness per fix and unit of likeness: fast up, slowly down.
const ROUGHNESS_RISE: f64 = 0.03;
const ROUGHNESS_FALL: f64 = 0.005;
const MAX_ROUGHNESS: f64 = 1e4;
/// Fixes over which the noise that receivers state is averaged, and range of its ratio to the
/// average, in variance.
const STATED_MEMORY: f64 = 100.0;
const STATED_RANGE: [f64; 2] = [0.1, 100.0];
/// Innovations beyond this many sigma weigh less (Huber).
const ROBUST_SIGMAS: f64 = 3.0;
/// So many of these in a row are a step of the INS, not noise of GNSS.
const STEP_FIXES: u32 = 5;
/// Innovations beyond this many sigma, plus `GATE_MPS`, are refused.
const GATE_SIGMAS: f64 = 8.0;
const GATE_MPS: f64 = 3.0;
/// GNSS noise is at least this part of what it is configured to be.
const LEAST_NOISE: f64 = 0.1;

/// Running measurement of the innovations of one kind.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Innovations {
    variance: f64,
    least_variance: f64,
    /// Correlation of neighbours.
    correlation: f64,
    count: f32,
    /// Innovations in a row beyond `ROBUST_SIGMAS`.
    beyond: u32,
    /// The one before, per component of a fix as noisy as others.
    last: Vector2<f64>,
}

impl Innovations {
    /// Believes the configured noise at first, m/s.
    pub fn new(sigma_mps: f64) -> Self {
        let least = LEAST_NOISE * sigma_mps;
        Self {
            variance: sigma_mps * sigma_mps,
            least_variance: least * least,
            correlation: 0.0,
            count: 30.0,
            beyond: 0,
            last: Vector2::zeros(),
        }
    }

    /// Variance of the measurement noise for an innovation of this square, (m/s)^2, where the INS
    /// itself makes `predicted` of the variance and the fix is `relative` times as noisy as others:
    /// larger where it counts for less. `None` if the innovation is not credible.
    pub fn noise(&self, power: f64, predicted: f64, relative: f64) -> Option<f64> {
        let total = relative * self.variance + predicted;
        let noise = math::max(self.variance - predicted, 0.5 * self.variance);
        let noise = relative * math::max(noise, self.least_variance);
        if !is_wild(power, total) {
            return Some(noise);
        }
        let (size, sigma) = (math::sqrt(power), math::sqrt(total));
        let credible = size <= GATE_SIGMAS * sigma + GATE_MPS;
        credible.then_some(noise * size / (ROBUST_SIGMAS * sigma))
    }

    /// Variance of a step that the INS has made, (m/s)^2, if this innovation is one more of many
    /// that neither the noise nor what the INS makes of it explains; arguments as above.
    pub fn step(&mut self, power: f64, predicted: f64, relative: f64) -> f64 {
        let total = relative * self.variance + predicted;
        self.beyond = if is_wild(power, total) {
            self.beyond + 1
        } else {
            0
        };
        if self.beyond < STEP_FIXES {
            return 0.0;
        }
        self.beyond = 0;
        power
    }

    /// Takes one innovation of `components` (1 or 2) components from a fix `relative` times as
    /// noisy as others. Returns how alike it and the one before are: on average 0 for white ones.
    ///
    /// The noise is measured from the difference of the two: what they share is not noise of GNSS
    /// but an error of the INS, which must not make the fixes that show it count for less.
    pub fn measure(&mut self, innovation: &Vector2<f64>, components: f64, relative: f64) -> f64 {
        let innovation = innovation / math::sqrt(components * relative);
        if self.count < NOISE_MEMORY {
            self.count += 1.0;
        }
        let count = f64::from(self.count);
        let change = 0.5 * (innovation - self.last).norm_squared();
        // A single wild innovation must not open the gate for the next.
        let bounded = math::min(change, 9.0 * self.variance);
        self.variance += (bounded - self.variance) / count;
        let likeness = innovation.dot(&self.last) / self.variance;
        let likeness = math::max(math::min(likeness, 3.0), -3.0);
        self.correlation += (likeness - self.correlation) / count;
        self.last = innovation;
        likeness
    }

    /// Factor by which colour makes rows less informative than white ones.
    pub fn inflation(&self) -> f64 {
        let rho = math::max(math::min(self.correlation, 0.9), 0.0);
        (1.0 + rho) / (1.0 - rho)
    }
}

/// Whether an innovation of this square lies beyond what its whole variance explains.
fn is_wild(power: f64, total: f64) -> bool {
    power > ROBUST_SIGMAS * ROBUST_SIGMAS * total
}

/// The noise that the receiver states, on average. Its scale is not believed, its changes are.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct StatedNoise {
    variance: f64,
}

impl StatedNoise {
    /// How many times noisier a fix of this stated sigma, m/s, is than others, in variance.
    pub fn relative(&mut self, sigma_mps: Option<f64>) -> f64 {
        let Some(sigma) = sigma_mps.filter(|sigma| *sigma > 0.0) else {
            return 1.0;
        };
        let variance = sigma * sigma;
        if self.variance <= 0.0 {
            self.variance = variance;
        }
        let [least, most] = STATED_RANGE;
        let relative = math::max(math::min(variance / self.variance, most), least);
        self.variance += (relative - 1.0) * self.variance / STATED_MEMORY;
        relative
    }
}

/// How much rougher the gyros are than their noise makes them.
///
/// Likeness of neighbouring innovations means that the INS errs by more than the noise of its
/// gyros (vibration, misalignment, sensitivity to g): the observer has to follow faster.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Roughness {
    /// Average likeness of neighbours.
    likeness: f64,
    factor: f64,
}

impl Default for Roughness {
    fn default() -> Self {
        Self {
            likeness: 0.0,
            factor: 1.0,
        }
    }
}

impl Roughness {
    /// Factor by which the tilt walks more than the noise of the gyros makes it, in variance.
    pub fn factor(&self) -> f64 {
        self.factor
    }

    /// Takes the likeness of one more innovation to the one before.
    pub fn learn(&mut self, likeness: f64) {
        self.likeness += (likeness - self.likeness) / LIKENESS_MEMORY;
        let excess = self.likeness - LIKENESS_TOLERATED;
        let gain = if excess > 0.0 {
            ROUGHNESS_RISE
        } else {
            ROUGHNESS_FALL
        };
        let factor = self.factor * (1.0 + gain * excess);
        self.factor = math::max(math::min(factor, MAX_ROUGHNESS), 1.0);
    }
}
