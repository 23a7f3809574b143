//! What the filter is told of the sensors.

use ins_core::Config;
use ins_core::earth::GRAVITY_EQUATOR_MPS2;
use nalgebra::Vector3;

use super::{StateMatrix, States, index};
use crate::quantities::DEG_H_RADPS;
use crate::sim::errors::{BiasModel, ErrorModel, SensorModel};

/// Spread of the velocity at the start, that of an old fix, m/s, and age of its position, s.
const START_VELOCITY_MPS: f64 = 1.0;
const START_AGE_S: f64 = 0.5;
/// Tilt that levelling leaves beyond what the accelerometer biases explain, rad.
const LEVELLING_RAD: f64 = 0.005;
/// Heading that the user gives, rad; where its spread is not known.
const GIVEN_HEADING_RAD: f64 = 0.3;
/// Spread of the latency before any data, s.
const LATENCY_S: f64 = 0.2;
/// Position noise of a plain receiver, east and north, and up, m.
const HORIZONTAL_M: f64 = 2.5;
const VERTICAL_M: f64 = 5.0;

/// Noise densities and spreads, one sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Angular random walk, rad/sqrt(s).
    pub gyro_noise: f64,
    /// Drift of a gyro bias, rad/s/sqrt(s).
    pub gyro_bias_walk: f64,
    /// Gyro bias at the start, rad/s.
    pub gyro_bias_radps: f64,
    /// Velocity random walk, m/s/sqrt(s).
    pub accel_noise: f64,
    /// Drift of an accelerometer bias, m/s^2/sqrt(s).
    pub accel_bias_walk: f64,
    /// Accelerometer bias at the start, m/s^2.
    pub accel_bias_mps2: f64,
    /// Velocity of a fix that does not tell its own spread, m/s.
    pub velocity_sigma_mps: f64,
    /// Position of a fix, ENU, m.
    pub position_sigma_m: Vector3<f64>,
    /// Latency at the start, s.
    pub latency_sigma_s: f64,
    /// Spread of a heading that is given at the start, rad.
    pub heading_sigma_rad: f64,
}

impl Noise {
    /// What really was put into a simulated log.
    ///
    /// A bias that wanders within bounds is taken for one that walks as fast.
    pub fn of_model(model: &ErrorModel) -> Self {
        let (gyro, accel) = (&model.gyro_deg_h, &model.accel_mps2);
        let gnss = &model.gnss;
        let (least, most) = (gnss.latency_s[0], gnss.latency_s[1]);
        Self {
            gyro_noise: gyro.white_noise * DEG_H_RADPS,
            gyro_bias_walk: walk(&gyro.bias) * DEG_H_RADPS,
            gyro_bias_radps: start(gyro) * DEG_H_RADPS,
            accel_noise: accel.white_noise,
            accel_bias_walk: walk(&accel.bias),
            // A scale error is felt by the upright accelerometer as one of the bias.
            accel_bias_mps2: libm::hypot(start(accel), accel.scale_sigma * GRAVITY_EQUATOR_MPS2),
            velocity_sigma_mps: gnss.velocity_sigma_mps,
            position_sigma_m: Vector3::new(
                gnss.horizontal_sigma_m,
                gnss.horizontal_sigma_m,
                gnss.vertical_sigma_m,
            ),
            latency_sigma_s: least.abs().max(most.abs()).max(1e-3),
            heading_sigma_rad: model
                .given_heading_sigma_deg
                .unwrap_or_default()
                .to_radians(),
        }
    }

    /// What the core is told, for a log whose true noise nobody knows.
    pub fn of_config(config: &Config) -> Self {
        let sensors = &config.sensors;
        Self {
            gyro_noise: sensors.mean_gyro_noise(),
            gyro_bias_walk: sensors.gyro_bias_walk,
            gyro_bias_radps: sensors.gyro_bias_radps,
            accel_noise: sensors.mean_accel_noise(),
            accel_bias_walk: sensors.accel_bias_walk,
            accel_bias_mps2: sensors.accel_bias_mps2,
            velocity_sigma_mps: config.gnss.velocity_mps.white,
            position_sigma_m: Vector3::new(HORIZONTAL_M, HORIZONTAL_M, VERTICAL_M),
            latency_sigma_s: LATENCY_S,
            heading_sigma_rad: GIVEN_HEADING_RAD,
        }
    }

    /// As a user would guess who is wrong by a factor on the inertial sensors' noise and drift.
    ///
    /// Wrong by as much on GNSS is the same filter: only the ratio of the two acts.
    #[must_use]
    pub fn guessed(&self, factor: f64) -> Self {
        Self {
            gyro_noise: factor * self.gyro_noise,
            gyro_bias_walk: factor * self.gyro_bias_walk,
            accel_noise: factor * self.accel_noise,
            accel_bias_walk: factor * self.accel_bias_walk,
            ..*self
        }
    }

    /// Covariance where navigation begins, on a level, a heading and gyro biases known to some spread.
    pub(super) fn start(
        &self,
        speed_mps: f64,
        tilt_rad: Option<f64>,
        heading_rad: f64,
        gyro_radps: [f64; 3],
    ) -> StateMatrix {
        let moved = Vector3::repeat(START_AGE_S * speed_mps);
        let levelled = 2.0 * self.accel_bias_mps2 / GRAVITY_EQUATOR_MPS2 + LEVELLING_RAD;
        let tilt = tilt_rad.unwrap_or_default().max(levelled);
        let mut sigma = States::zeros();
        let mut set = |at: usize, values: Vector3<f64>| {
            sigma.fixed_rows_mut::<3>(at).copy_from(&values);
        };
        set(index::POSITION, 2.0 * self.position_sigma_m + moved);
        set(index::VELOCITY, Vector3::repeat(START_VELOCITY_MPS));
        set(index::ATTITUDE, Vector3::new(tilt, tilt, heading_rad));
        set(index::ACCEL, Vector3::repeat(self.accel_bias_mps2));
        set(index::GYRO, gyro_radps.into());
        sigma[index::LATENCY] = self.latency_sigma_s;
        StateMatrix::from_diagonal(&sigma.component_mul(&sigma))
    }

    /// Growth of the variances in a second.
    pub(super) fn growth(&self) -> States {
        let mut growth = States::zeros();
        let mut set = |at: usize, density: f64| {
            growth.fixed_rows_mut::<3>(at).fill(density * density);
        };
        set(index::VELOCITY, self.accel_noise);
        set(index::ATTITUDE, self.gyro_noise);
        set(index::ACCEL, self.accel_bias_walk);
        set(index::GYRO, self.gyro_bias_walk);
        growth
    }
}

/// Spread of a bias at the start, U.
fn start(model: &SensorModel) -> f64 {
    match model.bias {
        BiasModel::Wave { initial_sigma, .. } => initial_sigma,
        BiasModel::Continuous {
            initial_sigma,
            correlated_sigma,
            ..
        } => libm::hypot(initial_sigma, correlated_sigma),
    }
}

/// Walk of a bias, U/sqrt(s): that of its jumps, or the one with which correlated noise sets out.
fn walk(bias: &BiasModel) -> f64 {
    match *bias {
        BiasModel::Wave {
            interval_s,
            jump_sigma,
            jump_mean,
            ..
        } => libm::hypot(jump_sigma, jump_mean) / interval_s.sqrt(),
        BiasModel::Continuous {
            correlated_sigma,
            correlation_time_s,
            ..
        } => correlated_sigma * (2.0 / correlation_time_s).sqrt(),
    }
}
