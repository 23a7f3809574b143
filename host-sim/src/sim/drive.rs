//! Simulated runs: a motion, sensors on it, their errors, and what a logger would have written.

use ins_core::earth::Geodetic;
use ins_core::{GnssFix, ImuOutput, ImuSample, Solution, Time};
use serde::{Deserialize, Serialize};

use super::car::Car;
use super::errors::ErrorModel;
use super::gnss::Gnss;
use super::ideal::IdealSensors;
use super::imu::Imu;
use super::motion::Motion;
use super::noise::Random;

/// Ready-made sensor classes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Grade {
    /// No errors.
    Ideal,
    /// Ring-laser class, 1 deg/h.
    #[default]
    Hg1700,
    /// Consumer MEMS.
    Mems,
}

impl Grade {
    /// The class's error model.
    pub fn errors(self) -> ErrorModel {
        match self {
            Self::Ideal => ErrorModel::ideal(),
            Self::Hg1700 => ErrorModel::hg1700(),
            Self::Mems => ErrorModel::mems(),
        }
    }
}

/// How a motion is recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Fixes every random number.
    pub seed: u64,
    /// How long, s.
    pub duration_s: f64,
    /// Inertial samples per second.
    pub imu_hz: f64,
    /// The truth is kept at every so many inertial samples.
    pub truth_every: u32,
    /// Where the motion begins.
    pub origin: Geodetic,
    /// Sensors.
    pub errors: ErrorModel,
}

/// A simulated drive.
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
                imu_hz: 100.0,
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
}

/// What was recorded, and what it was made of.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedDrive {
    /// As measured, in the output form of the error model.
    pub imu: Vec<ImuSample>,
    /// As received.
    pub gnss: Vec<GnssFix>,
    /// What really happened.
    pub truth: Vec<Solution>,
    /// The errors that an estimator should find.
    pub errors: SensorErrors,
    /// The heading given at the start, with its error, if the model gives one.
    pub given_heading_rad: Option<f64>,
}

/// The errors of one run's sensors, body axes right-forward-up. Biases are measured minus true,
/// at the end of the run.
///
/// A scale error of the z accelerometer is felt as a bias of scale times g.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SensorErrors {
    /// Accelerometer biases.
    pub accel_bias_mps2: [f64; 3],
    /// Gyro biases.
    pub gyro_bias_radps: [f64; 3],
    /// Scale-factor errors of the accelerometers.
    pub accel_scale: [f64; 3],
    /// Scale-factor errors of the gyros.
    pub gyro_scale: [f64; 3],
    /// A fix stamped t shows the motion at t minus this.
    pub gnss_latency_s: f64,
}

/// Drives the car of `config.recording.seed` and records it.
pub fn simulate(config: &DriveConfig) -> SimulatedDrive {
    let recording = &config.recording;
    let car = Car::new(recording.seed, recording.duration_s, config.initial_rest_s);
    record(car, recording)
}

/// Records any motion.
pub fn record<M: Motion>(motion: M, recording: &Recording) -> SimulatedDrive {
    let Recording { seed, errors, .. } = recording;
    let mut sensors = IdealSensors::new(motion, recording.origin, Time::default());
    let mut imu = Imu::new(errors, *seed);
    let mut gnss = Gnss::new(&errors.gnss, *seed);
    let mut losses = Random::stream(*seed, "imu losses");
    let heading_error = Random::stream(*seed, "given heading").normal();

    let end = Time::default().plus_seconds(recording.duration_s);
    let mut run = SimulatedDrive {
        imu: Vec::new(),
        gnss: Vec::new(),
        truth: vec![sensors.state().solution],
        errors: sensor_errors(&imu, &gnss),
        given_heading_rad: errors.given_heading_sigma_deg.map(|sigma| {
            sensors.state().solution.euler().heading_rad + sigma.to_radians() * heading_error
        }),
    };
    if errors.imu.output == ImuOutput::Rates {
        let (gyro, accel) = imu.measure_rates(&sensors.state().rates, 1.0 / recording.imu_hz);
        run.imu.push(ImuSample {
            time: Time::default(),
            gyro,
            accel,
        });
    }
    let stamp = |count: u32| Time::default().plus_seconds(f64::from(count) / recording.imu_hz);
    for count in (1..).take_while(|count| stamp(*count) <= end) {
        let before = *sensors.state();
        let time = stamp(count);
        let step_s = time.seconds_since(before.solution.time);
        let gained = sensors.advance(time);
        let now = sensors.state();
        let (gyro, accel) = imu.measure(&gained, &now.rates, step_s);
        if !losses.chance(errors.imu.dropped_fraction) {
            run.imu.push(ImuSample { time, gyro, accel });
        }
        gnss.observe(&before, now, &mut run.gnss);
        if count % recording.truth_every == 0 {
            run.truth.push(now.solution);
        }
    }
    // With a latency the last fixes would be stamped after the last inertial sample.
    run.gnss.retain(|fix| fix.time <= end);
    run.errors = sensor_errors(&imu, &gnss);
    run
}

fn sensor_errors(imu: &Imu, gnss: &Gnss) -> SensorErrors {
    SensorErrors {
        accel_bias_mps2: imu.accels.bias().into(),
        gyro_bias_radps: imu.gyros.bias().into(),
        accel_scale: imu.accels.scale().into(),
        gyro_scale: imu.gyros.scale().into(),
        gnss_latency_s: gnss.latency_s(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_fixes_everything() {
        let run = |seed| simulate(&DriveConfig::new(seed, Grade::Mems, 3.0));
        assert_eq!(run(5), run(5));
        assert_ne!(run(5).imu, run(6).imu);
    }

    #[test]
    fn records_the_samples_asked_for() {
        let run = simulate(&DriveConfig::new(1, Grade::Hg1700, 5.0));
        assert_eq!(run.imu.len(), 30_000);
        assert_eq!(run.truth.len(), 3_001);
        // Fixes of a time before the run are missing, and no other.
        let first = run.gnss[0].time.as_seconds();
        assert!((0.0..0.1).contains(&(first - run.errors.gnss_latency_s)));
        let fixes = 1.0 + (300.0 - first) * 10.0;
        assert!((run.gnss.len() as f64 - fixes).abs() < 1e-6);
    }
}
