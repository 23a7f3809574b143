//! Gyro noise, from the corrections of the tilt.
//!
//! Over a window the corrections of the tilt should have the variance that the measurements remove: of the
//! process noise added meanwhile all but what is left at the end. If they are larger, the tilt walks
//! farther than assumed. Each window gives one step of Fisher's scoring.

use nalgebra::Vector2;

use crate::math;

/// Window, s: several times the response time of the channels, so that their lag matters little.
const WINDOW_S: f64 = 30.0;
/// Information about the logarithm of the variance: of the prior, so that a factor of three in the standard
/// deviation is four sigmas; and the most remembered, good to a fifth.
const PRIOR_INFORMATION: f64 = 3.0;
const REMEMBERED: f64 = 20.0;
/// Bound on the normalized square of a correction: a knock is no noise.
const LARGEST_SQUARE: f64 = 9.0;

/// Sums over the window so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Window {
    seconds: f64,
    /// Process noise added, and variance removed by measurements.
    process_variance: f64,
    removed_variance: f64,
    /// Sum of the corrections, and its expected variance per component.
    correction: Vector2<f64>,
    expected_variance: f64,
}

/// Strength of the gyro noise.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ProcessNoise {
    /// Variance over the configured one.
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

    /// Process noise is added.
    pub fn add_noise(&mut self, seconds: f64, variance: f64) {
        self.window.seconds += seconds;
        self.window.process_variance += variance;
    }

    /// The tilt was corrected by an innovation of this variance per component; `taken` of its variance was
    /// removed.
    pub fn corrected(&mut self, innovation: &Vector2<f64>, variance: f64, gain: f64, taken: f64) {
        self.window.correction += innovation * gain;
        self.window.expected_variance += variance * gain * gain;
        self.window.removed_variance += taken;
    }

    /// The tilt has been changed otherwise.
    pub fn restart(&mut self) {
        self.window = Window::default();
    }

    /// Adapts at the end of a window; `left` is the variance left per component.
    pub fn adapt(&mut self, left: f64, range: [f64; 2]) {
        let since = &self.window;
        if since.seconds < WINDOW_S || since.expected_variance <= 0.0 {
            return;
        }
        // Part of the process noise that was removed: `d(P - P')/dP` of `P' = 1 / (1 / P + information)`.
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
