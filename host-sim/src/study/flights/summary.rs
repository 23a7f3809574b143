//! Statistics over the flights.

use ins_core::earth::LocalEarth;
use serde::Serialize;

use super::linear::{Agreement, random_walk_position_m};
use super::route::Route;
use super::run::{
    BIASES_DEG_H, DEG_SQRT_H, ResidualErrors, Run, Settings, WALKS_DEG_SQRT_H, cell_errors,
};
use super::schuler::Schuler;
use super::statistics::{Figure, rms};
use crate::identify::baro_aided_ins::HorizontalError;

/// RMS position error after 1 h of free flight in the thesis, km.
pub const THESIS_KM: f64 = 3.7;
const THESIS_MINUTES: u32 = 60;

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    pub runs: usize,
    pub first_seed: u64,
    pub minutes_aided: u32,
    pub minutes_free: u32,
    /// RMS of the thesis after 1 h, km.
    pub thesis_position_km: f64,
    /// `R * 1 deg/h * t`, km.
    pub one_deg_h_km: f64,
    /// RMS of the residual errors of the estimates.
    pub left: ResidualErrors,
    pub with_estimates: End,
    /// The same without the noise of the free part.
    pub without_noise: End,
    pub raw: End,
    /// RMS at every minute of the free part.
    pub growth: Vec<Growth>,
    /// Residual bias by random walk.
    pub grid: Vec<Cell>,
    /// By random walk: its position error, and the largest bias that may be added.
    pub walks: Vec<Walk>,
    /// Against (1)-(2), over the free parts.
    pub linear_model: LinearModelFigures,
    /// Against (1)-(2), over a long straight flight.
    pub schuler: Schuler,
}

/// Errors at the end of the free part.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct End {
    pub position_km: Figure,
    pub velocity_mps: Figure,
}

/// RMS position errors at one minute, km.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Growth {
    /// Of the free part.
    pub minute: usize,
    pub with_estimates_km: f64,
    /// The same without the noise of the free part.
    pub without_noise_km: f64,
    pub raw_km: f64,
}

/// One combination of residual gyro errors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Cell {
    /// One sigma of each gyro.
    pub gyro_bias_deg_h: f64,
    /// Of each gyro.
    pub random_walk_deg_sqrt_h: f64,
    /// RMS at the end and its 95 % interval.
    pub position_km: f64,
    pub position_km_95: Option<[f64; 2]>,
    /// Whether the thesis's figure is reached; none of flights of another duration.
    pub reached: Option<bool>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Walk {
    /// Of each gyro.
    pub random_walk_deg_sqrt_h: f64,
    /// RMS error by it alone, simulated, km.
    pub position_km: f64,
    /// The same from the linear model, km.
    pub linear_model_km: f64,
    /// Residual bias at which the thesis's figure is just reached; none if it is not, even without bias.
    pub largest_bias_deg_h: Option<f64>,
}

/// RMS difference of the linear model over RMS velocity error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LinearModelFigures {
    /// (1)-(2) as printed, estimates applied.
    pub with_estimates: f64,
    /// With the rotation of the frame.
    pub with_estimates_rotating: f64,
    /// (1)-(2) as printed, raw readings.
    pub raw: f64,
    /// With the rotation of the frame.
    pub raw_rotating: f64,
}

impl Summary {
    /// Of at least one run; all of the same length.
    pub fn new(runs: &[Run], route: &Route, settings: &Settings, schuler: Schuler) -> Self {
        let origin = route.plan().start.position;
        let earth = LocalEarth::at(origin.latitude_rad, origin.height_m);
        let free_s = 60.0 * f64::from(settings.minutes_free);
        let grid = grid(runs, settings.minutes_free == THESIS_MINUTES);
        let agreement = |which: usize, terms: usize| {
            Agreement::relative(runs.iter().map(|run| &run.agreement[which][terms]))
        };
        Self {
            runs: runs.len(),
            first_seed: runs[0].seed,
            minutes_aided: settings.minutes_aided,
            minutes_free: settings.minutes_free,
            thesis_position_km: THESIS_KM,
            one_deg_h_km: 1e-3 * earth.north_radius_m * f64::to_radians(free_s / 3600.0),
            left: residual_errors(runs),
            with_estimates: end(runs, 0),
            without_noise: end(runs, 1),
            raw: end(runs, 2),
            growth: growth(runs),
            walks: walks(&grid, &|walk| {
                1e-3 * random_walk_position_m(DEG_SQRT_H * walk, free_s, &earth)
            }),
            grid,
            linear_model: LinearModelFigures {
                with_estimates: agreement(0, 0),
                with_estimates_rotating: agreement(0, 1),
                raw: agreement(1, 0),
                raw_rotating: agreement(1, 1),
            },
            schuler,
        }
    }
}

fn residual_errors(runs: &[Run]) -> ResidualErrors {
    let rms_of =
        |value: &dyn Fn(&ResidualErrors) -> f64| rms(runs.iter().map(|run| value(&run.left)));
    ResidualErrors {
        gyro_deg_h: [0, 1, 2].map(|axis| rms_of(&|left| left.gyro_deg_h[axis])),
        accel_mg: [0, 1, 2].map(|axis| rms_of(&|left| left.accel_mg[axis])),
        azimuth_deg: rms_of(&|left| left.azimuth_deg),
        latency_ms: rms_of(&|left| left.latency_ms),
    }
}

/// Errors of a variant at a minute, from 0, of every run.
fn errors(
    runs: &[Run],
    variant: usize,
    minute: usize,
    value: fn(&HorizontalError) -> f64,
) -> Vec<f64> {
    runs.iter()
        .map(|run| value(&run.free[variant][minute]))
        .collect()
}

fn end(runs: &[Run], variant: usize) -> End {
    let last = runs[0].free[variant].len() - 1;
    let at_end = |value| Figure::of(&errors(runs, variant, last, value));
    End {
        position_km: at_end(|error| error.position_m).scaled(1e-3),
        velocity_mps: at_end(|error| error.velocity_mps),
    }
}

fn growth(runs: &[Run]) -> Vec<Growth> {
    (0..runs[0].free[0].len())
        .map(|minute| {
            let [with_estimates_km, without_noise_km, raw_km] = [0, 1, 2].map(|variant| {
                let all = errors(runs, variant, minute, |error| error.position_m);
                1e-3 * rms(all.into_iter())
            });
            Growth {
                minute: minute + 1,
                with_estimates_km,
                without_noise_km,
                raw_km,
            }
        })
        .collect()
}

fn grid(runs: &[Run], as_in_thesis: bool) -> Vec<Cell> {
    (0..runs[0].grid_m.len())
        .map(|cell| {
            let (gyro_bias_deg_h, random_walk_deg_sqrt_h) = cell_errors(cell);
            let all: Vec<f64> = runs.iter().map(|run| run.grid_m[cell]).collect();
            let position_km = Figure::of(&all).scaled(1e-3);
            Cell {
                gyro_bias_deg_h,
                random_walk_deg_sqrt_h,
                position_km: position_km.rms,
                position_km_95: position_km.rms_95,
                reached: as_in_thesis.then_some(position_km.rms <= THESIS_KM),
            }
        })
        .collect()
}

/// The largest bias follows from adding independent errors as root sum of squares.
fn walks(grid: &[Cell], linear_model_km: &dyn Fn(f64) -> f64) -> Vec<Walk> {
    let (without_bias, with_bias) = grid.split_at(WALKS_DEG_SQRT_H.len());
    let largest = BIASES_DEG_H.len() - 1;
    let km_per_deg_h =
        with_bias[(largest - 1) * WALKS_DEG_SQRT_H.len()].position_km / BIASES_DEG_H[largest];
    without_bias
        .iter()
        .map(|cell| {
            let margin = THESIS_KM * THESIS_KM - cell.position_km * cell.position_km;
            Walk {
                random_walk_deg_sqrt_h: cell.random_walk_deg_sqrt_h,
                position_km: cell.position_km,
                linear_model_km: linear_model_km(cell.random_walk_deg_sqrt_h),
                largest_bias_deg_h: (margin >= 0.0).then(|| margin.sqrt() / km_per_deg_h),
            }
        })
        .collect()
}
