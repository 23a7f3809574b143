//! Strength of the correlated part of GNSS noise, by maximum likelihood of the innovations.
//!
//! If it is assumed too weak, it is tracked too slowly, and innovations are correlated and too large. The
//! score needs the derivatives of the innovation's variance and of the prediction by the noise. For one
//! measured sum, predicted with variance `T` and measured with `R`, both follow from the update
//! `T R / (T + R)` and the gain `T / (T + R)` (sensitivity equations: Gupta and Mehra, IEEE TAC 19, 1974),
//! and each innovation gives a step of Fisher's scoring. This finds the noise whatever INS error and
//! parameters converge to, where the estimated noise state, which shares what it holds with them, does not.
//! Heights are learnt so; velocities and level positions from the noise state, which is slower: the error
//! of an INS whose unit was turned during a gap must not pass for noise.

use nalgebra::Vector2;

use crate::channel::Markov;
use crate::config::Noise;
use crate::math;
use crate::time::Time;

/// Information about the logarithm of variance or correlation time: of the prior, so that a factor of four
/// in the standard deviation, by which receivers differ, is two sigmas; and the most remembered, good to a
/// sixth.
const PRIOR_INFORMATION: f64 = 0.5;
const REMEMBERED: f64 = 10.0;
/// A mean over so many correlation times is an INS error and no noise.
const SLOW: f64 = 10.0;
/// Bound on the normalized square of an estimate.
const LARGEST_SQUARE: f64 = 9.0;
/// Bound on the step of that logarithm per fix, against outliers.
const LARGEST_STEP: f64 = 0.1;

/// Strength of the correlated part of one kind of noise.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ColouredNoise {
    /// Variance over the configured one: beside a white part as configured, and beside that as learnt.
    pub ratio: f64,
    pub strength: f64,
    information: f64,
    last: Time,
    /// Slow part of its estimate.
    slow_mean: Vector2<f64>,
}

/// Correlation time over the configured one, at the same `sigma^2 / tau`: that is what innovations tell
/// within seconds, and how far it wanders what they tell in minutes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CorrelationTime {
    pub ratio: f64,
    information: f64,
    sensitivity: FilterSensitivity,
}

/// Derivatives of the predicted measurement and of its variance by the logarithm of a noise parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FilterSensitivity {
    variance: f64,
    predicted: Vector2<f64>,
}

impl FilterSensitivity {
    /// Time update with a Gauss-Markov step.
    pub fn propagate(&mut self, step: &Markov) {
        self.variance = step.decay * step.decay * self.variance + step.variance;
        self.predicted *= step.decay;
    }

    /// Measurement update, with the innovation's variance per component, `white` of it white noise.
    pub fn update(&mut self, innovation: &Vector2<f64>, total: f64, white: f64) {
        let kept = white / total;
        let gain = kept * self.variance / total;
        self.predicted = self.predicted * kept + innovation * gain;
        self.variance *= kept * kept;
    }

    /// Scoring step of that logarithm by an innovation, before its measurement update.
    fn step(
        &self,
        information: &mut f64,
        innovation: &Vector2<f64>,
        components: f64,
        total: f64,
    ) -> f64 {
        let share = self.variance / total;
        let square = innovation.norm_squared() / total;
        let score = self.predicted.dot(innovation) / total + 0.5 * share * (square - components);
        let new = self.predicted.norm_squared() / total + 0.5 * components * share * share;
        *information = math::min(*information + new, REMEMBERED);
        math::clamp(score / *information, [-LARGEST_STEP, LARGEST_STEP])
    }
}

impl Default for CorrelationTime {
    fn default() -> Self {
        Self {
            ratio: 1.0,
            information: PRIOR_INFORMATION,
            sensitivity: FilterSensitivity::default(),
        }
    }
}

impl CorrelationTime {
    /// Correlation time assumed, over the configured one.
    pub fn ratio_of(&self, coloured: &ColouredNoise) -> f64 {
        math::max(self.ratio, coloured.time_ratio())
    }

    /// Time update: the step lasts for `part` of the correlation time; of a noise of variance `sigma2` the
    /// estimate has the variance `left`.
    pub fn propagate(
        &mut self,
        step: &Markov,
        part: f64,
        sigma2: f64,
        estimate: &Vector2<f64>,
        left: f64,
    ) {
        let Markov { decay, variance } = *step;
        let longer = decay * part;
        let s = &mut self.sensitivity;
        s.variance = decay * decay * s.variance + 2.0 * decay * longer * (left - sigma2) + variance;
        s.predicted = s.predicted * decay + estimate * longer;
    }

    /// Scoring step, before the measurement update. Never below the configured time: the sigma of the
    /// height is then too large, if anything.
    pub fn learn(&mut self, innovation: &Vector2<f64>, total: f64, [_, most]: [f64; 2]) {
        let step = self
            .sensitivity
            .step(&mut self.information, innovation, 1.0, total);
        self.ratio = math::clamp(self.ratio * (1.0 + step), [1.0, most]);
    }

    /// Measurement update; `white` of the variance is white noise.
    pub fn update(&mut self, innovation: &Vector2<f64>, total: f64, white: f64) {
        self.sensitivity.update(innovation, total, white);
    }
}

impl ColouredNoise {
    /// As configured.
    pub fn new(start: Time) -> Self {
        Self {
            ratio: 1.0,
            strength: 1.0,
            information: PRIOR_INFORMATION,
            last: start,
            slow_mean: Vector2::zeros(),
        }
    }

    /// Correlation time of a position over the configured one, at the same `sigma^2 / tau`, which is what
    /// shows beside velocities. How far the INS errs with it goes by `sigma^2 tau`, which does not show:
    /// where `sigma^2 / tau` is less than configured, `sigma^2 tau` is assumed as configured.
    pub fn time_ratio(&self) -> f64 {
        1.0 / math::sqrt(math::min(self.ratio, 1.0))
    }

    /// Variance assumed of the correlated part, with this ratio of its correlation time.
    pub fn variance(&self, noise: &Noise, time_ratio: f64) -> f64 {
        noise.correlated * noise.correlated * self.strength * time_ratio
    }

    /// Scales both parts, in variance.
    pub fn scale(&mut self, both: f64) {
        self.strength = both * self.ratio;
    }

    /// Scoring step by an innovation, before its measurement update.
    pub fn learn(
        &mut self,
        sensitivity: &FilterSensitivity,
        innovation: &Vector2<f64>,
        components: f64,
        total: f64,
        range: [f64; 2],
    ) {
        let step = sensitivity.step(&mut self.information, innovation, components, total);
        self.ratio = math::clamp_variance(self.ratio * (1.0 + step), range);
    }

    /// Learns from a jump of the noise of this variance per component.
    pub fn on_jump(&mut self, square: f64, components: f64, noise: &Noise, range: [f64; 2]) {
        let assumed = self.variance(noise, self.time_ratio());
        if assumed <= 0.0 {
            return;
        }
        let new = 0.5 * components;
        self.information = math::min(self.information + new, REMEMBERED);
        // The difference of two of them has twice the variance.
        let found = math::min(0.5 * square / assumed, LARGEST_SQUARE);
        let ratio = self.ratio * (1.0 + new * (found - 1.0) / self.information);
        self.ratio = math::clamp_variance(ratio, range);
    }

    /// Learns from the estimated noise state after a fix, known but for a variance `left` per component,
    /// and with the assumed ratio of the correlation time.
    pub fn learn_from_state(
        &mut self,
        now: Time,
        estimate: &Vector2<f64>,
        components: f64,
        left: f64,
        (noise, time_ratio): (&Noise, f64),
        range: [f64; 2],
    ) {
        let assumed = self.variance(noise, time_ratio);
        if assumed <= 0.0 {
            return;
        }
        let new = math::min(
            now.seconds_since(self.last) / (noise.correlation_s * time_ratio),
            1.0,
        );
        self.last = now;
        self.slow_mean += (estimate - self.slow_mean) * (new / SLOW);
        // Removing the slow mean reduces the variance.
        let square = (estimate - self.slow_mean).norm_squared() / components * (1.0 + 1.0 / SLOW);
        // Before, more may have been assumed.
        let left = math::min(left / assumed, 1.0);
        let known = 1.0 - left;
        self.information = math::min(self.information + 0.5 * known * known * new, REMEMBERED);
        let found = math::min(square / assumed, LARGEST_SQUARE) + left;
        let ratio = self.ratio * (1.0 + 0.5 * (found - 1.0) * new / self.information);
        self.ratio = math::clamp_variance(ratio, range);
    }
}

#[cfg(test)]
#[path = "../../tests/unit/coloured_noise.rs"]
mod tests;
