//! What the filter is told of the sensors and the receiver.

use ins_core::attitude::matrix;
use ins_core::config::{self, GnssConfig, SensorConfig};
use ins_core::earth::GRAVITY_EQUATOR_MPS2;
use ins_core::mechanization::Mechanization;
use ins_core::{Config, GnssFix};
use nalgebra::{Matrix3, Vector3};

use super::{Layout, Part, StateMatrix, States, index};
use crate::identify::quantities::DEG_H_RADPS;
use crate::sim::errors::{BiasModel, ErrorModel, SensorModel};
use crate::sim::receiver::Correlated;

/// Spread of the velocity at the start, that of an old fix, m/s, and age of its position, s.
const START_VELOCITY_MPS: f64 = 1.0;
const START_AGE_S: f64 = 0.5;
/// Tilt that levelling leaves beyond what the accelerometer biases explain, rad.
const LEVELLING_RAD: f64 = 0.005;
/// Heading that the user gives, rad; where its spread is not known.
const GIVEN_HEADING_RAD: f64 = 0.3;

/// Noise of one component of a part of a fix: white, and a Gauss-Markov process beside it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PartNoise {
    /// White, one sigma of a fix; stands back where a fix states its own.
    pub white: f64,
    /// Correlated, one sigma; zero: there is none.
    pub colour: f64,
    /// Its correlation time, s.
    pub correlation_s: f64,
    /// Whether the sigma that a fix states is that of its white noise; else it is not looked at.
    pub believes_stated: bool,
}

impl PartNoise {
    /// White alone, unless a fix states another sigma.
    pub const fn white(sigma: f64) -> Self {
        Self {
            white: sigma,
            colour: 0.0,
            correlation_s: 1.0,
            believes_stated: true,
        }
    }

    /// As it is, whatever is stated.
    fn of(white: f64, correlated: &Correlated) -> Self {
        Self {
            white,
            colour: correlated.sigma,
            correlation_s: correlated.time_s,
            believes_stated: false,
        }
    }

    /// As the core is told.
    fn told(noise: &config::Noise, believes_stated: bool) -> Self {
        Self {
            white: noise.white,
            colour: noise.correlated,
            correlation_s: noise.correlation_s,
            believes_stated,
        }
    }

    /// The same for the core; where there is no colour, the time that it would have is kept.
    fn tell(&self, noise: config::Noise) -> config::Noise {
        config::Noise {
            white: self.white,
            correlated: self.colour,
            correlation_s: if self.colour > 0.0 {
                self.correlation_s
            } else {
                noise.correlation_s
            },
        }
    }

    /// Sigma of both together.
    pub fn total(&self) -> f64 {
        libm::hypot(self.white, self.colour)
    }

    /// Part of the coloured noise that is left after some time.
    pub fn kept(&self, seconds: f64) -> f64 {
        libm::exp(-seconds / self.correlation_s)
    }
}

/// Noise densities and spreads, one sigma.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Angular random walk of each gyro, body, rad/sqrt(s).
    pub gyro_noise: Vector3<f64>,
    /// Drift of a gyro bias, rad/s/sqrt(s).
    pub gyro_bias_walk: f64,
    /// Gyro bias at the start, rad/s.
    pub gyro_bias_radps: f64,
    /// Scale error of a gyro, 1; zero: calibrated.
    pub gyro_scale: f64,
    /// Velocity random walk of each accelerometer, body, m/s/sqrt(s).
    pub accel_noise: Vector3<f64>,
    /// Drift of an accelerometer bias, m/s^2/sqrt(s).
    pub accel_bias_walk: f64,
    /// Accelerometer bias at the start, m/s^2.
    pub accel_bias_mps2: f64,
    /// Scale error of an accelerometer, 1; zero: calibrated.
    pub accel_scale: f64,
    /// East and north velocity, m/s.
    pub velocity: PartNoise,
    /// Vertical velocity, m/s.
    pub velocity_up: PartNoise,
    /// East and north position, m.
    pub position: PartNoise,
    /// Height, m.
    pub height: PartNoise,
    /// Latency at the start, s.
    pub latency_sigma_s: f64,
    /// Rate at which the latency grows, s/s; zero: one clock stamps both.
    pub clock_drift_sigma: f64,
    /// Where the antenna is from the sensors, right-forward-up, m.
    pub lever_arm_m: Vector3<f64>,
    /// How well that is known, m; zero: exactly.
    pub lever_arm_sigma_m: Vector3<f64>,
    /// Spread of a heading that is given at the start, rad.
    pub heading_sigma_rad: f64,
    /// Whether gyros are read at rest.
    pub reads_rest: bool,
}

impl Noise {
    /// What really was put into a simulated log.
    ///
    /// A bias that wanders within bounds is taken for one that walks as fast.
    pub fn of_model(model: &ErrorModel) -> Self {
        let (gyro, accel) = (&model.gyro_deg_h, &model.accel_mps2);
        let gnss = &model.gnss;
        let habits = &gnss.habits;
        let [least, most] = gnss.latency_s;
        Self {
            gyro_noise: gyro.white_noise * DEG_H_RADPS * Vector3::from(gyro.noise_times),
            gyro_bias_walk: walk(&gyro.bias) * DEG_H_RADPS,
            gyro_bias_radps: start(gyro) * DEG_H_RADPS,
            gyro_scale: gyro.scale_sigma,
            accel_noise: accel.white_noise * Vector3::from(accel.noise_times),
            accel_bias_walk: walk(&accel.bias),
            accel_bias_mps2: start(accel),
            accel_scale: accel.scale_sigma,
            velocity: PartNoise::of(gnss.velocity_sigma_mps, &habits.velocity),
            velocity_up: PartNoise::of(gnss.velocity_sigma_mps, &habits.velocity),
            position: PartNoise::of(gnss.horizontal_sigma_m, &habits.horizontal),
            height: PartNoise::of(gnss.vertical_sigma_m, &habits.vertical),
            latency_sigma_s: least.abs().max(most.abs()).max(1e-3),
            clock_drift_sigma: habits.clock_drift.abs(),
            lever_arm_m: habits.lever_arm_m.into(),
            lever_arm_sigma_m: Vector3::zeros(),
            heading_sigma_rad: model
                .given_heading_sigma_deg
                .unwrap_or_default()
                .to_radians(),
            reads_rest: true,
        }
    }

    /// What the core is told, for a log whose true noise nobody knows.
    pub fn of_config(config: &Config) -> Self {
        let (sensors, gnss) = (&config.sensors, &config.gnss);
        Self {
            gyro_noise: Vector3::from(sensors.gyro_noise),
            gyro_bias_walk: sensors.gyro_bias_walk,
            gyro_bias_radps: sensors.gyro_bias_radps,
            gyro_scale: sensors.gyro_scale,
            accel_noise: Vector3::from(sensors.accel_noise),
            accel_bias_walk: sensors.accel_bias_walk,
            accel_bias_mps2: sensors.accel_bias_mps2,
            accel_scale: sensors.accel_scale,
            velocity: PartNoise::told(&gnss.velocity_mps, true),
            velocity_up: PartNoise::told(&gnss.velocity_up_mps, true),
            // A sigma that is stated of positions is that of the place and not of the moment, and
            // with fixed ambiguities a centimetre, which the stamps of few loggers are worth.
            position: PartNoise::told(&gnss.position_m, false),
            height: PartNoise::told(&gnss.height_m, false),
            latency_sigma_s: gnss.latency_sigma_s,
            clock_drift_sigma: gnss.clock_drift_sigma,
            lever_arm_m: Vector3::from(gnss.lever_arm_m),
            lever_arm_sigma_m: Vector3::repeat(gnss.lever_arm_sigma_m),
            heading_sigma_rad: GIVEN_HEADING_RAD,
            reads_rest: true,
        }
    }

    /// A configuration of the core by the same knowledge.
    pub fn tell(&self, config: Config) -> Config {
        let sensors = SensorConfig {
            gyro_noise: self.gyro_noise.into(),
            gyro_bias_walk: self.gyro_bias_walk,
            gyro_bias_radps: self.gyro_bias_radps,
            gyro_scale: self.gyro_scale,
            accel_noise: self.accel_noise.into(),
            accel_bias_walk: self.accel_bias_walk,
            accel_bias_mps2: self.accel_bias_mps2,
            accel_scale: self.accel_scale,
            ..config.sensors
        };
        let gnss = GnssConfig {
            latency_sigma_s: self.latency_sigma_s,
            clock_drift_sigma: self.clock_drift_sigma,
            lever_arm_m: self.lever_arm_m.into(),
            lever_arm_sigma_m: self.lever_arm_sigma_m.max(),
            ..self.tell_of_fixes(config.gnss)
        };
        Config {
            sensors,
            gnss,
            ..config
        }
    }

    /// What the core is told of a receiver, by the noise of its fixes.
    pub fn tell_of_fixes(&self, gnss: GnssConfig) -> GnssConfig {
        GnssConfig {
            velocity_mps: self.velocity.tell(gnss.velocity_mps),
            velocity_up_mps: self.velocity_up.tell(gnss.velocity_up_mps),
            position_m: self.position.tell(gnss.position_m),
            height_m: self.height.tell(gnss.height_m),
            ..gnss
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
            clock_drift: room(self.clock_drift_sigma, 1),
            lever_arm: room(self.lever_arm_sigma_m.max(), 3),
            accel_scale: room(self.accel_scale, 3),
            gyro_scale: room(self.gyro_scale, 3),
            colour: Part::ALL.map(|part| room(self.part(part).colour, part.axes().len())),
            size,
        }
    }

    /// Of a part of a fix.
    pub fn part(&self, part: Part) -> &PartNoise {
        match part {
            Part::Velocity => &self.velocity,
            Part::VelocityUp => &self.velocity_up,
            Part::Position => &self.position,
            Part::Height => &self.height,
        }
    }

    /// White noise of one component of a part of a fix, one sigma.
    pub fn white_of(&self, part: Part, fix: &GnssFix) -> f64 {
        let stated = match part {
            Part::Velocity => fix.sigma.velocity_mps,
            // A receiver that has one sigma for all has it for this one.
            Part::VelocityUp => fix.sigma.velocity_up_mps.or(fix.sigma.velocity_mps),
            Part::Position => fix.sigma.position_m,
            Part::Height => fix.sigma.height_m,
        };
        let told = self.part(part);
        stated
            .filter(|sigma| told.believes_stated && *sigma > 0.0)
            .unwrap_or(told.white)
    }

    /// White and coloured noise of one component of a part of a fix together, one sigma.
    pub fn total_of(&self, part: Part, fix: &GnssFix) -> f64 {
        libm::hypot(self.white_of(part, fix), self.part(part).colour)
    }

    /// Covariance where navigation begins, on a level, a heading and gyro biases known to some
    /// spread.
    pub(super) fn start(
        &self,
        layout: &Layout,
        speed_mps: f64,
        tilt_rad: Option<f64>,
        heading_rad: f64,
        gyro_radps: [f64; 3],
    ) -> StateMatrix {
        let moved = Vector3::repeat(START_AGE_S * speed_mps);
        let (level, up) = (self.position.total(), self.height.total());
        let tilt = tilt_rad.unwrap_or_default().max(self.levelled_rad());
        let mut sigma = States::zeros(layout.size);
        let mut set = |at: usize, values: Vector3<f64>| {
            sigma.fixed_rows_mut::<3>(at).copy_from(&values);
        };
        let place = 2.0 * Vector3::new(level, level, up) + moved;
        set(index::POSITION, place);
        set(index::VELOCITY, Vector3::repeat(START_VELOCITY_MPS));
        set(index::ATTITUDE, Vector3::new(tilt, tilt, heading_rad));
        set(index::ACCEL, Vector3::repeat(self.accel_bias_mps2));
        set(index::GYRO, gyro_radps.into());
        let mut set_any = |at: Option<usize>, values| at.into_iter().for_each(|at| set(at, values));
        set_any(layout.lever_arm, self.lever_arm_sigma_m);
        set_any(layout.accel_scale, Vector3::repeat(self.accel_scale));
        set_any(layout.gyro_scale, Vector3::repeat(self.gyro_scale));
        sigma[index::LATENCY] = self.latency_sigma_s;
        if let Some(at) = layout.clock_drift {
            sigma[at] = self.clock_drift_sigma;
        }
        for part in Part::ALL {
            if let Some(at) = layout.colour(part) {
                sigma
                    .rows_mut(at, part.axes().len())
                    .fill(self.part(part).colour);
            }
        }
        StateMatrix::from_diagonal(&sigma.component_mul(&sigma))
    }

    /// Tilt that levelling on the accelerometers leaves, rad.
    fn levelled_rad(&self) -> f64 {
        let scale_mps2 = self.accel_scale * GRAVITY_EQUATOR_MPS2;
        let error_mps2 = libm::hypot(self.accel_bias_mps2, scale_mps2);
        2.0 * error_mps2 / GRAVITY_EQUATOR_MPS2 + LEVELLING_RAD
    }

    /// Growth of the covariance of INS and biases in a second, at an attitude.
    pub(super) fn growth(&self, layout: &Layout, ins: &Mechanization) -> StateMatrix {
        let attitude = matrix(&ins.attitude);
        let turned = |noise: &Vector3<f64>| {
            let power = Matrix3::from_diagonal(&noise.component_mul(noise));
            attitude * power * attitude.transpose()
        };
        let walk = |density: f64| density * density * Matrix3::identity();
        let mut growth = StateMatrix::zeros(layout.size, layout.size);
        let mut set = |at: usize, block: Matrix3<f64>| {
            growth.fixed_view_mut::<3, 3>(at, at).copy_from(&block);
        };
        set(index::VELOCITY, turned(&self.accel_noise));
        set(index::ATTITUDE, turned(&self.gyro_noise));
        set(index::ACCEL, walk(self.accel_bias_walk));
        set(index::GYRO, walk(self.gyro_bias_walk));
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
