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
const WINDOW_S: f64 = 30.0;
/// Information about the logarithm of the variance: what is configured counts for some, a factor of
/// three in the standard deviation being four sigmas; remembered is what makes it good to a fifth.
const PRIOR_INFORMATION: f64 = 3.0;
const REMEMBERED: f64 = 20.0;
/// Largest square of a move, in its variance, that counts: a knock is no noise.
const LARGEST_SQUARE: f64 = 9.0;

/// What has happened since the last look.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Window {
    seconds: f64,
    /// Variance that came in, and that measurements took away.
    process_variance: f64,
    removed_variance: f64,
    /// What the estimate has moved by, and the variance that each component should have.
    correction: Vector2<f64>,
    expected_variance: f64,
}

/// Strength of the noise of the gyros.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ProcessNoise {
    /// Its variance against the configured one.
    pub ratio: f64,
    information: f64,
    window: Window,
}

impl ProcessNoise {
    /// As configured.
    pub fn configured() -> Self {
        Self {
            ratio: 1.0,
            information: PRIOR_INFORMATION,
            window: Window::default(),
        }
    }

    /// It has come in.
    pub fn add_noise(&mut self, seconds: f64, variance: f64) {
        self.window.seconds += seconds;
        self.window.process_variance += variance;
    }

    /// An innovation of a variance per component has moved the estimate by a gain, and has taken
    /// away some of its variance.
    pub fn corrected(&mut self, innovation: &Vector2<f64>, variance: f64, gain: f64, taken: f64) {
        self.window.correction += innovation * gain;
        self.window.expected_variance += variance * gain * gain;
        self.window.removed_variance += taken;
    }

    /// Something else has moved it.
    pub fn restart(&mut self) {
        self.window = Window::default();
    }

    /// Learns, when it is time to; `left` is the variance that is left of each component.
    pub fn adapt(&mut self, left: f64, range: [f64; 2]) {
        let since = &self.window;
        if since.seconds < WINDOW_S || since.expected_variance <= 0.0 {
            return;
        }
        // Of what came in, so much was taken: d(P - P')/dP of P' = 1 / (1 / P + information).
        let part = left / (left + since.removed_variance);
        let sensitivity = since.process_variance * (1.0 - part * part) / since.expected_variance;
        let square = since.correction.norm_squared() / (2.0 * since.expected_variance);
        let information = self.information + sensitivity * sensitivity;
        self.information = math::min(information, REMEMBERED);
        let step = sensitivity * (math::min(square, LARGEST_SQUARE) - 1.0) / self.information;
        self.ratio = math::clamp_variance(self.ratio * (1.0 + step), range);
        self.restart();
    }
}

#[cfg(test)]
#[path = "../../tests/unit/process_noise.rs"]
mod tests;
