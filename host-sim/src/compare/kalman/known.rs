//! The INS and what is taken out of its readings, less all that was found.

use ins_core::attitude::matrix;
use ins_core::earth::GRAVITY_EQUATOR_MPS2;
use ins_core::increments::Interval;
use ins_core::mechanization::Mechanization;
use ins_core::{Estimate, Estimates, Observability, Solution, Time};
use nalgebra::Vector3;

use super::{Layout, Noise, Part, StateMatrix, States, index, sigmas};

/// As in the core, a parameter counts as observed below this part of its spread at the start; the
/// azimuth of that of a heading known to 0.1 rad.
const OBSERVED: f64 = 0.33;
const AZIMUTH_RAD: f64 = 0.1;

/// The INS and what is taken out of its readings and stamps, and of fixes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Known {
    pub ins: Mechanization,
    pub accel_bias_mps2: Vector3<f64>,
    pub gyro_bias_radps: Vector3<f64>,
    /// A fix stamped t shows the motion at t minus this, s.
    pub latency_s: f64,
    /// Growth of the latency, s/s.
    pub clock_drift: f64,
    /// Antenna from the sensors, body, m.
    pub lever_arm_m: Vector3<f64>,
    pub accel_scale: Vector3<f64>,
    pub gyro_scale: Vector3<f64>,
    /// Coloured noise that is now in the position and in the velocity of fixes, ENU, m and m/s.
    pub colour: [Vector3<f64>; 2],
}

impl Known {
    /// Nothing but the INS and the gyro biases of its alignment.
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
            colour: [Vector3::zeros(); 2],
        }
    }

    pub(super) fn corrected(&self, raw: &Interval) -> Interval {
        // Exactly undone: what gravity makes of the square of a scale error is more than there is
        // doubt of the upright accelerometer.
        let mut interval = raw.without_bias(&self.gyro_bias_radps, &self.accel_bias_mps2);
        let of = |scale: Vector3<f64>| scale.add_scalar(1.0);
        (interval.angle_rad).component_div_assign(&of(self.gyro_scale));
        (interval.force_mps).component_div_assign(&of(self.accel_scale));
        interval
    }

    pub(super) fn colour(&self, part: Part) -> &Vector3<f64> {
        &self.colour[usize::from(part.is_velocity())]
    }

    /// Lets coloured noise fade, and the latency grow.
    pub(super) fn age(&mut self, seconds: f64, noise: &Noise) {
        self.latency_s += self.clock_drift * seconds;
        for part in Part::ALL {
            let kept = noise.kept(part, seconds);
            for axis in part.axes() {
                self.colour[usize::from(part.is_velocity())][axis] *= kept;
            }
        }
    }

    pub(super) fn less(mut self, errors: &States, layout: &Layout) -> Self {
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
        for part in Part::ALL {
            for (axis, state) in part.axes().zip(layout.colour(part)) {
                self.colour[usize::from(part.is_velocity())][axis] += errors[state];
            }
        }
        self
    }

    /// In the core's terms, with the spreads of all errors. The azimuth error is what is left: the
    /// filter takes out all that it finds. The upright accelerometer is said to err by what it
    /// does at the attitude of now: its scale error on gravity is a bias. The latency is the mean
    /// of a run of `run_s`, as the core's.
    pub(super) fn estimates(
        &self,
        covariance: &StateMatrix,
        run_s: f64,
        layout: &Layout,
        noise: &Noise,
    ) -> Estimates {
        let sigma = sigmas(covariance);
        let estimate = |value: f64, at: usize, start: f64| told(value, sigma[at], start);
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
        estimates.accel_bias_mps2[2] = self.upright(covariance, layout, noise);
        estimates.gnss_latency_now_s = estimates.gnss_latency_s;
        if let Some(at) = layout.clock_drift {
            estimates.clock_drift = estimate(self.clock_drift, at, gnss.clock_drift_sigma);
            let (back_s, latency) = (0.5 * run_s, index::LATENCY);
            let variance = covariance[(latency, latency)]
                - 2.0 * back_s * covariance[(latency, at)]
                + back_s * back_s * covariance[(at, at)];
            estimates.gnss_latency_s = told(
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

    /// Error of the upright accelerometer at rest at the attitude of now.
    fn upright(&self, covariance: &StateMatrix, layout: &Layout, noise: &Noise) -> Estimate {
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
        told(value, variance.max(0.0).sqrt(), start)
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

fn told(value: f64, sigma: f64, start: f64) -> Estimate {
    Estimate {
        value,
        sigma,
        observability: if sigma < OBSERVED * start {
            Observability::Observable
        } else {
            Observability::NeedsTime
        },
    }
}
