//! Nominal state of the error-state filter: INS, sensor and receiver parameters, as corrected so far.

use ins_core::attitude::matrix;
use ins_core::earth::GRAVITY_EQUATOR_MPS2;
use ins_core::increments::Interval;
use ins_core::mechanization::Mechanization;
use ins_core::{Estimate, Estimates, Observability, Solution, Time};
use nalgebra::Vector3;

use super::{Kind, Layout, Noise, StateMatrix, States, index, sigmas};

/// Ratio of a parameter's sigma to its initial one below which it counts as observed, as in the core; and
/// the initial one of the azimuth.
const OBSERVED_RATIO: f64 = 0.33;
const AZIMUTH_RAD: f64 = 0.1;

/// The INS, and corrections of its readings, of stamps and of fixes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nominal {
    pub ins: Mechanization,
    pub accel_bias_mps2: Vector3<f64>,
    pub gyro_bias_radps: Vector3<f64>,
    /// A fix stamped t measures the motion at t minus this, s.
    pub latency_s: f64,
    /// Growth of the latency, s/s.
    pub clock_drift: f64,
    /// Antenna from the sensors, body, m.
    pub lever_arm_m: Vector3<f64>,
    pub accel_scale: Vector3<f64>,
    pub gyro_scale: Vector3<f64>,
    /// Estimated coloured noise of the position and of the velocity of fixes, ENU, m and m/s.
    pub coloured: [Vector3<f64>; 2],
}

impl Nominal {
    /// INS and gyro biases from the alignment.
    pub(super) fn new(ins: Mechanization, gyro_bias_radps: Vector3<f64>, noise: &Noise) -> Self {
        Self {
            ins,
            accel_bias_mps2: Vector3::zeros(),
            gyro_bias_radps,
            latency_s: 0.0,
            clock_drift: 0.0,
            lever_arm_m: noise.gnss.lever_arm_m.into(),
            accel_scale: Vector3::zeros(),
            gyro_scale: Vector3::zeros(),
            coloured: [Vector3::zeros(); 2],
        }
    }

    pub(super) fn compensated(&self, raw: &Interval) -> Interval {
        // Divided exactly: the square of a scale error times gravity exceeds the sigma of the z
        // accelerometer.
        let mut interval = raw.without_bias(&self.gyro_bias_radps, &self.accel_bias_mps2);
        let of = |scale: Vector3<f64>| scale.add_scalar(1.0);
        (interval.angle_rad).component_div_assign(&of(self.gyro_scale));
        (interval.force_mps).component_div_assign(&of(self.accel_scale));
        interval
    }

    pub(super) fn coloured(&self, kind: Kind) -> &Vector3<f64> {
        &self.coloured[usize::from(kind.is_velocity())]
    }

    /// Time update of coloured noise and latency.
    pub(super) fn propagate(&mut self, seconds: f64, noise: &Noise) {
        self.latency_s += self.clock_drift * seconds;
        for kind in Kind::ALL {
            let factor = noise.correlation(kind, seconds);
            for axis in kind.axes() {
                self.coloured[usize::from(kind.is_velocity())][axis] *= factor;
            }
        }
    }

    pub(super) fn corrected_by(mut self, errors: &States, layout: &Layout) -> Self {
        let three = |at: usize| errors.fixed_rows::<3>(at).into_owned();
        let optional = |at: Option<usize>| at.map_or_else(Vector3::zeros, three);
        let earth = self.ins.local_earth();
        self.ins.move_by(&earth, &-three(index::POSITION));
        self.ins.velocity_enu_mps -= three(index::VELOCITY);
        self.ins.turn_platform(&-three(index::ATTITUDE));
        self.accel_bias_mps2 += three(index::ACCEL);
        self.gyro_bias_radps += three(index::GYRO);
        self.latency_s += errors[index::LATENCY];
        self.clock_drift += layout.clock_drift.map_or(0.0, |at| errors[at]);
        self.lever_arm_m += optional(layout.lever_arm);
        self.accel_scale += optional(layout.accel_scale);
        self.gyro_scale += optional(layout.gyro_scale);
        for kind in Kind::ALL {
            for (axis, state) in kind.axes().zip(layout.coloured(kind)) {
                self.coloured[usize::from(kind.is_velocity())][axis] += errors[state];
            }
        }
        self
    }

    /// In the terms of the core, with sigmas. The azimuth error is the remaining one, zero: the filter
    /// corrects the INS by all that it estimates. The bias of the z accelerometer includes its scale error
    /// on gravity at the current attitude. The latency is the mean over a run of `run_s`, as the core's.
    pub(super) fn estimates(
        &self,
        covariance: &StateMatrix,
        run_s: f64,
        layout: &Layout,
        noise: &Noise,
    ) -> Estimates {
        let sigma = sigmas(covariance);
        let estimate = |value: f64, at: usize, start: f64| estimate_of(value, sigma[at], start);
        let three = |values: Vector3<f64>, at: usize, start: f64| {
            [0, 1, 2].map(|axis| estimate(values[axis], at + axis, start))
        };
        let (sensors, gnss) = (&noise.sensors, &noise.gnss);
        let (accel, gyro) = (self.accel_bias_mps2, self.gyro_bias_radps);
        let mut estimates = Estimates {
            azimuth_error_rad: estimate(0.0, index::ATTITUDE + 2, AZIMUTH_RAD),
            accel_bias_mps2: three(accel, index::ACCEL, sensors.accel_bias_mps2),
            gyro_bias_radps: three(gyro, index::GYRO, sensors.gyro_bias_radps),
            gnss_latency_s: estimate(self.latency_s, index::LATENCY, gnss.latency_sigma_s),
            ..Estimates::default()
        };
        estimates.accel_bias_mps2[2] = self.z_accel_bias(covariance, layout, noise);
        estimates.gnss_latency_now_s = estimates.gnss_latency_s;
        if let Some(at) = layout.clock_drift {
            estimates.clock_drift = estimate(self.clock_drift, at, gnss.clock_drift_sigma);
            let (back_s, latency) = (0.5 * run_s, index::LATENCY);
            let variance = covariance[(latency, latency)]
                - 2.0 * back_s * covariance[(latency, at)]
                + back_s * back_s * covariance[(at, at)];
            estimates.gnss_latency_s = estimate_of(
                self.latency_s - back_s * self.clock_drift,
                variance.max(0.0).sqrt(),
                gnss.latency_sigma_s,
            );
        }
        if let Some(at) = layout.lever_arm {
            estimates.lever_arm_m = three(self.lever_arm_m, at, gnss.lever_arm_sigma_m);
        }
        estimates
    }

    /// Error of the z accelerometer at rest at the current attitude.
    fn z_accel_bias(&self, covariance: &StateMatrix, layout: &Layout, noise: &Noise) -> Estimate {
        let bias = index::ACCEL + 2;
        let gravity = GRAVITY_EQUATOR_MPS2 * matrix(&self.ins.attitude).m33;
        let (mut variance, start) = (
            covariance[(bias, bias)],
            libm::hypot(
                noise.sensors.accel_bias_mps2,
                noise.sensors.accel_scale * gravity,
            ),
        );
        if let Some(scale) = layout.accel_scale.map(|at| at + 2) {
            variance += 2.0 * gravity * covariance[(bias, scale)]
                + gravity * gravity * covariance[(scale, scale)];
        }
        let value = self.accel_bias_mps2.z + gravity * self.accel_scale.z;
        estimate_of(value, variance.max(0.0).sqrt(), start)
    }

    pub fn solution(&self, time: Time) -> Solution {
        Solution {
            time,
            position: self.ins.position,
            velocity_enu_mps: self.ins.velocity_enu_mps,
            attitude: self.ins.attitude,
        }
    }
}

fn estimate_of(value: f64, sigma: f64, start: f64) -> Estimate {
    Estimate {
        value,
        sigma,
        observability: if sigma < OBSERVED_RATIO * start {
            Observability::Observable
        } else {
            Observability::NeedsTime
        },
    }
}
