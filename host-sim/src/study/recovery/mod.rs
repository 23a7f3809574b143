//! How well error models are found: many simulated units, each identified from its drives or flights,
//! against the models that these were made with.

mod table;

pub(crate) use table::coverage;
pub use table::{Results, Row};

use indicatif::ProgressBar;
use nalgebra::Matrix4;
use serde::Serialize;

use crate::identify::configure;
use crate::identify::error_model::filter::{Candidate, Class, Dynamics};
use crate::identify::error_model::fit;
use crate::identify::error_model::identified::class as error_model_of;
use crate::identify::error_model::{Identified, Parameter, Record};
use crate::identify::quantities::DEG_H_RADPS;
use crate::identify::run::identify;
use crate::log::{BodyAxes, Grade, Log};
use crate::sim::errors::{BiasModel, Law};
use crate::sim::receiver::Correlated;
use crate::sim::vehicles::{Begin, Plane};
use crate::sim::{self, DriveConfig, ErrorModel, SimulatedDrive, record, simulate};

/// Seeds from one unit to the next: no unit has so many drives.
const UNIT_SEEDS: u64 = 1000;

/// Banks of the turns of a flight, rad.
const BANK_RAD: [f64; 2] = [0.45, 0.7];

/// What of the noise of GNSS velocity has a memory, m/s.
const GNSS_MEMORY: Correlated = Correlated {
    sigma: 0.03,
    time_s: 10.0,
};

/// What units are driven or flown in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Vehicle {
    /// The simulated car.
    Car,
    /// A light aircraft that stands first.
    Aircraft,
}

/// Which units are made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Study {
    /// Class of the sensors.
    pub class: Grade,
    /// What they are driven in.
    pub vehicle: Vehicle,
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

/// A class with gyro biases that move: by some of what the noise of minutes hides in ring lasers, by
/// more than that in MEMS.
pub fn truth(class: Grade, law: Law) -> ErrorModel {
    let mut model = error_model_of(class);
    model.gnss.habits.velocity = GNSS_MEMORY;
    let [initial_sigma, moves] = match (class, law) {
        (Grade::Hg1700, Law::Wave) => [1.0, 2.0],
        (Grade::Hg1700, Law::Continuous) => [2.0, 2.0],
        (Grade::Mems, _) => [model.gyro_deg_h.bias.initial_sigma(), 40.0],
    };
    model.gyro_deg_h.bias = match law {
        Law::Wave => BiasModel::Wave {
            initial_sigma,
            interval_s: 300.0,
            jump_mean: 0.15 * moves,
            jump_sigma: moves,
        },
        Law::Continuous => BiasModel::Continuous {
            initial_sigma,
            slope_sigma_per_s: 0.0005 * moves,
            correlated_sigma: moves,
            correlation_time_s: 150.0,
        },
    };
    model
}

impl Study {
    fn identified(&self, unit: u64, law: Law) -> Unit {
        let (model, class) = (truth(self.class, law), self.class);
        let first = self.first_seed + UNIT_SEEDS * unit;
        let records: Vec<Record> = (first..first + self.drives)
            .map(|seed| match self.vehicle {
                Vehicle::Car => drive_record(seed, &model, class, self.minutes),
                Vehicle::Aircraft => flight_record(seed, &model, class, self.minutes),
            })
            .collect();
        let found = Identified::new(&records, class, Some(law));
        let rest = || records.iter().flat_map(|record| &record.rest);
        Unit {
            parameters: found.parameters(),
            information: fit::information(&records, &candidate(&model)),
            rest_freedom: rest().map(|blocks| 3.0 * (blocks.len() as f64 - 1.0)).sum(),
        }
    }
}

/// Drives once with sensors of a model, and keeps what identification needs.
pub(crate) fn drive_record(seed: u64, model: &ErrorModel, grade: Grade, minutes: f64) -> Record {
    let config = drive(seed, model, minutes);
    reduced(simulate(&config), model, grade)
}

/// The same in the air.
pub(crate) fn flight_record(seed: u64, model: &ErrorModel, grade: Grade, minutes: f64) -> Record {
    let recording = drive(seed, model, minutes).recording;
    let plane = Plane::new(seed, recording.duration_s, BANK_RAD, Begin::OnGround);
    reduced(record(plane, &recording), model, grade)
}

fn drive(seed: u64, model: &ErrorModel, minutes: f64) -> DriveConfig {
    let mut config = DriveConfig::new(seed, sim::Grade::default(), minutes);
    config.recording.errors = model.clone();
    config
}

fn reduced(run: SimulatedDrive, model: &ErrorModel, grade: Grade) -> Record {
    let log = Log {
        truth: Vec::new(),
        ..run.into_log(BodyAxes::Rfu, model.imu.output)
    };
    let config = configure::config(&log, grade);
    let found = identify(&log, config, &ProgressBar::hidden()).expect("presets are valid");
    Record::new(&log, &found)
}

/// The true model as the likelihood takes it.
fn candidate(model: &ErrorModel) -> Candidate {
    Candidate {
        gyro_noise: model.gyro_deg_h.white_noise * DEG_H_RADPS,
        accel_noise: model.accel_mps2.white_noise,
        gnss_sigma_mps: model.gnss.velocity_sigma_mps,
        gnss_memory: model.gnss.habits.velocity,
        dynamics: Dynamics::of(&model.gyro_deg_h.bias, DEG_H_RADPS),
        class: Class::of(model),
    }
}
