//! How noisy the gyros are, from how far the tilt of the INS walks.
//!
//! Over some time the estimate of the tilt moves by its corrections. Their variances add up to
//! what the measurements take away of its own: of the noise that came in meanwhile all but what is
//! left. An estimate that moves farther follows an error that walks farther than is told. At the end
//! of each such time one step of Fisher's scoring finds by how much.

use nalgebra::Vector2;

use crate::math;

/// Time over which moves are added up, s: several times that which the channels need to follow a
/// tilt, so that what they lag behind by matters little.
const LOOK_S: f64 = 30.0;
/// Information about the logarithm of the variance: what is configured counts for some, a factor of
/// three in the standard deviation being four sigmas; remembered is what makes it good to a fifth.
const CONFIGURED: f64 = 3.0;
const REMEMBERED: f64 = 20.0;
/// Largest square of a move, in its variance, that counts: a knock is no noise.
const ROBUST: f64 = 9.0;

/// What has happened since the last look.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Meanwhile {
    seconds: f64,
    /// Variance that came in, and that measurements took away.
    came: f64,
    taken: f64,
    /// What the estimate has moved by, and the variance that each component should have.
    moved: Vector2<f64>,
    expected: f64,
}

/// Strength of the noise of the gyros.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ProcessNoise {
    /// Its variance against the configured one.
    pub ratio: f64,
    information: f64,
    meanwhile: Meanwhile,
}

impl ProcessNoise {
    /// As configured.
    pub fn configured() -> Self {
        Self {
            ratio: 1.0,
            information: CONFIGURED,
            meanwhile: Meanwhile::default(),
        }
    }

    /// It has come in.
    pub fn came(&mut self, seconds: f64, variance: f64) {
        self.meanwhile.seconds += seconds;
        self.meanwhile.came += variance;
    }

    /// An innovation of a variance per component has moved the estimate by a gain, and has taken
    /// away some of its variance.
    pub fn moved(&mut self, innovation: &Vector2<f64>, variance: f64, gain: f64, taken: f64) {
        self.meanwhile.moved += innovation * gain;
        self.meanwhile.expected += variance * gain * gain;
        self.meanwhile.taken += taken;
    }

    /// Something else has moved it.
    pub fn look_anew(&mut self) {
        self.meanwhile = Meanwhile::default();
    }

    /// Learns, when it is time to; `left` is the variance that is left of each component.
    pub fn look(&mut self, left: f64, range: [f64; 2]) {
        let since = &self.meanwhile;
        if since.seconds < LOOK_S || since.expected <= 0.0 {
            return;
        }
        // Of what came in, so much was taken: d(P - P')/dP of P' = 1 / (1 / P + information).
        let part = left / (left + since.taken);
        let sensitivity = since.came * (1.0 - part * part) / since.expected;
        let square = since.moved.norm_squared() / (2.0 * since.expected);
        let information = self.information + sensitivity * sensitivity;
        self.information = math::min(information, REMEMBERED);
        let step = sensitivity * (math::min(square, ROBUST) - 1.0) / self.information;
        self.ratio = math::variance_within(self.ratio * (1.0 + step), range);
        self.look_anew();
    }
}

#[cfg(test)]
#[path = "../../tests/unit/process_noise.rs"]
mod tests;
