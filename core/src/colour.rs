//! How strong the correlated part of GNSS noise is, from what the observer takes for it.
//!
//! The observer follows that part beside the errors of the INS. Its mean square, and the variance
//! that is left of it, must come to the variance that is assumed: where they are less, less is
//! assumed. This is a step of expectation and maximization (Shumway and Stoffer, 1982) with the
//! filter's estimate in place of the smoother's, divided by the information that the noise has
//! given of itself so far, as Fisher's scoring has it. An INS that errs more than its sensors should
//! is told from it by the channel: the one stays, the other comes back within its correlation time.

use crate::config::Noise;
use crate::math;
use crate::time::Time;

/// Information about the logarithm of its variance, in correlation times over which the noise was
/// seen as if it were alone: what is configured counts for one, and some are remembered.
const CONFIGURED: f64 = 1.0;
const REMEMBERED: f64 = 20.0;
/// Largest square, in its variance, that counts: outliers are no noise.
const ROBUST: f64 = 9.0;

/// Strength of the correlated part of one kind of noise.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Colour {
    /// Its variance against the configured one, were the white part as strong as configured, and as
    /// strong as it is.
    ratio: f64,
    strength: f64,
    information: f64,
    last: Time,
}

impl Colour {
    /// As configured.
    pub fn new(start: Time) -> Self {
        Self {
            ratio: 1.0,
            strength: 1.0,
            information: CONFIGURED,
            last: start,
        }
    }

    /// Variance of the correlated part against the configured one.
    pub fn strength(&self) -> f64 {
        self.strength
    }

    /// The same, were the white part as strong as configured.
    pub fn ratio(&self) -> f64 {
        self.ratio
    }

    /// Both parts are stronger by this, in variance.
    pub fn scale(&mut self, both: f64) {
        self.strength = both * self.ratio;
    }

    /// Learns from what the observer takes for this noise after a fix: its mean square, and the
    /// variance with which it is not known.
    pub fn learn(&mut self, now: Time, square: f64, left: f64, noise: &Noise, range: [f64; 2]) {
        let assumed = noise.correlated * noise.correlated * self.strength;
        if assumed <= 0.0 {
            return;
        }
        let new = math::min(now.seconds_since(self.last) / noise.correlation_s, 1.0);
        self.last = now;
        // What was assumed before may be more.
        let left = math::min(left / assumed, 1.0);
        let known = 1.0 - left;
        self.information = math::min(self.information + known * known * new, REMEMBERED);
        let found = math::min(square / assumed, ROBUST) + left;
        let ratio = self.ratio * (1.0 + (found - 1.0) * new / self.information);
        self.ratio = math::variance_within(ratio, range);
    }
}

#[cfg(test)]
#[path = "../tests/unit/colour.rs"]
mod tests;
