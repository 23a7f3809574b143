//! What the filter is told of the sensors and the receiver.

use ins_core::attitude::matrix;
use ins_core::config::{self, GnssConfig, SensorConfig};
use ins_core::earth::GRAVITY_EQUATOR_MPS2;
use ins_core::mechanization::Mechanization;
use ins_core::{Config, GnssFix};
use nalgebra::{Matrix3, Vector3};

use super::{Layout, Part, StateMatrix, index};
use crate::identify::quantities::DEG_H_RADPS;
use crate::sim::errors::{BiasModel, ErrorModel, GnssModel, SensorModel};
use crate::sim::receiver::Correlated;

/// Tilt that levelling leaves beyond what the accelerometer biases explain, rad.
const LEVELLING_RAD: f64 = 0.005;
/// Heading that the user gives, rad; where its spread is not known.
const GIVEN_HEADING_RAD: f64 = 0.3;

/// Noise densities and spreads, one sigma: what the core is told, and what it has no word for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// The sensors; of their ranges and misalignments the filter knows nothing.
    pub sensors: SensorConfig,
    /// The receiver; nothing of its noise is learnt.
    pub gnss: GnssConfig,
    /// Whether the sigma that a fix states of its velocity is that of its white noise; else it is
    /// not looked at. One that is stated of positions never is: it is that of the place and not of
    /// the moment, and with fixed ambiguities a centimetre, which the stamps of few loggers are
    /// worth.
    pub believes_stated: bool,
    /// Spread of a heading that is given at the start, rad.
    pub heading_sigma_rad: f64,
    pub reads_rest: bool,
}

/// Sigma of white and coloured noise together.
pub(crate) fn total(noise: &config::Noise) -> f64 {
    libm::hypot(noise.white, noise.correlated)
}

/// A configuration of the core by what really was put into a simulated log.
///
/// A bias that wanders within bounds is taken for one that walks as fast.
pub(crate) fn tell(model: &ErrorModel, config: Config) -> Config {
    let (gyro, accel) = (&model.gyro_deg_h, &model.accel_mps2);
    let white = |sensor: &SensorModel, unit: f64| {
        let density = sensor.white_noise * unit;
        sensor.noise_times.map(|times| density * times)
    };
    let [least, most] = model.gnss.latency_s;
    Config {
        sensors: SensorConfig {
            gyro_noise: white(gyro, DEG_H_RADPS),
            gyro_bias_walk: walk(&gyro.bias) * DEG_H_RADPS,
            gyro_bias_radps: gyro.bias.sigma_after(0.0) * DEG_H_RADPS,
            gyro_scale: gyro.scale_sigma,
            accel_noise: white(accel, 1.0),
            accel_bias_walk: walk(&accel.bias),
            accel_bias_mps2: accel.bias.sigma_after(0.0),
            accel_scale: accel.scale_sigma,
            ..config.sensors
        },
        gnss: GnssConfig {
            latency_sigma_s: least.abs().max(most.abs()).max(1e-3),
            clock_drift_sigma: model.gnss.habits.clock_drift.abs(),
            lever_arm_m: model.gnss.habits.lever_arm_m,
            lever_arm_sigma_m: 0.0,
            ..tell_of_fixes(&model.gnss, config.gnss)
        },
        ..config
    }
}

/// What the core is told of a receiver, by the noise of its fixes.
pub(crate) fn tell_of_fixes(model: &GnssModel, gnss: GnssConfig) -> GnssConfig {
    let noise = |white: f64, colour: &Correlated, told: config::Noise| config::Noise {
        white,
        correlated: colour.sigma,
        // Where there is no colour, the time that it would have is kept.
        correlation_s: if colour.sigma > 0.0 {
            colour.time_s
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
    /// What really was put into a simulated log.
    pub fn of_model(model: &ErrorModel) -> Self {
        let heading_deg = model.given_heading_sigma_deg.unwrap_or_default();
        Self {
            believes_stated: false,
            heading_sigma_rad: heading_deg.to_radians(),
            ..Self::of_config(&tell(model, Config::hg1700()))
        }
    }

    /// What the core is told, for a log whose true noise nobody knows.
    pub fn of_config(config: &Config) -> Self {
        Self {
            sensors: config.sensors,
            gnss: config.gnss,
            believes_stated: true,
            heading_sigma_rad: GIVEN_HEADING_RAD,
            reads_rest: true,
        }
    }

    /// As a user would guess who is wrong by a factor on the inertial sensors' noise and drift.
    ///
    /// Wrong by as much on GNSS is the same filter: only the ratio of the two acts.
    #[must_use]
    pub fn guessed(&self, factor: f64) -> Self {
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

    /// What it leaves to find.
    pub fn layout(&self) -> Layout {
        let mut size = index::COUNT;
        let mut room = |spread: f64, count: usize| {
            (spread > 0.0).then(|| {
                size += count;
                size - count
            })
        };
        Layout {
            clock_drift: room(self.gnss.clock_drift_sigma, 1),
            lever_arm: room(self.gnss.lever_arm_sigma_m, 3),
            accel_scale: room(self.sensors.accel_scale, 3),
            gyro_scale: room(self.sensors.gyro_scale, 3),
            colour: Part::ALL.map(|part| room(self.part(part).correlated, part.axes().len())),
            size,
        }
    }

    /// Of one component of a part of a fix.
    pub fn part(&self, part: Part) -> &config::Noise {
        match part {
            Part::Velocity => &self.gnss.velocity_mps,
            Part::VelocityUp => &self.gnss.velocity_up_mps,
            Part::Position => &self.gnss.position_m,
            Part::Height => &self.gnss.height_m,
        }
    }

    /// What is left of a part's coloured noise after some time.
    pub fn kept(&self, part: Part, seconds: f64) -> f64 {
        libm::exp(-seconds / self.part(part).correlation_s)
    }

    /// White noise of one component of a part of a fix, one sigma.
    pub fn white_of(&self, part: Part, fix: &GnssFix) -> f64 {
        let stated = match part {
            Part::Velocity => fix.sigma.velocity_mps,
            // A receiver that has one sigma for all has it for this one.
            Part::VelocityUp => fix.sigma.velocity_up_mps.or(fix.sigma.velocity_mps),
            Part::Position | Part::Height => None,
        };
        stated
            .filter(|sigma| self.believes_stated && *sigma > 0.0)
            .unwrap_or(self.part(part).white)
    }

    /// White and coloured noise of one component of a part of a fix together, one sigma.
    #[cfg(feature = "peers")]
    pub(crate) fn total_of(&self, part: Part, fix: &GnssFix) -> f64 {
        libm::hypot(self.white_of(part, fix), self.part(part).correlated)
    }

    /// Tilt that levelling on the accelerometers leaves, rad.
    pub(super) fn levelled_rad(&self) -> f64 {
        let scale_mps2 = self.sensors.accel_scale * GRAVITY_EQUATOR_MPS2;
        let error_mps2 = libm::hypot(self.sensors.accel_bias_mps2, scale_mps2);
        2.0 * error_mps2 / GRAVITY_EQUATOR_MPS2 + LEVELLING_RAD
    }

    /// Growth of the covariance of INS and biases in a second, at an attitude.
    pub(super) fn growth(&self, layout: &Layout, ins: &Mechanization) -> StateMatrix {
        let attitude = matrix(&ins.attitude);
        let turned = |noise: [f64; 3]| {
            let noise = Vector3::from(noise);
            let power = Matrix3::from_diagonal(&noise.component_mul(&noise));
            attitude * power * attitude.transpose()
        };
        let walk = |density: f64| density * density * Matrix3::identity();
        let mut growth = StateMatrix::zeros(layout.size, layout.size);
        let mut set = |at: usize, block: Matrix3<f64>| {
            growth.fixed_view_mut::<3, 3>(at, at).copy_from(&block);
        };
        set(index::VELOCITY, turned(self.sensors.accel_noise));
        set(index::ATTITUDE, turned(self.sensors.gyro_noise));
        set(index::ACCEL, walk(self.sensors.accel_bias_walk));
        set(index::GYRO, walk(self.sensors.gyro_bias_walk));
        growth
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
