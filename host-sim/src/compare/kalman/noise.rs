//! Noise model and priors of the filter.

use ins_core::attitude::matrix;
use ins_core::config::{self, GnssConfig, SensorConfig};
use ins_core::earth::GRAVITY_EQUATOR_MPS2;
use ins_core::mechanization::Mechanization;
use ins_core::{Config, GnssFix};
use nalgebra::{Matrix3, Vector3};

use super::{Kind, Layout, StateMatrix, index};
use crate::identify::quantities::DEG_H_RADPS;
use crate::sim::errors::{BiasModel, ErrorModel, GnssModel, SensorModel};
use crate::sim::receiver::Correlated;

/// Tilt error of levelling beyond that by accelerometer biases, rad.
const LEVELLING_RAD: f64 = 0.005;
/// Sigma of a heading given by the user, rad, where it is not stated.
const GIVEN_HEADING_RAD: f64 = 0.3;

/// Noise densities and priors, one sigma: the core's configuration, and what that does not contain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// The sensors; ranges, misalignments and g-sensitivity are not used.
    pub sensors: SensorConfig,
    /// The receiver; its noise is not adapted.
    pub gnss: GnssConfig,
    /// Whether a stated sigma of velocity is used as that of its white noise. One of positions never is:
    /// it is dominated by correlated noise, and with fixed ambiguities is a centimetre, which the time
    /// stamps of few loggers support.
    pub trusts_stated_sigma: bool,
    /// Sigma of a heading that is given at the start, rad.
    pub heading_sigma_rad: f64,
    pub uses_zero_rate: bool,
}

/// Sigma of white and coloured noise together.
pub(crate) fn total(noise: &config::Noise) -> f64 {
    libm::hypot(noise.white, noise.correlated)
}

/// Configuration of the core with the true error model of a simulated log.
///
/// A bounded bias process is modelled as a random walk of the same density.
pub(crate) fn config_of_model(model: &ErrorModel, config: Config) -> Config {
    let (gyro, accel) = (&model.gyro_deg_h, &model.accel_mps2);
    let densities = |sensor: &SensorModel, unit: f64| {
        let density = sensor.white_noise * unit;
        sensor.noise_times.map(|times| density * times)
    };
    let [least, most] = model.gnss.latency_s;
    Config {
        sensors: SensorConfig {
            gyro_noise: densities(gyro, DEG_H_RADPS),
            gyro_bias_walk: walk_density(&gyro.bias) * DEG_H_RADPS,
            gyro_bias_radps: gyro.bias.sigma_after(0.0) * DEG_H_RADPS,
            gyro_scale: gyro.scale_sigma,
            gyro_g_sensitivity: model.imu.gyro_g_sensitivity(),
            accel_noise: densities(accel, 1.0),
            accel_bias_walk: walk_density(&accel.bias),
            accel_bias_mps2: accel.bias.sigma_after(0.0),
            accel_scale: accel.scale_sigma,
            ..config.sensors
        },
        gnss: GnssConfig {
            latency_sigma_s: least.abs().max(most.abs()).max(1e-3),
            clock_drift_sigma: model.gnss.habits.clock_drift.abs(),
            lever_arm_m: model.gnss.habits.lever_arm_m,
            lever_arm_sigma_m: 0.0,
            ..gnss_config_of_model(&model.gnss, config.gnss)
        },
        ..config
    }
}

/// Configuration of a receiver with the true noise of its fixes.
pub(crate) fn gnss_config_of_model(model: &GnssModel, gnss: GnssConfig) -> GnssConfig {
    let noise = |white: f64, coloured: &Correlated, told: config::Noise| config::Noise {
        white,
        correlated: coloured.sigma,
        // Without coloured noise the configured correlation time is kept.
        correlation_s: if coloured.sigma > 0.0 {
            coloured.time_s
        } else {
            told.correlation_s
        },
    };
    let (habits, velocity_mps) = (&model.habits, model.velocity_sigma_mps);
    GnssConfig {
        velocity_mps: noise(velocity_mps, &habits.velocity, gnss.velocity_mps),
        velocity_up_mps: noise(velocity_mps, &habits.velocity, gnss.velocity_up_mps),
        position_m: noise(
            model.horizontal_sigma_m,
            &habits.horizontal,
            gnss.position_m,
        ),
        height_m: noise(model.vertical_sigma_m, &habits.vertical, gnss.height_m),
        ..gnss
    }
}

impl Noise {
    /// The true error model of a simulated log.
    pub fn of_model(model: &ErrorModel) -> Self {
        let heading_deg = model.given_heading_sigma_deg.unwrap_or_default();
        Self {
            trusts_stated_sigma: false,
            heading_sigma_rad: heading_deg.to_radians(),
            ..Self::of_config(&config_of_model(model, Config::hg1700()))
        }
    }

    /// The core's configuration, for a log whose true noise is unknown.
    pub fn of_config(config: &Config) -> Self {
        Self {
            sensors: config.sensors,
            gnss: config.gnss,
            trusts_stated_sigma: true,
            heading_sigma_rad: GIVEN_HEADING_RAD,
            uses_zero_rate: true,
        }
    }

    /// Mistuned by a factor on the noise and bias instability of the inertial sensors.
    ///
    /// The same factor on GNSS as well would give the same filter: only the ratio of the two acts.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let sensors = &self.sensors;
        Self {
            sensors: SensorConfig {
                gyro_noise: sensors.gyro_noise.map(|noise| factor * noise),
                gyro_bias_walk: factor * sensors.gyro_bias_walk,
                accel_noise: sensors.accel_noise.map(|noise| factor * noise),
                accel_bias_walk: factor * sensors.accel_bias_walk,
                ..*sensors
            },
            ..*self
        }
    }

    /// States for all parameters with a non-zero prior sigma.
    pub fn layout(&self) -> Layout {
        let mut size = index::COUNT;
        let mut add = |spread: f64, count: usize| {
            (spread > 0.0).then(|| {
                size += count;
                size - count
            })
        };
        Layout {
            clock_drift: add(self.gnss.clock_drift_sigma, 1),
            lever_arm: add(self.gnss.lever_arm_sigma_m, 3),
            accel_scale: add(self.sensors.accel_scale, 3),
            gyro_scale: add(self.sensors.gyro_scale, 3),
            coloured: Kind::ALL.map(|kind| add(self.of_kind(kind).correlated, kind.axes().len())),
            size,
        }
    }

    /// Noise of one component of a kind of measurement.
    pub fn of_kind(&self, kind: Kind) -> &config::Noise {
        match kind {
            Kind::Velocity => &self.gnss.velocity_mps,
            Kind::VelocityUp => &self.gnss.velocity_up_mps,
            Kind::Position => &self.gnss.position_m,
            Kind::Height => &self.gnss.height_m,
        }
    }

    /// Autocorrelation of a kind's coloured noise at a lag: its Gauss-Markov transition factor.
    pub fn correlation(&self, kind: Kind, seconds: f64) -> f64 {
        libm::exp(-seconds / self.of_kind(kind).correlation_s)
    }

    /// White noise of one component of a kind of measurement, one sigma.
    pub fn white_sigma(&self, kind: Kind, fix: &GnssFix) -> f64 {
        let stated = match kind {
            Kind::Velocity => fix.sigma.velocity_mps,
            // A single stated sigma is that of all components.
            Kind::VelocityUp => fix.sigma.velocity_up_mps.or(fix.sigma.velocity_mps),
            Kind::Position | Kind::Height => None,
        };
        stated
            .filter(|sigma| self.trusts_stated_sigma && *sigma > 0.0)
            .unwrap_or(self.of_kind(kind).white)
    }

    /// White and coloured noise of one component of a kind of measurement, one sigma.
    #[cfg(feature = "peers")]
    pub(crate) fn total_sigma(&self, kind: Kind, fix: &GnssFix) -> f64 {
        libm::hypot(self.white_sigma(kind, fix), self.of_kind(kind).correlated)
    }

    /// Tilt error of levelling by the accelerometers, rad.
    pub(super) fn levelling_error_rad(&self) -> f64 {
        let scale_mps2 = self.sensors.accel_scale * GRAVITY_EQUATOR_MPS2;
        let error_mps2 = libm::hypot(self.sensors.accel_bias_mps2, scale_mps2);
        2.0 * error_mps2 / GRAVITY_EQUATOR_MPS2 + LEVELLING_RAD
    }

    /// Process noise of INS and biases per second, at an attitude.
    pub(super) fn process_noise(&self, layout: &Layout, ins: &Mechanization) -> StateMatrix {
        let attitude = matrix(&ins.attitude);
        let rotated = |noise: [f64; 3]| {
            let noise = Vector3::from(noise);
            let power = Matrix3::from_diagonal(&noise.component_mul(&noise));
            attitude * power * attitude.transpose()
        };
        let walk = |density: f64| density * density * Matrix3::identity();
        let mut noise = StateMatrix::zeros(layout.size, layout.size);
        let mut set = |at: usize, block: Matrix3<f64>| {
            noise.fixed_view_mut::<3, 3>(at, at).copy_from(&block);
        };
        set(index::VELOCITY, rotated(self.sensors.accel_noise));
        set(index::ATTITUDE, rotated(self.sensors.gyro_noise));
        set(index::ACCEL, walk(self.sensors.accel_bias_walk));
        set(index::GYRO, walk(self.sensors.gyro_bias_walk));
        noise
    }
}

/// Random-walk density of a bias, U/sqrt(s): of its jumps, or the short-time one of correlated noise.
fn walk_density(bias: &BiasModel) -> f64 {
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
