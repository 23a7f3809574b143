//! Compensation of readings and stamps by the estimates.

use nalgebra::Vector3;

use crate::config::{Config, Feedback, Form};
use crate::math;
use crate::parameters::{Parameters, index};

/// A parameter is compensated once its sigma is below this part of the prior one.
const BIAS_KNOWN: f64 = 0.5;
const LATENCY_KNOWN: f64 = 0.2;
/// Largest credible latency, s.
pub const LATENCY_LIMIT_S: f64 = 1.2;

/// Errors taken out of readings and stamps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Compensation {
    /// Of the gyros.
    pub gyro_radps: Vector3<f64>,
    /// Of the accelerometers.
    pub accel_mps2: Vector3<f64>,
    /// Of the stamps of fixes.
    pub latency_s: f64,
}

impl Compensation {
    /// Takes out what has become known.
    pub fn update(&mut self, parameters: &Parameters, config: &Config) {
        if config.feedback == Feedback::Open {
            return;
        }
        let prior = config.prior();
        let known = |i: usize, part: f64| parameters.sigma(i) < part * prior.sigma(i);
        // (9) reads gyro biases from controls that a compensation would empty.
        let exact = config.form == Form::Exact;
        for (which, gyro) in (index::GYRO..).zip(&mut self.gyro_radps) {
            if exact && known(which, BIAS_KNOWN) {
                *gyro = parameters.value(which);
            }
        }
        for (which, accel) in (index::ACCEL..).zip(&mut self.accel_mps2) {
            if known(which, BIAS_KNOWN) {
                *accel = parameters.value(which);
            }
        }
        // However uncertain: only the rest of it must be linear.
        if exact || known(index::LATENCY, LATENCY_KNOWN) {
            self.latency_s = credible_latency(parameters);
        }
    }
}

/// Latency, s, as far as the ring can serve it.
fn credible_latency(parameters: &Parameters) -> f64 {
    let limits = [-LATENCY_LIMIT_S, LATENCY_LIMIT_S];
    math::clamp(parameters.value(index::LATENCY), limits)
}
