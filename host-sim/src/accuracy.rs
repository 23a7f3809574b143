//! How accurate the running estimators are: many seeded drives, errors against what was put in.

use ins_core::config::HeadingSource;
use ins_core::earth::wrap_pi;
use ins_core::mechanization::Mechanization;
use ins_core::{Config, Estimate, Navigator, Phase};
use rayon::prelude::*;
use serde::Serialize;

use crate::sim::{DriveConfig, Grade, SimulatedDrive, simulate};

/// Interval at which the errors of a run are looked at, s.
const EVERY_S: f64 = 10.0;

/// A parameter and the engineering unit it is reported in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quantity {
    /// Name as in `summary.json`.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// SI value of one unit.
    pub si: f64,
}

const MG: f64 = 9.806_65e-3;
const DEG_H: f64 = core::f64::consts::PI / 180.0 / 3600.0;
const DEG: f64 = core::f64::consts::PI / 180.0;

/// What is looked at, in this order everywhere.
pub const QUANTITIES: [Quantity; 8] = [
    Quantity {
        name: "azimuth_error_deg",
        unit: "deg",
        si: DEG,
    },
    Quantity {
        name: "accel_bias_mg.x",
        unit: "mg",
        si: MG,
    },
    Quantity {
        name: "accel_bias_mg.y",
        unit: "mg",
        si: MG,
    },
    Quantity {
        name: "accel_bias_mg.z",
        unit: "mg",
        si: MG,
    },
    Quantity {
        name: "gyro_bias_deg_h.x",
        unit: "deg/h",
        si: DEG_H,
    },
    Quantity {
        name: "gyro_bias_deg_h.y",
        unit: "deg/h",
        si: DEG_H,
    },
    Quantity {
        name: "gyro_bias_deg_h.z",
        unit: "deg/h",
        si: DEG_H,
    },
    Quantity {
        name: "gnss_latency_ms",
        unit: "ms",
        si: 1e-3,
    },
];

/// Error and stated spread of each quantity at one time, in its unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Check {
    /// Estimate minus truth.
    pub error: f64,
    /// One sigma as stated.
    pub sigma: f64,
}

/// One run: checks every [`EVERY_S`] from the start.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Run {
    /// Seed of the drive.
    pub seed: u64,
    /// Whether it was navigating at the end with the azimuth observable.
    pub converged: bool,
    /// Checks, oldest first.
    pub history: Vec<[Check; 8]>,
}

/// What many runs say of one quantity.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Which.
    pub quantity: Quantity,
    /// Root mean square of the errors at the end.
    pub rms: f64,
    /// Root mean square of the stated sigmas at the end.
    pub sigma: f64,
    /// Part of the errors within one stated sigma, percent.
    pub within_sigma_percent: f64,
    /// Time after which the RMS over the runs stays below twice its final value, s.
    pub settled_s: f64,
}

/// The configuration that fits a sensor grade.
pub fn config_of(grade: Grade) -> Config {
    match grade {
        Grade::Mems => Config::mems(),
        Grade::Ideal | Grade::Hg1700 => Config::hg1700(),
    }
}

/// Runs one drive through the navigator.
pub fn run(seed: u64, grade: Grade, minutes: f64, tune: &(dyn Fn(&mut Config) + Sync)) -> Run {
    let drive = simulate(&DriveConfig::new(seed, grade, minutes));
    let mut config = config_of(grade);
    config.imu_output = grade.errors().imu.output;
    if let Some(heading) = drive.given_heading_rad {
        config.heading = HeadingSource::Given(heading);
    }
    tune(&mut config);
    let mut navigator = Navigator::new(config).expect("presets are valid");
    let mut history = Vec::new();
    let mut fixes = drive.gnss.iter().peekable();
    let mut truths = drive.truth.iter().peekable();
    for sample in &drive.imu {
        while let Some(fix) = fixes.next_if(|fix| fix.time < sample.time) {
            let _ = navigator.on_gnss(fix);
        }
        let _ = navigator.on_imu(sample);
        while let Some(truth) = truths.next_if(|truth| truth.time <= sample.time) {
            let due = EVERY_S * (history.len() + 1) as f64;
            if truth.time == sample.time && sample.time.as_seconds() >= due {
                history.push(check(&navigator, &drive, truth.euler().heading_rad));
            }
        }
    }
    let azimuth_good = navigator.estimates().azimuth_error_rad.observability;
    let converged = navigator.phase() == Phase::Navigating
        && azimuth_good == ins_core::Observability::Observable
        && history.last().is_some_and(|last| last[0].error.abs() < 5.0);
    Run {
        seed,
        converged,
        history,
    }
}

fn check(navigator: &Navigator, drive: &SimulatedDrive, heading_rad: f64) -> [Check; 8] {
    let estimates = navigator.estimates();
    let truth = &drive.errors;
    let heading = navigator
        .mechanization()
        .map_or(0.0, Mechanization::heading_rad);
    let azimuth_left = wrap_pi(heading - heading_rad);
    let azimuth = Estimate {
        value: navigator.azimuth_left_rad(),
        ..estimates.azimuth_error_rad
    };
    // The z accelerometer feels g: its scale error is a bias.
    let up_bias = truth.accel_bias_mps2[2] + truth.accel_scale[2] * 9.81;
    let pairs = [
        (azimuth, azimuth_left),
        (estimates.accel_bias_mps2[0], truth.accel_bias_mps2[0]),
        (estimates.accel_bias_mps2[1], truth.accel_bias_mps2[1]),
        (estimates.accel_bias_mps2[2], up_bias),
        (estimates.gyro_bias_radps[0], truth.gyro_bias_radps[0]),
        (estimates.gyro_bias_radps[1], truth.gyro_bias_radps[1]),
        (estimates.gyro_bias_radps[2], truth.gyro_bias_radps[2]),
        (estimates.gnss_latency_s, truth.gnss_latency_s),
    ];
    let mut checks = [Check::default(); 8];
    for ((check, (estimate, truth)), quantity) in checks.iter_mut().zip(pairs).zip(QUANTITIES) {
        check.error = (estimate.value - truth) / quantity.si;
        check.sigma = estimate.sigma / quantity.si;
    }
    checks
}

/// Runs many drives on all cores; the order of the result does not depend on them.
pub fn runs(
    seeds: core::ops::Range<u64>,
    grade: Grade,
    minutes: f64,
    tune: &(dyn Fn(&mut Config) + Sync),
) -> Vec<Run> {
    seeds
        .into_par_iter()
        .map(|seed| run(seed, grade, minutes, tune))
        .collect()
}

/// Sums up many runs.
pub fn table(runs: &[Run]) -> Vec<Row> {
    let steps = runs.iter().map(|run| run.history.len()).min().unwrap_or(0);
    (0..QUANTITIES.len())
        .map(|which| row(runs, which, steps))
        .collect()
}

fn row(runs: &[Run], which: usize, steps: usize) -> Row {
    let count = runs.len() as f64;
    let rms_at = |step: usize, value: fn(&Check) -> f64| {
        let sum: f64 = runs
            .iter()
            .map(|run| value(&run.history[step][which]).powi(2))
            .sum();
        (sum / count).sqrt()
    };
    let end = steps.saturating_sub(1);
    let rms = rms_at(end, |check| check.error);
    let within = runs
        .iter()
        .filter(|run| run.history[end][which].error.abs() < run.history[end][which].sigma)
        .count();
    let unsettled = (0..steps)
        .rev()
        .find(|step| rms_at(*step, |check| check.error) > 2.0 * rms);
    Row {
        quantity: QUANTITIES[which],
        rms,
        sigma: rms_at(end, |check| check.sigma),
        within_sigma_percent: 100.0 * within as f64 / count,
        settled_s: EVERY_S * unsettled.map_or(1, |step| step + 2) as f64,
    }
}
