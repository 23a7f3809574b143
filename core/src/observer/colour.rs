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

use crate::channel::Renewal;
use crate::config::Noise;
use crate::math;
use crate::time::Time;

/// Information about the logarithm of its variance: what is configured counts for some, a factor of two
/// in the standard deviation being two sigmas, so that an INS on its way to be found wrong is not taken
/// for noise in its first innovations; remembered is what makes it good to a sixth.
pub const CONFIGURED: f64 = 2.0;
/// The same of a noise that is learnt of by its estimate: for one correlation time.
pub const CONFIGURED_ONCE: f64 = 0.5;
const REMEMBERED: f64 = 10.0;
/// What lasts for so many correlation times is no such noise, but an INS that errs.
const LASTING: f64 = 10.0;
/// Largest square of an estimate, in its variance, that counts.
const LARGEST_SQUARE: f64 = 9.0;
/// Largest step of that logarithm from one fix: an outlier is no noise.
const LARGEST_STEP: f64 = 0.1;

/// Strength of the correlated part of one kind of noise.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Colour {
    /// Its variance against the configured one, were the white part as strong as configured, and as
    /// strong as it is.
    pub ratio: f64,
    pub strength: f64,
    information: f64,
    last: Time,
    /// What lasts of its estimate.
    lasting: Vector2<f64>,
}

/// By how much more variance the next measurement would be predicted, and itself be predicted to be
/// more, for a unit of the logarithm of that strength more.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Sensitivity {
    variance: f64,
    predicted: Vector2<f64>,
}

impl Sensitivity {
    /// Some of the noise has gone, and some has come in.
    pub fn renew(&mut self, renewal: &Renewal) {
        self.variance = renewal.keep * renewal.keep * self.variance + renewal.new;
        self.predicted *= renewal.keep;
    }

    /// An innovation of a variance per component is taken, of which `white` is white noise.
    pub fn take(&mut self, innovation: &Vector2<f64>, total: f64, white: f64) {
        let kept = white / total;
        let gain = kept * self.variance / total;
        self.predicted = self.predicted * kept + innovation * gain;
        self.variance *= kept * kept;
    }
}

impl Colour {
    /// As configured, known by so much information.
    pub fn new(start: Time, information: f64) -> Self {
        Self {
            ratio: 1.0,
            strength: 1.0,
            information,
            last: start,
            lasting: Vector2::zeros(),
        }
    }

    /// Both parts are stronger by this, in variance.
    pub fn scale(&mut self, both: f64) {
        self.strength = both * self.ratio;
    }

    /// Learns from an innovation of so many components and a variance of each, before it is taken.
    pub fn learn(
        &mut self,
        sensitivity: &Sensitivity,
        innovation: &Vector2<f64>,
        components: f64,
        total: f64,
        range: [f64; 2],
    ) {
        let Sensitivity {
            variance,
            predicted,
        } = sensitivity;
        let share = variance / total;
        let square = innovation.norm_squared() / total;
        let score = predicted.dot(innovation) / total + 0.5 * share * (square - components);
        let new = predicted.norm_squared() / total + 0.5 * components * share * share;
        self.information = math::min(self.information + new, REMEMBERED);
        let step = math::within(score / self.information, [-LARGEST_STEP, LARGEST_STEP]);
        self.ratio = math::variance_within(self.ratio * (1.0 + step), range);
    }

    /// Learns from what the observer takes for this noise after a fix, in so many components, and the
    /// variance with which each is not known.
    pub fn learn_of_estimate(
        &mut self,
        now: Time,
        estimate: &Vector2<f64>,
        components: f64,
        left: f64,
        noise: &Noise,
        range: [f64; 2],
    ) {
        let assumed = noise.correlated * noise.correlated * self.strength;
        if assumed <= 0.0 {
            return;
        }
        let new = math::min(now.seconds_since(self.last) / noise.correlation_s, 1.0);
        self.last = now;
        self.lasting += (estimate - self.lasting) * (new / LASTING);
        // Less its mean over a while, noise is smaller by as much.
        let square = (estimate - self.lasting).norm_squared() / components * (1.0 + 1.0 / LASTING);
        // What was assumed before may be more.
        let left = math::min(left / assumed, 1.0);
        let known = 1.0 - left;
        self.information = math::min(self.information + 0.5 * known * known * new, REMEMBERED);
        let found = math::min(square / assumed, LARGEST_SQUARE) + left;
        let ratio = self.ratio * (1.0 + 0.5 * (found - 1.0) * new / self.information);
        self.ratio = math::variance_within(ratio, range);
    }
}

#[cfg(test)]
#[path = "../../tests/unit/colour.rs"]
mod tests;
