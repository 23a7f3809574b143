//! `python-ins`' extended Kalman filter and ours on the same log.

use host_sim::compare::kalman::{self, Filter, Noise, index};
use host_sim::identify::configure;
use host_sim::log::{self, BodyAxes, Compression, Grade, Log, Meta};
use host_sim::sim::errors::BiasModel;
use host_sim::sim::{DriveConfig, ErrorModel, simulate};
use ins_core::earth::{Geodetic, wrap_pi};
use nalgebra::{SVector, Vector3};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::python::Environment;

static PYTHON: Environment = Environment::new("pyins", &["python-ins==1.0.1"], "PYINS_PYTHON");

/// Length of the drive; its first minute is at rest.
const MINUTES: u32 = 10;

/// Names of the compared quantities, in the order of [`Row::sigma`].
pub const NAMES: [&str; 15] = [
    "position east, m",
    "position north, m",
    "position up, m",
    "velocity east, m/s",
    "velocity north, m/s",
    "velocity up, m/s",
    "roll, rad",
    "pitch, rad",
    "heading, rad",
    "accelerometer right, m/s^2",
    "accelerometer forward, m/s^2",
    "accelerometer up, m/s^2",
    "gyro right, rad/s",
    "gyro forward, rad/s",
    "gyro up, rad/s",
];

/// One value for each of [`NAMES`].
pub type Values = SVector<f64, 15>;

/// State of a filter just after a fix.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Row {
    /// Time stamp of the fix, s.
    pub time_s: f64,
    /// Estimated state.
    pub state: State,
    /// One sigma of its errors, in the order of [`NAMES`].
    pub sigma: Values,
}

/// State of both filters; body axes right-forward-up.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct State {
    /// Latitude and longitude, rad, and height, m.
    position: [f64; 3],
    velocity_enu_mps: Vector3<f64>,
    roll_pitch_heading_rad: Vector3<f64>,
    accel_bias_mps2: Vector3<f64>,
    gyro_bias_radps: Vector3<f64>,
}

/// Both filters at every full minute from the second on: ours, theirs.
///
/// # Errors
/// If `python-ins` is not available.
///
/// # Panics
/// If our filter fails, or theirs does not return every time.
pub fn both() -> Result<Vec<(Row, Row)>, String> {
    let (log, noise) = log();
    let times_s: Vec<f64> = (2..MINUTES).map(|minute| f64::from(60 * minute)).collect();
    let (start, ours) = ours(&log, &noise, &times_s);
    let theirs = theirs(&log, &input_of_python_ins(&start, &noise, &times_s))?;
    assert_eq!(ours.len(), theirs.len());
    Ok(ours.into_iter().zip(theirs).collect())
}

/// A drive with errors that both filters model: no latency, the same position noise in all axes, drifting biases;
/// few fixes, as `python-ins` is slow.
fn log() -> (Log, Noise) {
    let mut errors = ErrorModel::hg1700();
    errors.gnss.latency_s = [0.0; 2];
    errors.gnss.rate_hz = 1.0;
    errors.gnss.vertical_sigma_m = errors.gnss.horizontal_sigma_m;
    errors.gyro_deg_h.bias = BiasModel::drifting(1.0, 0.5);
    errors.accel_mps2.bias = BiasModel::drifting(0.01, 0.001);
    let mut drive = DriveConfig::new(3, Grade::Hg1700, f64::from(MINUTES));
    drive.initial_rest_s = Some([62.0, 63.0]);
    drive.recording.errors = errors;
    let errors = &drive.recording.errors;
    let run = simulate(&drive);
    let log = Log {
        meta: Meta {
            initial_heading_deg: run.given_heading_rad.map(f64::to_degrees),
            ..Meta::new(BodyAxes::Frd, errors.imu.output)
        },
        imu: run.imu.into(),
        gnss: run.gnss,
        baro: Vec::new(),
        truth: Vec::new(),
    };
    let mut noise = Noise::of_model(errors);
    noise.gnss.latency_sigma_s = 0.0;
    // Theirs does not use gyros at rest.
    noise.uses_zero_rate = false;
    (log, noise)
}

/// Our filter at its start, and after the fixes of `times_s`.
fn ours(log: &Log, noise: &Noise, times_s: &[f64]) -> (Filter, Vec<Row>) {
    let config = configure::config(log, Grade::Hg1700);
    let imu = log.imu.all();
    let mut run =
        kalman::Run::new(&imu, &log.gnss, config, *noise).expect("the configuration is a preset");
    let start = loop {
        run.step(&mut |_, _| {}).expect("alignment ends in the log");
        if let Some(filter) = run.filter() {
            break filter.clone();
        }
    };
    let mut rows = Vec::new();
    let mut add_row = |filter: &Filter, _| {
        if times_s.contains(&filter.time.as_seconds()) {
            rows.push(Row::of(filter));
        }
    };
    while run.step(&mut add_row).is_some() {}
    assert_eq!(rows.len(), times_s.len());
    (start, rows)
}

fn theirs(log: &Log, start: &Value) -> Result<Vec<Row>, String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    log::write(log, folder.path(), Compression::Plain).map_err(|error| error.to_string())?;
    let start = start.to_string();
    PYTHON.run("reference.py", &[folder.path().as_os_str(), start.as_ref()])
}

/// Input of `python-ins`: initial state, noise, and output times. It has one sigma for all axes of most errors; noise
/// parameters are as in [`Noise`].
fn input_of_python_ins(filter: &Filter, noise: &Noise, times_s: &[f64]) -> Value {
    let sigmas = filter.sigmas();
    json!({
        "time_s": filter.time.as_seconds(),
        "state": State::of(filter),
        "sigma": {
            "position_m": sigmas[index::POSITION],
            "velocity_mps": sigmas[index::VELOCITY],
            "level_rad": sigmas[index::ATTITUDE],
            "heading_rad": sigmas[index::ATTITUDE + 2],
            "accel_bias_mps2": sigmas[index::ACCEL],
            "gyro_bias_radps": ([0, 1, 2].map(|axis| sigmas[index::GYRO + axis])),
        },
        "noise": {
            "gyro_noise": noise.sensors.gyro_noise[0],
            "gyro_bias_walk": noise.sensors.gyro_bias_walk,
            "accel_noise": noise.sensors.accel_noise[0],
            "accel_bias_walk": noise.sensors.accel_bias_walk,
            "velocity_sigma_mps": noise.gnss.velocity_mps.white,
            "position_sigma_m": noise.gnss.position_m.white,
        },
        "times_s": times_s,
    })
}

impl State {
    fn of(filter: &Filter) -> Self {
        let known = &filter.nominal;
        let solution = known.solution(filter.time);
        let (position, angles) = (solution.position, solution.euler());
        Self {
            position: [
                position.latitude_rad,
                position.longitude_rad,
                position.height_m,
            ],
            velocity_enu_mps: solution.velocity_enu_mps,
            roll_pitch_heading_rad: [angles.roll_rad, angles.pitch_rad, angles.heading_rad].into(),
            accel_bias_mps2: known.accel_bias_mps2,
            gyro_bias_radps: known.gyro_bias_radps,
        }
    }

    fn geodetic(&self) -> Geodetic {
        let [latitude_rad, longitude_rad, height_m] = self.position;
        Geodetic {
            latitude_rad,
            longitude_rad,
            height_m,
        }
    }
}

impl Row {
    fn of(filter: &Filter) -> Self {
        let state = State::of(filter);
        let mut sigma = Values::zeros();
        sigma.copy_from(&filter.sigmas().fixed_rows::<15>(0));
        // Phi is in ENU: its components in roll and pitch, on a nearly level road.
        let (sin, cos) = state.roll_pitch_heading_rad.z.sin_cos();
        let phi = filter
            .covariance
            .fixed_view::<3, 3>(index::ATTITUDE, index::ATTITUDE);
        let about = |axis: Vector3<f64>| axis.dot(&(phi * axis)).sqrt();
        sigma[6] = about(Vector3::new(sin, cos, 0.0));
        sigma[7] = about(Vector3::new(cos, -sin, 0.0));
        Self {
            time_s: filter.time.as_seconds(),
            state,
            sigma,
        }
    }

    /// State of this filter minus that of the other.
    pub fn minus(&self, other: &Self) -> Values {
        let (mine, its) = (&self.state, &other.state);
        let mut angles = mine.roll_pitch_heading_rad - its.roll_pitch_heading_rad;
        angles.z = wrap_pi(angles.z);
        let parts = [
            mine.geodetic().enu_from(&its.geodetic()),
            mine.velocity_enu_mps - its.velocity_enu_mps,
            angles,
            mine.accel_bias_mps2 - its.accel_bias_mps2,
            mine.gyro_bias_radps - its.gyro_bias_radps,
        ];
        Values::from_iterator(parts.iter().flatten().copied())
    }
}
