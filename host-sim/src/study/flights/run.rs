//! One flight: damped, then several free INS in parallel.

use core::array;

use clap::Args;
use indicatif::ProgressBar;
use ins_core::config::DampingConfig;
use ins_core::earth::wrap_pi;
use ins_core::increments::Interval;
use ins_core::{Config, Estimates, ImuOutput, Navigator, Solution};
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::Serialize;

use super::linear::{Agreement, LinearModel};
use super::route::Route;
use super::sensors::{Intervals, STEP_S, Sensors};
use crate::aircraft::flight::FlightError;
use crate::identify::baro_aided_ins::{BaroAidedIns, HorizontalError};
use crate::identify::configure::config_of;
use crate::identify::free_inertial::value;
use crate::identify::quantities::{DEG_H_RADPS, MG_MPS2};
use crate::log::Grade;
use crate::page::progress::counted;
use crate::sim::ErrorModel;
use crate::sim::drive::{IMU_HZ, Step};
use crate::sim::noise::Random;

/// Residual gyro biases of the grid, one sigma, deg/h.
pub const BIASES_DEG_H: [f64; 6] = [0.0, 0.01, 0.03, 0.1, 0.3, 1.0];
/// Angular random walks of the grid, deg/sqrt(h).
pub const WALKS_DEG_SQRT_H: [f64; 4] = [0.0, 0.01, 0.03, 0.125];
const CELLS: usize = BIASES_DEG_H.len() * WALKS_DEG_SQRT_H.len();

/// SI value of deg/sqrt(h).
pub(super) const DEG_SQRT_H: f64 = core::f64::consts::PI / 180.0 / 60.0;
/// Samples per minute and per second.
const MINUTE: u32 = 6000;
const SECOND: u32 = 100;

/// Settings of the flights.
#[derive(Args, Clone, Debug, PartialEq)]
pub struct Settings {
    /// Minutes damped by GNSS.
    #[arg(long, default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=600))]
    pub minutes_aided: u32,
    /// Minutes without GNSS after that.
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=600))]
    pub minutes_free: u32,
    /// Sensors; their output must be increments.
    #[arg(skip = ErrorModel::hg1700())]
    pub errors: ErrorModel,
}

#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RunError {
    /// The aircraft crashed.
    #[error("flight of seed {seed}: {error}")]
    Flight { seed: u64, error: FlightError },
    /// The alignment did not end before GNSS.
    #[error(
        "flight of seed {seed}: still aligning after {minutes} min with GNSS; it takes more of them"
    )]
    Aligning { seed: u64, minutes: u32 },
}

/// Residual errors at the end of GNSS: estimate minus truth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ResidualErrors {
    pub gyro_deg_h: [f64; 3],
    pub accel_mg: [f64; 3],
    /// Heading of the solution.
    pub azimuth_deg: f64,
    pub latency_ms: f64,
}

/// The free INS in parallel, in the order of [`Run::free`]: readings compensated by the estimates; the same
/// without noise in the free part, for the effect of the residual errors alone; raw readings, from the same
/// start.
pub const VARIANTS: [&str; 3] = ["with_estimates", "without_noise", "raw"];

#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    pub seed: u64,
    /// Residual errors of the estimates.
    pub left: ResidualErrors,
    /// Errors of each of [`VARIANTS`] at every minute of the free part.
    pub free: [Vec<HorizontalError>; 3],
    /// Velocity error against [`LinearModel::both`]: estimates, then raw.
    pub agreement: [[Agreement; 2]; 2],
    /// Position error of each cell of the grid at the end, m; the random walk varies fastest.
    pub grid_m: [f64; CELLS],
}

pub fn run(seed: u64, route: &Route, settings: &Settings) -> Result<Run, RunError> {
    let (mut sensors, navigator, start) = aided(seed, route, settings)?;
    let estimates = navigator.estimates();
    let mut free = Free::new(seed, &sensors, &start, &estimates, navigator.config());
    let left = residual_errors(&sensors, &start, &estimates);
    for count in 1..=settings.minutes_free * MINUTE {
        let step = sensors.step();
        free.step(&step, sensors.truth(), count);
    }
    Ok(free.into_run(seed, left, sensors.truth()))
}

/// One flight with only the INS that is compensated by the estimates: residual errors at the end of GNSS, and
/// the navigation errors at every minute after it.
pub fn run_alone(
    seed: u64,
    route: &Route,
    settings: &Settings,
) -> Result<(ResidualErrors, Vec<HorizontalError>), RunError> {
    let (mut sensors, navigator, start) = aided(seed, route, settings)?;
    let estimates = navigator.estimates();
    let ([gyro, accel], mut ins) = (biases(&estimates), BaroAidedIns::new(&start));
    let mut measured = Intervals::default();
    let left = residual_errors(&sensors, &start, &estimates);
    let minutes = (0..settings.minutes_free).map(|_| {
        for _ in 0..MINUTE {
            let step = sensors.step();
            let interval = measured.of(&step.sample).without_bias(&gyro, &accel);
            let height_m = step.before.solution.position.height_m;
            ins.step(&interval, height_m, &navigator.config().damping);
        }
        ins.error(sensors.truth())
    });
    let errors = minutes.collect();
    Ok((left, errors))
}

/// A flight up to the end of GNSS.
fn aided(
    seed: u64,
    route: &Route,
    settings: &Settings,
) -> Result<(Sensors, Navigator, Solution), RunError> {
    let duration_s = 60.0 * f64::from(settings.minutes_aided + settings.minutes_free);
    let flight_error = |error| RunError::Flight { seed, error };
    let flight = route.flight(seed, duration_s).map_err(flight_error)?;
    let origin = route.plan().start.position;
    let mut sensors = Sensors::new(flight, origin, &settings.errors, seed);
    let navigator = damped(seed, &mut sensors, settings);
    let start = navigator.solution().ok_or(RunError::Aligning {
        seed,
        minutes: settings.minutes_aided,
    })?;
    Ok((sensors, navigator, start))
}

fn damped(seed: u64, sensors: &mut Sensors, settings: &Settings) -> Navigator {
    let error_sigmas = Random::stream(seed, "given heading").normal();
    let with_error = |sigma_deg: f64| {
        sensors.truth().euler().heading_rad + (sigma_deg * error_sigmas).to_radians()
    };
    let heading_rad = settings.errors.given_heading_sigma_deg.map(with_error);
    let config = config_of(Grade::Hg1700, ImuOutput::Increments, heading_rad);
    let mut navigator = Navigator::new(config).expect("presets are valid");
    for _ in 0..settings.minutes_aided * MINUTE {
        let step = sensors.step();
        for fix in sensors.fixes(&step) {
            let _ = navigator.on_gnss(&fix);
        }
        let _ = navigator.on_imu(&step.sample);
    }
    navigator
}

/// Estimated gyro and accelerometer biases.
fn biases(estimates: &Estimates) -> [Vector3<f64>; 2] {
    [estimates.gyro_bias_radps, estimates.accel_bias_mps2]
        .map(|kind| Vector3::from(kind.map(|estimate| value(&estimate))))
}

fn residual_errors(sensors: &Sensors, start: &Solution, estimates: &Estimates) -> ResidualErrors {
    let ([gyro, accel], [true_gyro, true_accel]) = (biases(estimates), sensors.biases());
    let heading_rad = start.euler().heading_rad - sensors.truth().euler().heading_rad;
    ResidualErrors {
        gyro_deg_h: ((gyro - true_gyro) / DEG_H_RADPS).into(),
        accel_mg: ((accel - true_accel) / MG_MPS2).into(),
        azimuth_deg: wrap_pi(heading_rad).to_degrees(),
        latency_ms: 1e3 * (value(&estimates.gnss_latency_s) - sensors.latency_s()),
    }
}

/// The free INS and the linear models.
struct Free {
    damping: DampingConfig,
    estimated: [Vector3<f64>; 2],
    estimate_errors: [Vector3<f64>; 2],
    measured: Intervals,
    ideal: Intervals,
    ins: [BaroAidedIns; 3],
    errors: [Vec<HorizontalError>; 3],
    models: [[LinearModel; 2]; 2],
    grid: Grid,
}

impl Free {
    fn new(
        seed: u64,
        sensors: &Sensors,
        start: &Solution,
        estimates: &Estimates,
        config: &Config,
    ) -> Self {
        let (estimated, truth) = (biases(estimates), sensors.truth());
        let true_biases = sensors.biases();
        Self {
            damping: config.damping,
            estimated,
            estimate_errors: array::from_fn(|kind| estimated[kind] - true_biases[kind]),
            measured: Intervals::default(),
            ideal: Intervals::default(),
            ins: [BaroAidedIns::new(start); 3],
            errors: Default::default(),
            models: [LinearModel::both(start, truth); 2],
            grid: Grid::new(seed, truth),
        }
    }

    fn step(&mut self, step: &Step, truth: &Solution, count: u32) {
        let height_m = step.before.solution.position.height_m;
        let measured = self.measured.of(&step.sample);
        let ideal = self.ideal.of(&step.ideal);
        let intervals = [
            measured.without_bias(&self.estimated[0], &self.estimated[1]),
            ideal.without_bias(&self.estimate_errors[0], &self.estimate_errors[1]),
            measured,
        ];
        for (ins, interval) in self.ins.iter_mut().zip(&intervals) {
            ins.step(interval, height_m, &self.damping);
        }
        self.grid.step(&ideal, height_m, &self.damping);
        self.compare(step, truth, count);
        if count.is_multiple_of(MINUTE) {
            for (errors, ins) in self.errors.iter_mut().zip(&self.ins) {
                errors.push(ins.error(truth));
            }
        }
    }

    /// Propagates the linear models, and compares once a second.
    fn compare(&mut self, step: &Step, truth: &Solution, count: u32) {
        let raw = [
            step.sample.gyro - step.ideal.gyro,
            step.sample.accel - step.ideal.accel,
        ];
        let corrected = array::from_fn(|kind| raw[kind] - STEP_S * self.estimated[kind]);
        for (models, [gyro, accel]) in self.models.iter_mut().zip([corrected, raw]) {
            for model in models {
                model.step(step, truth, &gyro, &accel);
            }
        }
        if !count.is_multiple_of(SECOND) {
            return;
        }
        let [estimates, _, raw] = self.ins.map(|ins| ins.velocity_error_mps(truth));
        for (models, error) in self.models.iter_mut().zip([estimates, raw]) {
            for model in models {
                model.compare(&error);
            }
        }
    }

    fn into_run(self, seed: u64, left: ResidualErrors, truth: &Solution) -> Run {
        Run {
            seed,
            left,
            free: self.errors,
            agreement: self.models.map(|both| both.map(|model| model.agreement)),
            grid_m: self.grid.ins.map(|ins| ins.error(truth).position_m),
        }
    }
}

/// Free INS without initial errors, with the gyro errors of the grid only; all cells share the random draws.
struct Grid {
    ins: [BaroAidedIns; CELLS],
    bias: Vector3<f64>,
    noise: Random,
}

impl Grid {
    fn new(seed: u64, truth: &Solution) -> Self {
        Self {
            ins: [BaroAidedIns::new(truth); CELLS],
            bias: Vector3::from(Random::stream(seed, "residual bias").normal3()),
            noise: Random::stream(seed, "residual noise"),
        }
    }

    fn step(&mut self, ideal: &Interval, height_m: f64, config: &DampingConfig) {
        let noise = Vector3::from(self.noise.normal3()) * (DEG_SQRT_H * IMU_HZ.sqrt());
        for (cell, ins) in self.ins.iter_mut().enumerate() {
            let (bias, walk) = cell_errors(cell);
            let gyro = DEG_H_RADPS * bias * self.bias + walk * noise;
            ins.step(
                &ideal.without_bias(&-gyro, &Vector3::zeros()),
                height_m,
                config,
            );
        }
    }
}

/// Bias, deg/h, and walk, deg/sqrt(h), of a cell.
pub fn cell_errors(cell: usize) -> (f64, f64) {
    let walks = WALKS_DEG_SQRT_H.len();
    (BIASES_DEG_H[cell / walks], WALKS_DEG_SQRT_H[cell % walks])
}

/// All flights in parallel; the results do not depend on the number of threads.
pub fn all(
    seeds: core::ops::Range<u64>,
    route: &Route,
    settings: &Settings,
    progress: &ProgressBar,
) -> Result<Vec<Run>, RunError> {
    (seeds.into_par_iter())
        .map(counted(progress, |seed| run(seed, route, settings)))
        .collect()
}
