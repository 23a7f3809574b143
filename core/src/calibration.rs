//! Calibration of a unit, to be kept from one run to the next.

use nalgebra::Vector3;

use crate::config::{Config, ConfigError, finite};
use crate::math;
use crate::parameters::{Parameters, index};

/// Least part of a configured sigma that a kept one may be: single precision holds no less, and nothing is
/// known a million times better than its data sheet.
const LEAST: f64 = 1e-6;
/// Assumed time of clock drift before the unit was switched off, s.
pub(crate) const RUN_S: f64 = 3600.0;

/// A value and one standard deviation of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Known {
    /// SI units.
    pub value: f64,
    /// Same unit.
    pub sigma: f64,
}

/// Values and sigmas of all parameters but the azimuth; body axes right-forward-up, signs as in
/// [`Estimates`](crate::Estimates).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Calibration {
    /// Gyro biases, rad/s.
    pub gyro_bias_radps: [Known; 3],
    /// Accelerometer biases at `level_force_mps2`, m/s^2.
    pub accel_bias_mps2: [Known; 3],
    /// Scale errors of the accelerometers, 1.
    pub accel_scale: [Known; 3],
    /// Scale error of the gyros in turns about the vertical of the mount, 1.
    pub turn_scale: Known,
    /// Scale errors of the gyros in all other turns, 1.
    pub gyro_scale: [Known; 3],
    /// Misalignments of the gyros: the part of all other turns that they sense about the vertical, rad.
    pub gyro_misalignment_rad: [Known; 3],
    /// GNSS latency, s.
    pub gnss_latency_s: Known,
    /// Delay of positions beyond that of the velocities beside them, s.
    pub gnss_position_delay_s: Known,
    /// Growth of the latency, s/s.
    pub clock_drift: Known,
    /// Smoothing by the receiver, s^2.
    pub gnss_smoothing_s2: Known,
    /// Antenna position right, forward and up of the inertial sensors, m.
    pub lever_arm_m: [Known; 3],
    /// Specific force in the body at the level attitude of the mount, m/s^2; zero: not known.
    pub level_force_mps2: Vector3<f64>,
}

impl Calibration {
    /// Each group and its first parameter.
    fn groups(&mut self) -> [(usize, &mut [Known]); 11] {
        use core::slice::from_mut;
        [
            (index::LATENCY, from_mut(&mut self.gnss_latency_s)),
            (index::GYRO, &mut self.gyro_bias_radps),
            (index::ACCEL, &mut self.accel_bias_mps2),
            (
                index::POSITION_DELAY,
                from_mut(&mut self.gnss_position_delay_s),
            ),
            (index::CLOCK_DRIFT, from_mut(&mut self.clock_drift)),
            (index::LEVER_ARM, &mut self.lever_arm_m),
            (index::ACCEL_SCALE, &mut self.accel_scale),
            (index::TURN_SCALE, from_mut(&mut self.turn_scale)),
            (index::GYRO_SCALE, &mut self.gyro_scale),
            (index::GYRO_MISALIGNMENT, &mut self.gyro_misalignment_rad),
            (index::SMOOTHING, from_mut(&mut self.gnss_smoothing_s2)),
        ]
    }

    pub(crate) fn of(parameters: &Parameters, level_force_mps2: Vector3<f64>) -> Self {
        let mut calibration = Self {
            level_force_mps2,
            ..Self::default()
        };
        for (first, group) in calibration.groups() {
            for (which, known) in (first..).zip(group) {
                *known = Known {
                    value: parameters.value(which),
                    sigma: parameters.sigma(which),
                };
            }
        }
        calibration
    }

    /// The same, for a unit that has been switched off and on: its biases have changed by what the data
    /// sheet calls run-to-run (turn-on) repeatability, rad/s and m/s^2. Drifting clocks start anew as well:
    /// the latency has changed by their drift in an hour.
    #[must_use]
    pub fn after_turn_on(mut self, gyro_radps: f64, accel_mps2: f64) -> Self {
        let widen = |known: &mut Known, by: f64| {
            known.sigma = math::sqrt(known.sigma * known.sigma + by * by);
        };
        for (gyro, accel) in self
            .gyro_bias_radps
            .iter_mut()
            .zip(&mut self.accel_bias_mps2)
        {
            widen(gyro, gyro_radps);
            widen(accel, accel_mps2);
        }
        let Known { value, sigma } = self.clock_drift;
        widen(&mut self.gnss_latency_s, RUN_S * value);
        widen(&mut self.gnss_latency_s, RUN_S * sigma);
        self
    }

    /// Prior of a run: no sigma is above the configured one.
    pub(crate) fn prior(mut self, config: &Config) -> Result<Parameters, ConfigError> {
        let mut parameters = config.prior();
        for force_mps2 in &self.level_force_mps2 {
            finite(*force_mps2, "calibration")?;
        }
        for (first, group) in self.groups() {
            for (which, known) in (first..).zip(group) {
                for number in [known.value, known.sigma] {
                    finite(number, "calibration")?;
                }
                let prior = parameters.sigma(which);
                // What is not estimated, or given, is as configured.
                let sought = prior > 0.0 && !config.is_given(which);
                if known.sigma < 0.0 {
                    return Err(ConfigError::Negative("calibration"));
                }
                // Parameters that were not estimated have none.
                if sought && known.sigma > 0.0 {
                    let sigma = math::min(math::max(known.sigma, LEAST * prior), prior);
                    parameters.set(which, known.value, sigma);
                }
            }
        }
        Ok(parameters)
    }
}

/// Refers the accelerometer biases from one level attitude to another, by their scale errors.
pub(crate) fn at_level(known: &mut Parameters, from: &Vector3<f64>, to: &Vector3<f64>) {
    for (axis, step) in (to - from).iter().enumerate() {
        let (bias, scale) = (index::ACCEL + axis, index::ACCEL_SCALE + axis);
        let value = known.value(bias) + step * known.value(scale);
        let (own, by_scale) = (known.sigma(bias), step * known.sigma(scale));
        known.set(bias, value, math::sqrt(own * own + by_scale * by_scale));
    }
}
