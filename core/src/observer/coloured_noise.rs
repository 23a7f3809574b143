//! How strong the correlated part of GNSS noise is, by the likelihood of the innovations.
//!
//! A noise that is assumed too weak is followed too slowly: innovations go on as the ones before, and
//! are too large. Each says how much likelier it would be of a stronger noise, by what its variance and
//! its prediction would be more by. Of one sum that is measured, predicted with a variance `T` and
//! measured with `R`, both follow from the update `T R / (T + R)` and the gain `T / (T + R)` by
//! differentiation (sensitivity equations: Gupta and Mehra, IEEE TAC 19, 1974); a step of Fisher's
//! scoring goes with each. So the noise is found wherever the INS and its parameters end, which the
//! estimate of the noise itself does not tell: what both may hold, it may hold little of. So heights are
//! learnt of; velocities and level positions by that estimate, which is slower, for an INS whose unit was
//! turned unseen must be found and not be taken for noise.

use nalgebra::Vector2;

use crate::channel::Markov;
use crate::config::Noise;
use crate::math;
use crate::time::Time;

/// Information about the logarithm of its variance, and of its correlation time: what is configured counts
/// for some, a factor of four in the standard deviation being two sigmas, for receivers differ as much;
/// remembered is what makes it good to a sixth.
const PRIOR_INFORMATION: f64 = 0.5;
const REMEMBERED: f64 = 10.0;
/// What lasts for so many correlation times is no such noise, but an INS that errs.
const SLOW: f64 = 10.0;
/// Largest square of an estimate, in its variance, that counts.
const LARGEST_SQUARE: f64 = 9.0;
/// Largest step of that logarithm from one fix: an outlier is no noise.
const LARGEST_STEP: f64 = 0.1;

/// Strength of the correlated part of one kind of noise.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ColouredNoise {
    /// Its variance against the configured one, were the white part as strong as configured, and as
    /// strong as it is.
    pub ratio: f64,
    pub strength: f64,
    information: f64,
    last: Time,
    /// What lasts of its estimate.
    slow_mean: Vector2<f64>,
}

/// How many times longer than configured the correlated part lasts, with as much that comes in: `sigma^2 /
/// tau` is what innovations tell in seconds, and how far it wanders what they tell in minutes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CorrelationTime {
    pub ratio: f64,
    information: f64,
    sensitivity: FilterSensitivity,
}

/// By how much more variance the next measurement would be predicted, and itself be predicted to be
/// more, for a unit more of the logarithm of what is found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FilterSensitivity {
    variance: f64,
    predicted: Vector2<f64>,
}

impl FilterSensitivity {
    /// Some of the noise has gone, and some has come in.
    pub fn propagate(&mut self, renewal: &Markov) {
        self.variance = renewal.keep * renewal.keep * self.variance + renewal.new;
        self.predicted *= renewal.keep;
    }

    /// An innovation of a variance per component is taken, of which `white` is white noise.
    pub fn update(&mut self, innovation: &Vector2<f64>, total: f64, white: f64) {
        let kept = white / total;
        let gain = kept * self.variance / total;
        self.predicted = self.predicted * kept + innovation * gain;
        self.variance *= kept * kept;
    }

    /// Step of the logarithm that an innovation of so many components and a variance of each asks for,
    /// before it is taken.
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
    /// How many times longer than configured a noise of this colour is assumed to last.
    pub fn ratio_of(&self, coloured: &ColouredNoise) -> f64 {
        math::max(self.ratio, coloured.time_ratio())
    }

    /// Some of the noise has gone in a part of its correlation time, and some has come in; of its `sigma`,
    /// squared, an estimate was known but for a variance `left`.
    pub fn propagate(
        &mut self,
        renewal: &Markov,
        part: f64,
        sigma2: f64,
        estimate: &Vector2<f64>,
        left: f64,
    ) {
        let Markov { keep, new } = *renewal;
        let longer = keep * part;
        let s = &mut self.sensitivity;
        s.variance = keep * keep * s.variance + 2.0 * keep * longer * (left - sigma2) + new;
        s.predicted = s.predicted * keep + estimate * longer;
    }

    /// Learns from an innovation of a variance, before it is taken. A shorter time than configured is never
    /// believed: what it is for, an honest spread of the height, errs to the safe side without it.
    pub fn learn(&mut self, innovation: &Vector2<f64>, total: f64, [_, most]: [f64; 2]) {
        let step = self
            .sensitivity
            .step(&mut self.information, innovation, 1.0, total);
        self.ratio = math::clamp(self.ratio * (1.0 + step), [1.0, most]);
    }

    /// An innovation of a variance is taken, of which `white` is white noise.
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

    /// How many times longer than configured that of a position is assumed to last, with as much that comes
    /// in. What is slow beside the velocities that hold an INS shows by how little comes in, `sigma^2 / tau`;
    /// how far the INS errs with it goes by `sigma^2 tau`, which innovations do not tell: of one that comes
    /// in more slowly than configured, that is assumed as configured.
    pub fn time_ratio(&self) -> f64 {
        1.0 / math::sqrt(math::min(self.ratio, 1.0))
    }

    /// Variance that the correlated part is assumed to have, which lasts so many times longer than configured.
    pub fn variance(&self, noise: &Noise, time_ratio: f64) -> f64 {
        noise.correlated * noise.correlated * self.strength * time_ratio
    }

    /// Both parts are stronger by this, in variance.
    pub fn scale(&mut self, both: f64) {
        self.strength = both * self.ratio;
    }

    /// Learns from an innovation of so many components and a variance of each, before it is taken.
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

    /// It is another one now than a short while ago, by a variance of each component.
    pub fn on_jump(&mut self, square: f64, components: f64, noise: &Noise, range: [f64; 2]) {
        let assumed = self.variance(noise, self.time_ratio());
        if assumed <= 0.0 {
            return;
        }
        let new = 0.5 * components;
        self.information = math::min(self.information + new, REMEMBERED);
        // Two of them differ by twice as much.
        let found = math::min(0.5 * square / assumed, LARGEST_SQUARE);
        let ratio = self.ratio * (1.0 + new * (found - 1.0) / self.information);
        self.ratio = math::clamp_variance(ratio, range);
    }

    /// Learns from what the observer takes for this noise, which it assumes to last so many times longer than
    /// configured, after a fix, in so many components, and the variance with which each is not known.
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
        // Less its mean over a while, noise is smaller by as much.
        let square = (estimate - self.slow_mean).norm_squared() / components * (1.0 + 1.0 / SLOW);
        // What was assumed before may be more.
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
