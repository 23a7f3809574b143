//! Inertial sensors with errors.

use ins_core::ImuOutput;
use nalgebra::{Matrix3, Vector3};

use super::errors::{BiasModel, ErrorModel, SensorModel};
use super::ideal::{Increments, Rates};
use super::noise::Random;
use super::recorded::Resampled;

const DEG_RAD: f64 = core::f64::consts::PI / 180.0;

/// Of gyros, rad/s, and accelerometers, m/s^2: errors without those by scale errors and misalignments.
pub type Biases = [Vector3<f64>; 2];

#[derive(Clone, Debug)]
pub struct Imu {
    output: ImuOutput,
    pub gyros: Triad,
    pub accels: Triad,
    /// Response of the gyros to specific force, rad/s per m/s^2.
    pub g_sensitivity: Matrix3<f64>,
    /// Recorded noise in place of white noise, if any.
    pub recorded: Option<Resampled>,
}

impl Imu {
    pub fn new(model: &ErrorModel, seed: u64) -> Self {
        let gyro_range = model.imu.gyro_range_deg_s * DEG_RAD;
        let deg_h = DEG_RAD / 3600.0;
        let per_mps2 = model.imu.gyro_g_sensitivity();
        let mut response = Random::stream(seed, "gyro g-sensitivity");
        Self {
            output: model.imu.output,
            gyros: Triad::new(&model.gyro_deg_h, deg_h, gyro_range, seed, "gyro"),
            accels: Triad::new(
                &model.accel_mps2,
                1.0,
                model.imu.accel_range_mps2,
                seed,
                "accel",
            )
            .with_symmetric_misalignment(),
            g_sensitivity: Matrix3::from_fn(|_, _| per_mps2 * response.normal()),
            recorded: None,
        }
    }

    /// Current biases.
    pub fn biases(&self) -> Biases {
        [self.gyros.bias(), self.accels.bias()]
    }

    /// Readings (gyro, accelerometer) at the end of a step with increments `gained`.
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
            ImuOutput::Increments => {
                let mean = Rates {
                    angular_rate_ib_b_radps: gained.angle_b_rad / step_s,
                    specific_force_b_mps2: gained.velocity_b_mps / step_s,
                };
                let (gyro, accel) = self.measure_rates(&mean, step_s);
                (step_s * gyro, step_s * accel)
            }
        }
    }

    /// Instantaneous readings; the noise is that of a bandwidth of half the sampling rate.
    pub fn measure_rates(&mut self, now: &Rates, step_s: f64) -> (Vector3<f64>, Vector3<f64>) {
        let [gyro, accel] = match &mut self.recorded {
            Some(recorded) => recorded.step(),
            None => [&mut self.gyros, &mut self.accels].map(|triad| triad.white_noise(step_s)),
        };
        let force = &now.specific_force_b_mps2;
        let pulled = self.g_sensitivity * force;
        (
            self.gyros
                .read(&now.angular_rate_ib_b_radps, &(gyro + pulled)),
            self.accels.read(force, &accel),
        )
    }
}

#[derive(Clone, Debug)]
pub struct Triad {
    bias: [Bias; 3],
    /// Change of the biases during warm-up, and the part of it that remains.
    warming: Vector3<f64>,
    warming_left: f64,
    warming_s: f64,
    scale: Vector3<f64>,
    misalignment: Matrix3<f64>,
    noise_density: Vector3<f64>,
    resolution: f64,
    range: f64,
    noise: Random,
}

impl Triad {
    fn new(model: &SensorModel, unit: f64, range: f64, seed: u64, name: &str) -> Self {
        let stream = |part: &str| Random::stream(seed, &format!("{name} {part}"));
        let mut warming = stream("warming");
        let mut scale = stream("scale");
        let mut misalignment = stream("misalignment");
        Self {
            bias: ["bias x", "bias y", "bias z"]
                .map(|axis| Bias::new(&model.bias, unit, stream(axis))),
            warming: Vector3::from(warming.normal3()) * (unit * model.warming_sigma),
            warming_left: 1.0,
            warming_s: model.warming_s,
            scale: Vector3::from(scale.normal3()) * model.scale_sigma,
            misalignment: Matrix3::from_fn(|axis, of| {
                let drawn = misalignment.normal();
                if axis == of {
                    0.0
                } else {
                    model.misalignment_sigma * drawn
                }
            }),
            noise_density: model.white_noise * unit * Vector3::from(model.noise_times),
            resolution: unit * model.resolution,
            range,
            noise: stream("noise"),
        }
    }

    pub fn bias(&self) -> Vector3<f64> {
        let drifted = Vector3::from([0, 1, 2].map(|axis| self.bias[axis].value()));
        drifted + self.warming * (1.0 - self.warming_left)
    }

    /// Scale errors and misalignments: errors proportional to the truth.
    pub fn error_matrix(&self) -> Matrix3<f64> {
        Matrix3::from_diagonal(&self.scale) + self.misalignment
    }

    /// The same sensors in the body axes that they define: the antisymmetric part is a rotation.
    fn with_symmetric_misalignment(mut self) -> Self {
        let upper = self.misalignment.upper_triangle();
        self.misalignment = upper + upper.transpose();
        self
    }

    fn advance(&mut self, step_s: f64) {
        for bias in &mut self.bias {
            bias.advance(step_s);
        }
        if self.warming != Vector3::zeros() {
            self.warming_left *= libm::exp(-step_s / self.warming_s);
        }
    }

    fn white_noise(&mut self, step_s: f64) -> Vector3<f64> {
        let sigma = self.noise_density / step_s.sqrt();
        Vector3::from(self.noise.normal3()).component_mul(&sigma)
    }

    fn read(&self, truth: &Vector3<f64>, noise: &Vector3<f64>) -> Vector3<f64> {
        let proportional = self.scale.component_mul(truth) + self.misalignment * truth;
        let reading = truth + proportional + self.bias() + noise;
        let rounded = if self.resolution > 0.0 {
            reading.map(|value| self.resolution * (value / self.resolution).round())
        } else {
            reading
        };
        rounded.map(|value| value.clamp(-self.range, self.range))
    }
}

#[derive(Clone, Debug)]
struct Bias {
    model: BiasModel,
    /// SI value of the model's unit.
    unit: f64,
    /// Constant with accumulated jumps or trend.
    constant: f64,
    slope_per_s: f64,
    correlated: f64,
    to_next_jump_s: f64,
    random: Random,
}

impl Bias {
    /// Draws the start of a bias; `unit` is the SI value of the model's unit.
    fn new(model: &BiasModel, unit: f64, mut random: Random) -> Self {
        let mut draw = |sigma: f64| unit * sigma * random.normal();
        let constant = draw(model.initial_sigma());
        let (slope_per_s, correlated, to_next_jump_s) = match *model {
            BiasModel::Wave { interval_s, .. } => (0.0, 0.0, interval_s),
            BiasModel::Continuous {
                slope_sigma_per_s,
                correlated_sigma,
                ..
            } => (draw(slope_sigma_per_s), draw(correlated_sigma), 0.0),
        };
        Self {
            model: model.clone(),
            unit,
            constant,
            slope_per_s,
            correlated,
            to_next_jump_s,
            random,
        }
    }

    fn value(&self) -> f64 {
        match self.model {
            BiasModel::Wave { .. } => self.constant,
            BiasModel::Continuous { .. } => self.constant + self.correlated,
        }
    }

    fn advance(&mut self, step_s: f64) {
        match self.model {
            BiasModel::Wave {
                interval_s,
                jump_mean,
                jump_sigma,
                ..
            } => {
                self.to_next_jump_s -= step_s;
                // Half a step of tolerance keeps rounding from delaying a jump by one sample.
                while self.to_next_jump_s < 0.5 * step_s {
                    let random = self.unit * jump_sigma * self.random.normal();
                    self.constant += self.unit * jump_mean + random;
                    self.to_next_jump_s += interval_s;
                }
            }
            BiasModel::Continuous {
                correlated_sigma,
                correlation_time_s,
                ..
            } => {
                self.constant += self.slope_per_s * step_s;
                let sigma = self.unit * correlated_sigma;
                if sigma > 0.0 {
                    let factor = libm::exp(-step_s / correlation_time_s);
                    let driving = sigma * (1.0 - factor * factor).sqrt() * self.random.normal();
                    self.correlated = factor * self.correlated + driving;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::noise::statistics::{assert_correlation, assert_mean, assert_sigma};
    use super::*;

    const RUNS: u64 = 5000;

    fn runs(model: &BiasModel) -> Vec<Bias> {
        (0..RUNS)
            .map(|seed| Bias::new(model, 1.0, Random::stream(seed, "test")))
            .collect()
    }

    fn advance(runs: &mut [Bias], step_s: f64) {
        for bias in runs {
            bias.advance(step_s);
        }
    }

    fn values(runs: &[Bias]) -> Vec<f64> {
        runs.iter().map(Bias::value).collect()
    }

    fn noisy(white_noise: f64, scale_sigma: f64) -> SensorModel {
        SensorModel {
            scale_sigma,
            ..SensorModel::new(BiasModel::constant(0.0), white_noise)
        }
    }

    #[test]
    fn the_wave_model_jumps_when_and_as_far_as_it_says() {
        let model = BiasModel::Wave {
            initial_sigma: 2.0,
            interval_s: 7.0,
            jump_mean: 0.3,
            jump_sigma: 0.5,
        };
        let mut runs = runs(&model);
        let start = values(&runs);
        assert_sigma(&start, 2.0);
        // 0.01 is no binary fraction: the sum of 700 steps is not 7 exactly.
        let mut last = start.clone();
        for step in 1..=2100 {
            advance(&mut runs, 0.01);
            let now = values(&runs);
            if step % 700 == 0 {
                let jumps: Vec<f64> = now.iter().zip(&last).map(|(n, l)| n - l - 0.3).collect();
                assert_mean(&jumps, 0.0, 0.5);
                assert_sigma(&jumps, 0.5);
                assert_correlation(&jumps, &start, 0.0);
            } else {
                assert_eq!(now, last, "jumped at step {step}");
            }
            last = now;
        }
    }

    #[test]
    fn the_continuous_model_has_the_spread_and_the_memory_it_says() {
        let model = BiasModel::Continuous {
            initial_sigma: 0.0,
            slope_sigma_per_s: 0.0,
            correlated_sigma: 3.0,
            correlation_time_s: 20.0,
        };
        let mut runs = runs(&model);
        let start = values(&runs);
        assert_sigma(&start, 3.0);
        for _ in 0..200 {
            advance(&mut runs, 0.1);
        }
        let later = values(&runs);
        assert_sigma(&later, 3.0);
        assert_correlation(&start, &later, (-1.0_f64).exp());
        // Steps of any length: after two thousand seconds there is no correlation.
        advance(&mut runs, 2000.0);
        assert_sigma(&values(&runs), 3.0);
        assert_correlation(&start, &values(&runs), 0.0);
    }

    #[test]
    fn the_continuous_model_starts_and_trends_as_it_says() {
        let mut runs = runs(&BiasModel::Continuous {
            initial_sigma: 2.0,
            slope_sigma_per_s: 0.01,
            correlated_sigma: 0.0,
            correlation_time_s: 1.0,
        });
        let start = values(&runs);
        assert_sigma(&start, 2.0);
        for _ in 0..100 {
            advance(&mut runs, 1.0);
        }
        let gained: Vec<f64> = values(&runs)
            .iter()
            .zip(&start)
            .map(|(n, s)| n - s)
            .collect();
        assert_sigma(&gained, 1.0);
        assert_correlation(&gained, &start, 0.0);
    }

    #[test]
    fn white_noise_has_the_density_it_says_and_no_memory() {
        let (density, step_s) = (3.6e-5, 0.01);
        let mut triad = Triad::new(&noisy(density, 0.0), 1.0, 1.0, 9, "gyro");
        let readings: Vec<Vector3<f64>> = (0..400_000).map(|_| triad.white_noise(step_s)).collect();
        for axis in 0..3 {
            let x: Vec<f64> = readings.iter().map(|r| r[axis]).collect();
            assert_sigma(&x, density / step_s.sqrt());
            assert_correlation(&x, &x[1..], 0.0);
            let next: Vec<f64> = readings.iter().map(|r| r[(axis + 1) % 3]).collect();
            assert_correlation(&x, &next, 0.0);
        }
    }

    #[test]
    fn increments_and_rates_carry_the_same_errors() {
        let measure = |output| {
            let mut model = ErrorModel::hg1700();
            model.imu.output = output;
            let rates = Rates {
                angular_rate_ib_b_radps: Vector3::new(0.1, -0.2, 0.3),
                specific_force_b_mps2: Vector3::new(1.0, 2.0, 9.8),
            };
            let gained = Increments {
                angle_b_rad: 0.01 * rates.angular_rate_ib_b_radps,
                velocity_b_mps: 0.01 * rates.specific_force_b_mps2,
            };
            Imu::new(&model, 3).measure(&gained, &rates, 0.01)
        };
        let (angle, velocity) = measure(ImuOutput::Increments);
        let (rate, force) = measure(ImuOutput::Rates);
        assert!((angle - 0.01 * rate).norm() < 1e-15);
        assert!((velocity - 0.01 * force).norm() < 1e-15);
    }

    #[test]
    fn scale_errors_spread_as_told_and_multiply() {
        let triads = (0..RUNS).map(|seed| Triad::new(&noisy(0.0, 0.015), 1.0, 1e3, seed, "accel"));
        let (mut all, truth) = (Vec::new(), Vector3::new(1.0, -2.0, 9.8));
        for triad in triads {
            let error = triad.read(&truth, &Vector3::zeros()) - truth;
            assert!((error - triad.scale.component_mul(&truth)).norm() < 1e-14);
            all.extend(triad.scale.iter());
        }
        assert_sigma(&all, 0.015);
    }

    #[test]
    fn gyros_answer_to_specific_force_as_told() {
        let mut model = ErrorModel::ideal();
        model.imu.output = ImuOutput::Rates;
        model.imu.gyro_g_sensitivity_deg_h_g = 72.0;
        let at_rest = Rates {
            angular_rate_ib_b_radps: Vector3::zeros(),
            specific_force_b_mps2: Vector3::new(0.0, 0.0, 9.81),
        };
        let units = (0..RUNS).map(|seed| Imu::new(&model, seed));
        let read = units.map(|mut unit| unit.measure_rates(&at_rest, 0.01));
        let all: Vec<f64> = read
            .flat_map(|(gyro, _)| [gyro.x, gyro.y, gyro.z])
            .collect();
        assert_sigma(&all, 0.02_f64.to_radians());
    }

    #[test]
    fn readings_are_rounded() {
        let model = SensorModel {
            resolution: 0.5,
            ..noisy(0.0, 0.0)
        };
        let triad = Triad::new(&model, 1.0, 39.0, 0, "accel");
        let reading = triad.read(&Vector3::new(0.2, -0.3, 9.8), &Vector3::zeros());
        assert_eq!(reading, Vector3::new(0.0, -0.5, 10.0));
    }

    #[test]
    fn readings_saturate() {
        let triad = Triad::new(&noisy(0.0, 0.0), 1.0, 39.0, 0, "accel");
        let reading = triad.read(&Vector3::new(50.0, -50.0, 9.8), &Vector3::zeros());
        assert_eq!(reading, Vector3::new(39.0, -39.0, 9.8));
    }
}
