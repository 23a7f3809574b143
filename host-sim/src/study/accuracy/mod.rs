//! Accuracy of the running estimates: Monte Carlo drives, errors against the simulated truth.

mod output;
mod statistics;

pub use output::{JSON, picture, readable, write};
pub use statistics::{Results, RmsPoint, Row};

pub use super::estimator::config_of;

use core::f64::consts::PI;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{ArgAction, Args};
use indicatif::ProgressBar;
use ins_core::config::{self, Form, HeadingSource};
use ins_core::earth::wrap_pi;
use ins_core::{Config, ConfigError, Estimates, Solution};
use nalgebra::Vector3;
use rayon::prelude::*;
use serde::Serialize;

use super::estimator::{self, Core, Estimator, Kalman};
use super::options::{MOST_SEED, minutes, within};
use crate::compare::kalman::Noise;
use crate::identify::free_inertial::known;
use crate::identify::quantities::{DEG_H_RADPS, MG_MPS2};
use crate::log::{GRAVITY_MPS2, Grade};
use crate::page::progress::counted;
use crate::sim::{DriveConfig, ErrorModel, SensorErrors, SimulatedDrive, simulate};

/// Interval of the checks of a run, s.
pub const EVERY_S: f64 = 10.0;
/// Azimuth error below which a run has converged, deg.
const CONVERGED_DEG: f64 = 5.0;
/// Noise of positions that the filter is not to use, m.
const UNUSED_POSITION_SIGMA_M: f64 = 1e5;

/// A parameter, and the engineering unit it is reported in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quantity {
    /// Name as in the columns of `estimates.csv`.
    pub name: &'static str,
    pub title: &'static str,
    pub unit: &'static str,
    /// SI value of one unit.
    #[serde(skip)]
    pub si: f64,
    /// RMS error of a Kalman filter with the exact noises on the linear model of an HG1700-class drive
    /// of 40 min; none of other drives.
    pub limit: Option<f64>,
    /// RMS error that this program has to reach there.
    pub goal: Option<f64>,
}

const fn quantity(
    name: &'static str,
    title: &'static str,
    unit: &'static str,
    si: f64,
    [limit, goal]: [Option<f64>; 2],
) -> Quantity {
    Quantity {
        name,
        title,
        unit,
        si,
        limit,
        goal,
    }
}

impl Quantity {
    pub fn head(&self) -> String {
        format!("{}, {}", self.title, self.unit)
    }
}

const AZIMUTH: [Option<f64>; 2] = [Some(0.024), Some(0.03)];
const LEVEL_ACCEL: [Option<f64>; 2] = [Some(0.02), Some(0.04)];
const LEVEL_GYRO: [Option<f64>; 2] = [Some(0.17), Some(0.2)];
const UP_GYRO: [Option<f64>; 2] = [Some(0.17), Some(0.25)];
const LATENCY: [Option<f64>; 2] = [Some(0.55), Some(1.0)];
const DEG: f64 = PI / 180.0;

/// The quantities, in this order everywhere; body axes right-forward-up.
#[rustfmt::skip]
pub const QUANTITIES: [Quantity; 8] = [
    quantity("azimuth_error_deg", "azimuth", "deg", DEG, AZIMUTH),
    quantity("accel_bias_x_mg", "accelerometer right", "mg", MG_MPS2, LEVEL_ACCEL),
    quantity("accel_bias_y_mg", "accelerometer forward", "mg", MG_MPS2, LEVEL_ACCEL),
    quantity("accel_bias_z_mg", "accelerometer up", "mg", MG_MPS2, [None, None]),
    quantity("gyro_bias_x_deg_h", "gyro right", "deg/h", DEG_H_RADPS, LEVEL_GYRO),
    quantity("gyro_bias_y_deg_h", "gyro forward", "deg/h", DEG_H_RADPS, LEVEL_GYRO),
    quantity("gyro_bias_z_deg_h", "gyro up", "deg/h", DEG_H_RADPS, UP_GYRO),
    quantity("gnss_latency_ms", "GNSS latency", "ms", 1e-3, LATENCY),
];

/// Which drives are run, and with which estimators.
#[derive(Args, Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Study {
    /// Class of the sensors.
    #[arg(long, value_enum, default_value_t = Grade::Hg1700)]
    pub grade: Grade,
    /// Length of a drive.
    #[arg(long, default_value_t = 40.0, value_parser = minutes)]
    pub minutes: f64,
    /// Seed of the first drive; the others follow.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=MOST_SEED))]
    pub first_seed: u64,
    /// Number of drives.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    pub runs: u64,
    /// Form of the estimators; a Kalman filter has none.
    #[arg(long, default_value = "exact", value_parser = forms())]
    pub form: Option<Form>,
    /// Bandwidth of the horizontal damping loop, rad/s; the preset's unless given.
    #[arg(long = "bandwidth")]
    pub bandwidth_radps: Option<f64>,
    /// Run a Kalman filter in place of the core, which takes the noise of the inertial sensors for
    /// FACTOR times what it is.
    #[arg(long = "kalman", value_name = "FACTOR", value_parser = factor, conflicts_with = "form")]
    pub kalman_noise: Option<f64>,
    /// Give that filter no level positions, velocities and height alone; false then.
    #[arg(long = "velocity-alone", action = ArgAction::SetFalse, requires = "kalman_noise")]
    pub kalman_positions: bool,
}

/// By their names.
fn forms() -> impl TypedValueParser<Value = Form> {
    let exact = "Controls undone exactly, all parameters jointly";
    let names = [
        ("exact", exact),
        ("literal", "The thesis's (7) to (11) as printed"),
    ];
    let names = names.map(|(name, what)| PossibleValue::new(name).help(what));
    PossibleValuesParser::new(names).map(|name| match name.as_str() {
        "literal" => Form::Literal,
        _ => Form::Exact,
    })
}

fn factor(text: &str) -> Result<f64, String> {
    within(text, 0.01..=100.0, "a factor from 0.01 to 100")
}

/// Error and stated sigma of a quantity at one time, in its unit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Check {
    /// Estimate minus truth.
    pub error: f64,
    pub sigma: f64,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    pub seed: u64,
    /// Whether it navigates at the end, with an observable azimuth that is correct to some degrees.
    pub converged: bool,
    /// Checks every [`EVERY_S`], oldest first; none before it navigates.
    pub history: Vec<Option<[Check; 8]>>,
}

impl Study {
    /// Drives of 40 min, exact form, preset loops.
    pub fn new(grade: Grade, runs: u64) -> Self {
        Self {
            grade,
            minutes: 40.0,
            first_seed: 0,
            runs,
            form: Some(Form::Exact),
            bandwidth_radps: None,
            kalman_noise: None,
            kalman_positions: true,
        }
    }

    /// Runs all drives in parallel; the results do not depend on the number of threads. `alter` is
    /// applied last to the errors of the sensors, `configure` to the configuration.
    pub fn drive(
        &self,
        alter: &(dyn Fn(&mut ErrorModel) + Sync),
        configure: &(dyn Fn(&mut Config) + Sync),
        progress: &ProgressBar,
    ) -> Result<Vec<Run>, ConfigError> {
        progress.set_length(self.runs);
        let seeds = self.first_seed..self.first_seed.saturating_add(self.runs);
        let one = counted(progress, |seed| self.run(seed, alter, configure));
        seeds.into_par_iter().map(one).collect()
    }

    /// Whether limits and goals hold for these drives.
    pub fn has_limits(&self) -> bool {
        self.grade == Grade::Hg1700 && (self.minutes - 40.0).abs() < 1e-9
    }

    fn config(&self, drive: &SimulatedDrive) -> Config {
        let mut config = config_of(self.grade);
        config.form = self.form.unwrap_or(config.form);
        if let Some(heading) = drive.given_heading_rad {
            config.heading = HeadingSource::Given(heading);
        }
        if let Some(bandwidth) = self.bandwidth_radps {
            config.damping.horizontal.bandwidth_radps = bandwidth;
        }
        config
    }

    fn run(
        &self,
        seed: u64,
        alter: &dyn Fn(&mut ErrorModel),
        configure: &dyn Fn(&mut Config),
    ) -> Result<Run, ConfigError> {
        let mut drive_config = DriveConfig::new(seed, self.grade, self.minutes);
        alter(&mut drive_config.recording.errors);
        let drive = simulate(&drive_config);
        let mut config = self.config(&drive);
        configure(&mut config);
        let (converged, history) = if let Some(factor) = self.kalman_noise {
            let noise = self.filter_noise(factor);
            let mut filter = Kalman::new(&drive.imu, &drive.gnss, config, noise, &Vector3::z())?;
            (true, checks_over(&mut filter, &drive, kalman_estimates))
        } else {
            let mut core = Core::new(config, &drive)?;
            let history = checks_over(&mut core, &drive, core_estimates);
            let azimuth = core.navigator.estimates().azimuth_error_rad;
            (known(&azimuth) && core.solution().is_some(), history)
        };
        Ok(Run {
            seed,
            converged: converged && azimuth_is_correct(&history),
            history,
        })
    }

    fn filter_noise(&self, factor: f64) -> Noise {
        let mut noise = Noise::of_model(&self.grade.errors()).scaled(factor);
        if !self.kalman_positions {
            noise.gnss.position_m = config::Noise::white(UNUSED_POSITION_SIGMA_M);
        }
        noise
    }
}

/// Checks over a drive of what `found` returns: estimates, and a heading, rad.
fn checks_over<S: Estimator>(
    estimator: &mut S,
    drive: &SimulatedDrive,
    found: fn(&S) -> Option<(Estimates, f64)>,
) -> Vec<Option<[Check; 8]>> {
    let mut history = Vec::new();
    // One for each truth, in the same order.
    let mut biases = drive.biases.iter();
    estimator::run(estimator, &drive.truth, |estimator, time, truth| {
        let Some([gyro, accel]) = biases.next() else {
            return;
        };
        let due_s = EVERY_S * (history.len() + 1) as f64;
        if truth.time == time && time.as_seconds() >= due_s {
            let errors = SensorErrors {
                gyro_bias_radps: (*gyro).into(),
                accel_bias_mps2: (*accel).into(),
                ..drive.errors
            };
            let checks = |found| checks(found, &errors, truth);
            history.push(found(estimator).map(checks));
        }
    });
    history
}

fn azimuth_is_correct(history: &[Option<[Check; 8]>]) -> bool {
    let end = history.last().and_then(Option::as_ref);
    end.is_some_and(|[azimuth, ..]| azimuth.error.abs() < CONVERGED_DEG)
}

/// The azimuth is that of the damped INS: its residual error against the estimate of that.
fn core_estimates(core: &Core) -> Option<(Estimates, f64)> {
    let mut estimates = core.navigator.estimates();
    estimates.azimuth_error_rad.value = core.navigator.azimuth_left_rad();
    Some((estimates, core.navigator.mechanization()?.heading_rad()))
}

fn kalman_estimates(kalman: &Kalman) -> Option<(Estimates, f64)> {
    let filter = kalman.run.filter()?;
    Some((filter.estimates(), filter.nominal.ins.heading_rad()))
}

/// Every estimate against its truth at that time; the azimuth is the residual error of a heading.
fn checks(
    (estimates, heading_rad): (Estimates, f64),
    errors: &SensorErrors,
    truth: &Solution,
) -> [Check; 8] {
    let [ax, ay, az] = estimates.accel_bias_mps2;
    let [gx, gy, gz] = estimates.gyro_bias_radps;
    let azimuth_left = wrap_pi(heading_rad - truth.euler().heading_rad);
    // The up accelerometer reads g: its scale error acts as a bias.
    let up_bias = errors.accel_bias_mps2[2] + errors.accel_matrix[(2, 2)] * GRAVITY_MPS2;
    let pairs = [
        (estimates.azimuth_error_rad, azimuth_left),
        (ax, errors.accel_bias_mps2[0]),
        (ay, errors.accel_bias_mps2[1]),
        (az, up_bias),
        (gx, errors.gyro_bias_radps[0]),
        (gy, errors.gyro_bias_radps[1]),
        (gz, errors.gyro_bias_radps[2]),
        (estimates.gnss_latency_s, errors.gnss_latency_s),
    ];
    core::array::from_fn(|which| {
        let ((estimate, truth), si) = (pairs[which], QUANTITIES[which].si);
        Check {
            error: (estimate.value - truth) / si,
            sigma: estimate.sigma / si,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::errors::BiasModel;

    /// A bias that jumps by many sigmas later is no error before.
    #[test]
    fn estimates_are_compared_with_the_biases_of_their_time() {
        let study = Study {
            minutes: 6.0,
            ..Study::new(Grade::Mems, 1)
        };
        let jumps_at_the_end = |errors: &mut ErrorModel| {
            errors.gyro_deg_h.bias = BiasModel::Wave {
                initial_sigma: 1080.0,
                interval_s: 350.0,
                jump_mean: 1000.0,
                jump_sigma: 0.0,
            };
        };
        let progress = ProgressBar::hidden();
        let runs = (study.drive(&jumps_at_the_end, &|_| {}, &progress)).unwrap();
        let before = runs[0].history[29].expect("it navigates after five minutes");
        for check in &before[4..7] {
            assert!(check.error.abs() < 4.0 * check.sigma, "{check:?}");
            // The jump would be detected: it is far beyond the bound above.
            assert!(4.0 * check.sigma < 500.0, "{check:?}");
        }
    }
}
