//! Inertial sensors with errors.

use ins_core::ImuOutput;
use nalgebra::Vector3;

use super::errors::{BiasModel, ErrorModel, SensorModel};
use super::ideal::{Increments, Rates};
use super::noise::Random;

const DEG_RAD: f64 = core::f64::consts::PI / 180.0;

/// Gyros and accelerometers of one run.
#[derive(Clone, Debug)]
pub struct Imu {
    output: ImuOutput,
    /// The gyros, rad/s.
    pub gyros: Triad,
    /// The accelerometers, m/s^2.
    pub accels: Triad,
}

impl Imu {
    /// Draws the errors of run `seed`.
    pub fn new(model: &ErrorModel, seed: u64) -> Self {
        let gyro_range = model.imu.gyro_range_deg_s * DEG_RAD;
        let deg_h = DEG_RAD / 3600.0;
        Self {
            output: model.imu.output,
            gyros: Triad::new(&model.gyro_deg_h, deg_h, gyro_range, seed, "gyro"),
            accels: Triad::new(
                &model.accel_mps2,
                1.0,
                model.imu.accel_range_mps2,
                seed,
                "accel",
            ),
        }
    }

    /// Readings (gyro, accelerometer) at the end of a step over which the sensors gained `gained`.
    pub fn measure(
        &mut self,
        gained: &Increments,
        now: &Rates,
        step_s: f64,
    ) -> (Vector3<f64>, Vector3<f64>) {
        self.gyros.advance(step_s);
        self.accels.advance(step_s);
        match self.output {
            ImuOutput::Rates => self.measure_rates(now, step_s),
            ImuOutput::Increments => (
                step_s * self.gyros.read(&(gained.angle_b_rad / step_s), step_s),
                step_s * self.accels.read(&(gained.velocity_b_mps / step_s), step_s),
            ),
        }
    }

    /// Instantaneous readings; the noise is that of a bandwidth of half the sampling rate.
    pub fn measure_rates(&mut self, now: &Rates, step_s: f64) -> (Vector3<f64>, Vector3<f64>) {
        (
            self.gyros.read(&now.angular_rate_ib_b_radps, step_s),
            self.accels.read(&now.specific_force_b_mps2, step_s),
        )
    }
}

/// Three sensors of a kind.
#[derive(Clone, Debug)]
pub struct Triad {
    bias: [Bias; 3],
    scale: Vector3<f64>,
    noise_density: f64,
    range: f64,
    noise: Random,
}

impl Triad {
    fn new(model: &SensorModel, unit: f64, range: f64, seed: u64, name: &str) -> Self {
        let stream = |part: &str| Random::stream(seed, &format!("{name} {part}"));
        let mut scale = stream("scale");
        Self {
            bias: ["bias x", "bias y", "bias z"]
                .map(|axis| Bias::new(&model.bias, unit, stream(axis))),
            scale: Vector3::from(scale.normal3()) * model.scale_sigma,
            noise_density: model.white_noise * unit,
            range,
            noise: stream("noise"),
        }
    }

    /// The biases now.
    pub fn bias(&self) -> Vector3<f64> {
        Vector3::from([0, 1, 2].map(|axis| self.bias[axis].value()))
    }

    /// The scale-factor errors.
    pub fn scale(&self) -> Vector3<f64> {
        self.scale
    }

    fn advance(&mut self, step_s: f64) {
        for bias in &mut self.bias {
            bias.advance(step_s);
        }
    }

    fn read(&mut self, truth: &Vector3<f64>, step_s: f64) -> Vector3<f64> {
        let noise = Vector3::from(self.noise.normal3()) * (self.noise_density / step_s.sqrt());
        let reading = truth + self.scale.component_mul(truth) + self.bias() + noise;
        reading.map(|value| value.clamp(-self.range, self.range))
    }
}

/// The bias of one sensor.
#[derive(Clone, Debug)]
pub enum Bias {
    /// (3)
    Wave {
        /// Bias now.
        value: f64,
        /// Time left to the next jump, s.
        left_s: f64,
        /// Time between jumps, s.
        interval_s: f64,
        /// Mean and standard deviation of a jump.
        jump: [f64; 2],
        /// Source of the jumps.
        random: Random,
    },
    /// (4)
    Continuous {
        /// Constant and trend now.
        trend: f64,
        /// Slope of the trend, 1/s.
        slope_per_s: f64,
        /// Correlated part now.
        correlated: f64,
        /// Its standard deviation.
        sigma: f64,
        /// Its correlation time, s.
        correlation_time_s: f64,
        /// Source of the correlated part.
        random: Random,
    },
}

impl Bias {
    /// Draws the start of a bias; `unit` is the SI value of the model's unit.
    pub fn new(model: &BiasModel, unit: f64, mut random: Random) -> Self {
        match *model {
            BiasModel::Wave {
                initial_sigma,
                interval_s,
                jump_mean,
                jump_sigma,
            } => Self::Wave {
                value: unit * initial_sigma * random.normal(),
                left_s: interval_s,
                interval_s,
                jump: [unit * jump_mean, unit * jump_sigma],
                random,
            },
            BiasModel::Continuous {
                initial_sigma,
                slope_sigma_per_s,
                correlated_sigma,
                correlation_time_s,
            } => Self::Continuous {
                trend: unit * initial_sigma * random.normal(),
                slope_per_s: unit * slope_sigma_per_s * random.normal(),
                correlated: unit * correlated_sigma * random.normal(),
                sigma: unit * correlated_sigma,
                correlation_time_s,
                random,
            },
        }
    }

    /// The bias now.
    pub fn value(&self) -> f64 {
        match self {
            Self::Wave { value, .. } => *value,
            Self::Continuous {
                trend, correlated, ..
            } => trend + correlated,
        }
    }

    /// Moves on in time.
    pub fn advance(&mut self, step_s: f64) {
        match self {
            Self::Wave {
                value,
                left_s,
                interval_s,
                jump: [mean, sigma],
                random,
            } => {
                *left_s -= step_s;
                // Half a step of tolerance keeps rounding from delaying a jump by one sample.
                while *left_s < 0.5 * step_s {
                    *value += *mean + *sigma * random.normal();
                    *left_s += *interval_s;
                }
            }
            Self::Continuous {
                trend,
                slope_per_s,
                correlated,
                sigma,
                correlation_time_s,
                random,
            } => {
                *trend += *slope_per_s * step_s;
                if *sigma > 0.0 {
                    let keep = libm::exp(-step_s / *correlation_time_s);
                    *correlated =
                        keep * *correlated + *sigma * (1.0 - keep * keep).sqrt() * random.normal();
                }
            }
        }
    }
}
