//! Simulated runs: a motion, sensors with errors, and the log that a logger would have written.

use ins_core::earth::{Geodetic, LocalEarth, wrap_pi};
use ins_core::{BaroHeight, GnssFix, ImuOutput, ImuSample, Solution, Time};
use nalgebra::{Matrix3, Vector3};

use super::car::Car;
use super::errors::{ErrorModel, MAX_JITTER};
use super::gnss::{Gnss, arrivals};
use super::ideal::{IdealSensors, TrueState};
use super::imu::{Biases, Imu};
use super::motion::Motion;
use super::noise::Random;
use super::recorded::{RecordedNoise, Resampled};
use crate::log::{BodyAxes, Grade, Log, Meta};

impl Grade {
    /// Error model of a preset unit.
    pub fn errors(self) -> ErrorModel {
        match self {
            Self::Hg1700 => ErrorModel::hg1700(),
            Self::Mems => ErrorModel::mems(),
        }
    }
}

/// Default rate of inertial samples.
pub const IMU_HZ: f64 = 100.0;

#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Seed of all random numbers.
    pub seed: u64,
    pub duration_s: f64,
    pub imu_hz: f64,
    /// Number of inertial samples per truth record.
    pub truth_every: u32,
    pub origin: Geodetic,
    pub errors: ErrorModel,
}

/// Number of inertial samples per truth record for some ten records a second.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
pub(crate) fn truth_stride(imu_hz: f64) -> u32 {
    (imu_hz / 10.0).round().max(1.0) as u32
}

#[derive(Clone, Debug, PartialEq)]
pub struct DriveConfig {
    /// How it is recorded; the seed also chooses the route.
    pub recording: Recording,
    /// Bounds of the time at rest at the beginning, s; `None`: it begins in motion.
    pub initial_rest_s: Option<[f64; 2]>,
}

impl DriveConfig {
    /// A drive in the middle latitudes at 100 Hz, truth at 10 Hz, 30 to 120 s of rest first.
    pub fn new(seed: u64, grade: Grade, minutes: f64) -> Self {
        Self {
            recording: Recording {
                seed,
                duration_s: 60.0 * minutes,
                imu_hz: IMU_HZ,
                truth_every: 10,
                origin: Geodetic {
                    latitude_rad: 55.75_f64.to_radians(),
                    longitude_rad: 37.6_f64.to_radians(),
                    height_m: 150.0,
                },
                errors: grade.errors(),
            },
            initial_rest_s: Some([30.0, 120.0]),
        }
    }

    /// The same with sensors and a receiver without errors.
    pub fn ideal(seed: u64, minutes: f64) -> Self {
        let mut config = Self::new(seed, Grade::Hg1700, minutes);
        config.recording.errors = ErrorModel::ideal();
        config
    }
}

/// What was recorded, with the truth and the errors.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedDrive {
    /// As measured, in the output form of the error model.
    pub imu: Vec<ImuSample>,
    pub gnss: Vec<GnssFix>,
    /// When each fix arrives, not before its stamp.
    pub arrivals: Vec<Time>,
    /// Readings of the barometer, if there is one.
    pub baro: Vec<BaroHeight>,
    /// True motion, with the stamps of the samples.
    pub truth: Vec<Solution>,
    /// At the time of each truth record.
    pub biases: Vec<Biases>,
    pub errors: SensorErrors,
    /// The heading given at the start, with its error, if the model gives one.
    pub given_heading_rad: Option<f64>,
}

impl SimulatedDrive {
    /// Error of the heading given, with its sign.
    pub fn azimuth_error_rad(&self) -> Option<f64> {
        let start = self.truth.first()?.euler().heading_rad;
        Some(wrap_pi(self.given_heading_rad? - start))
    }

    /// Its log, to be written in these axes; the samples have the error model's output form.
    pub fn into_log(self, axes: BodyAxes, output: ImuOutput) -> Log {
        Log {
            meta: Meta {
                initial_heading_deg: self.given_heading_rad.map(f64::to_degrees),
                ..Meta::new(axes, output)
            },
            imu: self.imu.into(),
            gnss: self.gnss,
            baro: self.baro,
            truth: self.truth,
        }
    }
}

/// The errors of one run's sensors, body axes right-forward-up. Biases are measured minus true,
/// at the end of the run.
///
/// A scale error of the z accelerometer acts as a bias of scale times g.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorErrors {
    pub accel_bias_mps2: [f64; 3],
    pub gyro_bias_radps: [f64; 3],
    /// Scale errors and misalignments of the accelerometers: errors proportional to the truth.
    pub accel_matrix: Matrix3<f64>,
    /// The same of the gyros.
    pub gyro_matrix: Matrix3<f64>,
    /// Response of the gyros to specific force, rad/s per m/s^2.
    pub g_sensitivity: Matrix3<f64>,
    /// A fix stamped t measures the motion at t minus this.
    pub gnss_latency_s: f64,
    /// The same at the end of the run, with clock drift.
    pub gnss_latency_end_s: f64,
    /// Largest additional lag by smoothing and repeated fixes.
    pub gnss_lag_s: f64,
}

impl SensorErrors {
    /// Accelerometer error at rest at a place, where `up` is up in their axes: biases, and scale errors and
    /// misalignments on gravity, which cannot be separated at one attitude.
    pub fn effective_accel_bias_mps2(&self, at: &Geodetic, up: &Vector3<f64>) -> Vector3<f64> {
        Vector3::from(self.accel_bias_mps2) + self.accel_matrix * gravity_mps2(at, up)
    }

    /// The same of the gyros: biases, and their response to gravity.
    pub fn effective_gyro_bias_radps(&self, at: &Geodetic, up: &Vector3<f64>) -> Vector3<f64> {
        Vector3::from(self.gyro_bias_radps) + self.g_sensitivity * gravity_mps2(at, up)
    }
}

/// Specific force at rest at a place, along `up`.
fn gravity_mps2(at: &Geodetic, up: &Vector3<f64>) -> Vector3<f64> {
    LocalEarth::at(at.latitude_rad, at.height_m).gravity_mps2 * up
}

/// Mean direction of up, in the axes of the unit.
pub fn mean_up<'a>(truth: impl Iterator<Item = &'a Solution>) -> Vector3<f64> {
    let ups = truth.map(|s| s.attitude.inverse() * Vector3::z());
    ups.sum::<Vector3<f64>>().normalize()
}

/// Drives the car of `config.recording.seed` and records it.
pub fn simulate(config: &DriveConfig) -> SimulatedDrive {
    let recording = &config.recording;
    let car = Car::new(recording.seed, recording.duration_s, config.initial_rest_s);
    record(car, recording)
}

pub fn record<M: Motion>(motion: M, recording: &Recording) -> SimulatedDrive {
    record_with(motion, recording, None)
}

/// Records any motion, with recorded instead of white noise of the inertial sensors if there is any.
pub fn record_with<M: Motion>(
    motion: M,
    recording: &Recording,
    noise: Option<&RecordedNoise>,
) -> SimulatedDrive {
    let mut sensors = IdealSensors::new(motion, recording.origin, Time::default());
    let start = *sensors.state();
    let end = Time::default().plus_seconds(recording.duration_s);
    let mut recorder = Recorder::new(recording, noise, &start);
    recorder.record_until(&mut sensors, end);
    let Recording { seed, errors, .. } = recording;
    let heading_error = Random::stream(*seed, "given heading").normal();
    let given_heading_rad = errors
        .given_heading_sigma_deg
        .map(|sigma| start.solution.euler().heading_rad + sigma.to_radians() * heading_error);
    // With latency the last fixes would be stamped after the last inertial sample.
    recorder.gnss.retain(|fix| fix.time <= end);
    SimulatedDrive {
        arrivals: arrivals(&recorder.gnss, &errors.gnss.habits, *seed),
        errors: recorder.errors(end),
        imu: recorder.imu,
        gnss: recorder.gnss,
        baro: (errors.barometer).map_or_else(Vec::new, |model| model.read(&recorder.truth, *seed)),
        truth: recorder.truth,
        biases: recorder.biases,
        given_heading_rad,
    }
}

/// One sampling interval.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// Truth at its start.
    pub before: TrueState,
    /// As measured.
    pub sample: ImuSample,
    /// Increments of error-free sensors.
    pub ideal: ImuSample,
}

/// Sensors with errors, and their output so far.
#[derive(Clone, Debug)]
pub(crate) struct Recorder {
    pub(crate) imu: Vec<ImuSample>,
    pub(crate) gnss: Vec<GnssFix>,
    pub(crate) truth: Vec<Solution>,
    biases: Vec<Biases>,
    recording: Recording,
    pub(crate) unit: Imu,
    pub(crate) receiver: Gnss,
    losses: Random,
    jitter: Random,
    count: u32,
}

impl Recorder {
    /// Draws the errors of the run; the motion begins at `start`.
    pub(crate) fn new(
        recording: &Recording,
        noise: Option<&RecordedNoise>,
        start: &TrueState,
    ) -> Self {
        let Recording { seed, errors, .. } = recording;
        let mut unit = Imu::new(errors, *seed);
        unit.recorded = noise.map(|noise| Resampled::new(noise, *seed));
        let mut imu = Vec::new();
        if errors.imu.output == ImuOutput::Rates {
            let (gyro, accel) = unit.measure_rates(&start.rates, 1.0 / recording.imu_hz);
            imu.push(ImuSample {
                time: Time::default(),
                gyro,
                accel,
            });
        }
        Self {
            imu,
            gnss: Vec::new(),
            truth: vec![start.solution],
            biases: vec![unit.biases()],
            unit,
            receiver: Gnss::new(&errors.gnss, *seed),
            losses: Random::stream(*seed, "imu losses"),
            jitter: Random::stream(*seed, "imu jitter"),
            count: 0,
            recording: recording.clone(),
        }
    }

    /// Records up to a time; `sensors` are at the end of the last recording.
    pub(crate) fn record_until<M: Motion>(&mut self, sensors: &mut IdealSensors<M>, end: Time) {
        let most_s = MAX_JITTER / self.recording.imu_hz;
        while self.next_time() <= end {
            let Step { sample, .. } = self.step(sensors);
            let model = &self.recording.errors.imu;
            let jitter_s = model.stamp_jitter_s.min(most_s) * self.jitter.uniform([-1.0, 1.0]);
            let time = sample.time.plus_seconds(jitter_s);
            let sampled_s = sample.time.as_seconds();
            let in_gap = model.holes.iter().any(|gap| gap.contains(sampled_s));
            if !self.losses.chance(model.dropped_fraction) && !in_gap {
                self.imu.push(ImuSample { time, ..sample });
            }
            if self.count.is_multiple_of(self.recording.truth_every) {
                let truth = sensors.state().solution;
                self.truth.push(Solution { time, ..truth });
                self.biases.push(self.unit.biases());
            }
        }
    }

    fn next_time(&self) -> Time {
        Time::default().plus_seconds(f64::from(self.count + 1) / self.recording.imu_hz)
    }

    /// Advances by a sampling interval, and keeps the fixes that measure it.
    pub(crate) fn step<M: Motion>(&mut self, sensors: &mut IdealSensors<M>) -> Step {
        let (before, time) = (*sensors.state(), self.next_time());
        self.count += 1;
        let step_s = time.seconds_since(before.solution.time);
        let gained = sensors.advance(time);
        let now = sensors.state();
        let (gyro, accel) = self.unit.measure(&gained, &now.rates, step_s);
        self.receiver.observe(&before, now, &mut self.gnss);
        Step {
            before,
            sample: ImuSample { time, gyro, accel },
            ideal: ImuSample {
                time,
                gyro: gained.angle_b_rad,
                accel: gained.velocity_b_mps,
            },
        }
    }

    /// True values of the errors at a time.
    pub(crate) fn errors(&self, end: Time) -> SensorErrors {
        let Imu { gyros, accels, .. } = &self.unit;
        let [gyro, accel] = self.unit.biases();
        SensorErrors {
            accel_bias_mps2: accel.into(),
            gyro_bias_radps: gyro.into(),
            accel_matrix: accels.error_matrix(),
            gyro_matrix: gyros.error_matrix(),
            g_sensitivity: self.unit.g_sensitivity,
            gnss_latency_s: self.receiver.latency_s,
            gnss_latency_end_s: self.receiver.latency_at_s(end.as_seconds()),
            gnss_lag_s: self.receiver.lag_s(),
        }
    }
}
