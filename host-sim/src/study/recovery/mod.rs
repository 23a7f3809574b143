//! How well error models are found: many simulated units, each identified from its drives, against
//! the models that the drives were made with.

mod table;

pub use table::{Results, Row};

use indicatif::ProgressBar;
use nalgebra::Matrix4;
use serde::Serialize;

use crate::identify::configure;
use crate::identify::error_model::filter::{Candidate, Dynamics};
use crate::identify::error_model::fit;
use crate::identify::error_model::{Identified, Parameter, Record};
use crate::identify::quantities::DEG_H_RADPS;
use crate::identify::run::identify;
use crate::log::{BodyAxes, Grade, Log};
use crate::sim::errors::{BiasModel, Law};
use crate::sim::{self, DriveConfig, ErrorModel, simulate};

/// Seeds from one unit to the next: no unit has so many drives.
const UNIT_SEEDS: u64 = 1000;

/// Which units are made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Study {
    /// Number of units.
    pub units: u64,
    /// Drives of a unit.
    pub drives: u64,
    /// Length of a drive, min.
    pub minutes: f64,
    /// Seed of the first drive of the first unit.
    pub first_seed: u64,
}

/// One unit, identified.
struct Unit {
    parameters: Vec<Parameter>,
    /// Curvature of the log-likelihood at the true values.
    information: Matrix4<f64>,
    /// Readings of a second at rest, all axes, less the means that were taken out.
    rest_freedom: f64,
}

/// Ring-laser class with gyro biases that move: by some of what the noise of minutes hides.
pub fn truth(law: Law) -> ErrorModel {
    let mut model = ErrorModel::hg1700();
    model.gyro_deg_h.bias = match law {
        Law::Wave => BiasModel::Wave {
            initial_sigma: 1.0,
            interval_s: 300.0,
            jump_mean: 0.3,
            jump_sigma: 2.0,
        },
        Law::Continuous => BiasModel::Continuous {
            initial_sigma: 2.0,
            slope_sigma_per_s: 0.001,
            correlated_sigma: 2.0,
            correlation_time_s: 150.0,
        },
    };
    model
}

impl Study {
    fn identified(&self, unit: u64, law: Law) -> Unit {
        let model = truth(law);
        let first = self.first_seed + UNIT_SEEDS * unit;
        let records: Vec<Record> = (first..first + self.drives)
            .map(|seed| drive_record(seed, &model, Grade::Hg1700, self.minutes))
            .collect();
        let found = Identified::new(&records, Grade::Hg1700, Some(law));
        let accel_noise = model.accel_mps2.white_noise;
        let rest = || records.iter().flat_map(|record| &record.rest);
        Unit {
            parameters: found.parameters(),
            information: fit::information(&records, accel_noise, &candidate(&model)),
            rest_freedom: rest().map(|blocks| 3.0 * (blocks.len() as f64 - 1.0)).sum(),
        }
    }
}

/// Drives once with sensors of a model, and keeps what identification needs.
pub(crate) fn drive_record(seed: u64, model: &ErrorModel, grade: Grade, minutes: f64) -> Record {
    let mut config = DriveConfig::new(seed, sim::Grade::default(), minutes);
    config.recording.errors = model.clone();
    let log = Log {
        truth: Vec::new(),
        ..simulate(&config).into_log(BodyAxes::Rfu, model.imu.output)
    };
    let config = configure::config(&log, grade);
    let found = identify(&log, config, &ProgressBar::hidden()).expect("presets are valid");
    Record::new(&log, &found)
}

/// The true model as the likelihood takes it.
fn candidate(model: &ErrorModel) -> Candidate {
    let bias = &model.gyro_deg_h.bias;
    let (size, time_s) = bias.random_part();
    Candidate {
        gyro_noise: model.gyro_deg_h.white_noise * DEG_H_RADPS,
        accel_noise: model.accel_mps2.white_noise,
        gnss_sigma_mps: model.gnss.velocity_sigma_mps,
        dynamics: Dynamics {
            law: bias.law(),
            size: size * DEG_H_RADPS,
            time_s,
        },
    }
}
