//! Definition of a rehearsal: the drives of its model, everything that its results depend on, and the
//! errors of each flight.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ins_core::ImuOutput;
use miette::{Result, bail, miette};
use serde::{Deserialize, Serialize};

use super::subject::Subject;
use crate::identify::analysis::{Analysis, DistinctLogs};
use crate::identify::error_model::{Identified, Record};
use crate::identify::summary::Summary;
use crate::identify::verdict::Verdict;
use crate::log::Grade;
use crate::page::progress::bar;
use crate::sim::errors::{ErrorModel, ErrorModelError, GnssModel, SensorModel};
use crate::sim::noise::Random;
use crate::sim::recorded::RecordedNoise;

/// Flights of each drawn model: the first ones.
const FLIGHTS_OF_A_DRAW: u32 = 5;

/// Verdict on a drive's estimates, on which the model is based.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DriveVerdict {
    pub log: String,
    #[serde(flatten)]
    pub verdict: Verdict,
}

impl DriveVerdict {
    pub fn of(summary: Summary) -> Self {
        Self {
            log: summary.log,
            verdict: summary.verdict,
        }
    }

    pub fn lines(&self) -> Vec<String> {
        self.verdict.lines_of(&self.log)
    }
}

#[derive(Debug)]
pub struct Drives {
    /// Verdict on each, under its name.
    pub verdicts: Vec<DriveVerdict>,
    pub records: Vec<Record>,
    pub grade: Grade,
    pub output: ImuOutput,
    pub imu_hz: u32,
}

impl Drives {
    /// Reads and identifies drives one after the other.
    pub fn read(paths: &[PathBuf], grade: Option<Grade>) -> Result<Self> {
        Self::of(paths, |path| Analysis::of_log(path, grade, &bar()))
    }

    /// The same with a function that identifies each.
    pub fn of(paths: &[PathBuf], identified: impl Fn(&Path) -> Result<Analysis>) -> Result<Self> {
        let (mut verdicts, mut records, mut rates) = (Vec::new(), Vec::new(), Vec::new());
        let (mut first, mut given) = (None::<(Grade, ImuOutput)>, DistinctLogs::default());
        for path in paths {
            let analysis = identified(path)?;
            let this = (analysis.summary.grade, analysis.log.meta.imu);
            if *first.get_or_insert(this) != this {
                bail!(
                    help = "drives of one unit, logged alike; or say --grade",
                    "{}: another class of sensors, or another kind of samples, than the drives before",
                    path.display()
                );
            }
            given.take(path, &analysis.log)?;
            rates.push(analysis.log.imu_rate_hz());
            records.push(Record::new(&analysis.log, &analysis.found));
            verdicts.push(DriveVerdict::of(analysis.summary));
        }
        rates.sort_by(f64::total_cmp);
        let (grade, output) = first.ok_or_else(|| miette!("no drive is named"))?;
        // Rates are positive, and no sensor has more than thousands of samples a second.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let imu_hz = rates[rates.len() / 2].round().max(1.0) as u32;
        Ok(Self {
            verdicts,
            records,
            grade,
            output,
            imu_hz,
        })
    }
}

/// All settings; as text they tell whether a folder belongs to this rehearsal.
#[derive(Clone, Debug, Serialize)]
pub struct Settings {
    /// Version of this program: another one may give other results.
    pub version: &'static str,
    /// Fixes every random number.
    pub seed: u64,
    pub drives: Vec<String>,
    /// Flights with the identified model.
    pub flights: u32,
    /// Models drawn from the confidence intervals.
    pub models: u32,
    /// Flights for each line of the budget.
    pub budget: u32,
    pub duration_s: f64,
    /// Its last part without GNSS, s.
    pub free_s: f64,
    pub imu_hz: u32,
    pub limit_s: f64,
    /// Algorithms under test, as given.
    pub with: Vec<String>,
    /// Hashes of the programs among them that exist: a replaced program is another one.
    pub programs: BTreeMap<String, u64>,
    /// Root mean squares of the recorded noise, to identify the recording.
    pub noise_from: Option<[f64; 2]>,
    /// Error of the heading given at the start, deg; none: none is given.
    pub heading_sigma_deg: Option<f64>,
    /// Keys of the error model that the user sets.
    pub set: toml::Table,
    /// The model as identified, with heading and keys as above.
    pub model: ErrorModel,
    /// Text of the files of aircraft and plan.
    pub aircraft: Option<String>,
    pub plan: String,
}

/// A key of the error model that the user sets.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Key {
    /// Path in the file.
    pub name: String,
    pub value: toml::Value,
}

impl Key {
    /// Whether it sets the value at a path: another model of a bias sets all of the bias.
    pub fn sets(&self, path: &str) -> bool {
        match self.name.strip_suffix(".model") {
            Some(bias) => path.starts_with(bias),
            None => path.split('[').next() == Some(&self.name),
        }
    }

    /// A model with this key alone; none where that is not valid without others.
    pub fn alone(&self, model: &ErrorModel) -> Option<ErrorModel> {
        let Self { name, value } = self;
        model.with(&format!("{name} = {value}").parse().ok()?).ok()
    }
}

/// A rehearsal: the settings, and the data behind them.
#[derive(Debug)]
pub struct Rehearsal {
    pub settings: Settings,
    pub verdicts: Vec<DriveVerdict>,
    pub found: Identified,
    pub noise: Option<RecordedNoise>,
    pub subjects: Vec<Subject>,
}

impl Settings {
    /// A model with this rehearsal's heading and keys.
    pub fn applied(&self, model: ErrorModel) -> Result<ErrorModel, ErrorModelError> {
        let heading = ErrorModel {
            given_heading_sigma_deg: self.heading_sigma_deg,
            ..model
        };
        heading.with(&self.set)
    }

    /// The keys that the user sets, each with its path.
    pub fn keys(&self) -> Vec<Key> {
        fn all(before: &str, table: &toml::Table, keys: &mut Vec<Key>) {
            for (key, value) in table {
                let name = format!("{before}{key}");
                match value {
                    toml::Value::Table(inner) => all(&(name + "."), inner, keys),
                    value => keys.push(Key {
                        name,
                        value: value.clone(),
                    }),
                }
            }
        }
        let mut keys = Vec::new();
        all("", &self.set, &mut keys);
        keys
    }

    /// Seed of a flight: the same whatever errors it is flown with.
    pub fn flight_seed(&self, flight: u32) -> u64 {
        Random::stream(self.seed, &format!("flight {flight}")).whole()
    }
}

impl Rehearsal {
    /// Every flight with its model, the most important first.
    pub fn jobs(&self) -> Vec<(Case, u32)> {
        let settings = &self.settings;
        let flights = |case, count: u32| (0..count).map(move |flight| (case, flight));
        let mut jobs: Vec<(Case, u32)> = flights(Case::Found, settings.flights).collect();
        if self.noise.is_some() {
            jobs.extend(flights(Case::Recorded, settings.flights));
        }
        let few = settings.flights.min(FLIGHTS_OF_A_DRAW);
        for draw in 0..settings.models {
            jobs.extend(flights(Case::Drawn(draw), few));
        }
        let there = |source: &usize| isolated(&settings.model, *source).is_some();
        for source in (0..SOURCES.len()).filter(there) {
            let count = settings.flights.min(settings.budget);
            jobs.extend(flights(Case::Only(source), count));
            jobs.extend(flights(Case::Without(source), count));
        }
        jobs
    }

    pub fn model(&self, case: Case) -> Result<ErrorModel, ErrorModelError> {
        let settings = &self.settings;
        let part = |source, which: usize| {
            isolated(&settings.model, source)
                .map_or_else(|| settings.model.clone(), |both| both[which].clone())
        };
        Ok(match case {
            Case::Found | Case::Recorded => settings.model.clone(),
            Case::Drawn(draw) => {
                let mut random = Random::stream(settings.seed, &format!("model {draw}"));
                settings.applied(self.found.drawn(&mut random).model())?
            }
            Case::Only(source) => part(source, 0),
            Case::Without(source) => part(source, 1),
        })
    }

    /// Algorithms of a case: cases about the model have the first algorithm alone.
    pub fn subjects_of(&self, case: Case) -> &[Subject] {
        match case {
            Case::Found | Case::Recorded => &self.subjects,
            _ => &self.subjects[..1],
        }
    }
}

// --- errors of a flight ---

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Case {
    /// The identified model.
    Found,
    /// The same, recorded noise in place of white.
    Recorded,
    /// A model drawn from the confidence intervals.
    Drawn(u32),
    /// One source of errors alone, of [`SOURCES`].
    Only(usize),
    /// All but one.
    Without(usize),
}

/// A source of errors: its name, and how it is copied from one model into another.
pub type Source = (&'static str, fn(&ErrorModel, &mut ErrorModel));

/// All sources of errors: together they are the model.
pub const SOURCES: [Source; 14] = [
    ("gyro noise", |from, to| {
        noise(&from.gyro_deg_h, &mut to.gyro_deg_h);
    }),
    ("gyro bias, run to run", |from, to| {
        run_to_run(&from.gyro_deg_h, &mut to.gyro_deg_h);
    }),
    ("gyro bias, in the run", |from, to| {
        in_run(&from.gyro_deg_h, &mut to.gyro_deg_h);
    }),
    ("gyro scale and misalignment", |from, to| {
        proportional(&from.gyro_deg_h, &mut to.gyro_deg_h);
    }),
    ("gyro response to specific force", |from, to| {
        to.imu.gyro_g_sensitivity_deg_h_g = from.imu.gyro_g_sensitivity_deg_h_g;
    }),
    ("accelerometer noise", |from, to| {
        noise(&from.accel_mps2, &mut to.accel_mps2);
    }),
    ("accelerometer bias, run to run", |from, to| {
        run_to_run(&from.accel_mps2, &mut to.accel_mps2);
    }),
    ("accelerometer bias, in the run", |from, to| {
        in_run(&from.accel_mps2, &mut to.accel_mps2);
    }),
    ("accelerometer scale and misalignment", |from, to| {
        proportional(&from.accel_mps2, &mut to.accel_mps2);
    }),
    ("GNSS velocity noise", |from, to| {
        to.gnss.velocity_sigma_mps = from.gnss.velocity_sigma_mps;
        to.gnss.habits.velocity = from.gnss.habits.velocity;
    }),
    ("GNSS position noise", |from, to| {
        to.gnss.horizontal_sigma_m = from.gnss.horizontal_sigma_m;
        to.gnss.vertical_sigma_m = from.gnss.vertical_sigma_m;
        to.gnss.habits.horizontal = from.gnss.habits.horizontal;
        to.gnss.habits.vertical = from.gnss.habits.vertical;
    }),
    ("GNSS latency and other habits", |from, to| {
        habits(&from.gnss, &mut to.gnss);
    }),
    ("heading at the start", |from, to| {
        to.given_heading_sigma_deg = from.given_heading_sigma_deg;
    }),
    ("samples lost, and their stamps", |from, to| {
        to.imu.dropped_fraction = from.imu.dropped_fraction;
        to.imu.stamp_jitter_s = from.imu.stamp_jitter_s;
        to.imu.holes.clone_from(&from.imu.holes);
    }),
];

fn noise(from: &SensorModel, to: &mut SensorModel) {
    to.white_noise = from.white_noise;
    to.noise_times = from.noise_times;
    to.resolution = from.resolution;
}

fn run_to_run(from: &SensorModel, to: &mut SensorModel) {
    to.bias.set_initial_sigma(from.bias.initial_sigma());
}

fn in_run(from: &SensorModel, to: &mut SensorModel) {
    let initial_sigma = to.bias.initial_sigma();
    to.bias = from.bias.clone();
    to.bias.set_initial_sigma(initial_sigma);
    to.warming_sigma = from.warming_sigma;
    to.warming_s = from.warming_s;
}

fn proportional(from: &SensorModel, to: &mut SensorModel) {
    to.scale_sigma = from.scale_sigma;
    to.misalignment_sigma = from.misalignment_sigma;
}

/// All but noise, rate and outages.
fn habits(from: &GnssModel, to: &mut GnssModel) {
    let before = to.habits.clone();
    to.latency_s = from.latency_s;
    to.habits = from.habits.clone();
    to.habits.velocity = before.velocity;
    to.habits.horizontal = before.horizontal;
    to.habits.vertical = before.vertical;
}

/// A model without errors: the unit's output and range, the receiver's rate and outages. A heading
/// is given as far as the model gives one.
fn error_free(model: &ErrorModel) -> ErrorModel {
    let mut error_free = model.clone();
    let mut none = ErrorModel::ideal();
    none.given_heading_sigma_deg = model.given_heading_sigma_deg.map(|_| 0.0);
    for (_, copy) in SOURCES {
        copy(&none, &mut error_free);
    }
    error_free
}

/// The model with one source alone, and with all but it; none where the source is zero.
pub fn isolated(model: &ErrorModel, source: usize) -> Option<[ErrorModel; 2]> {
    let (_, copy) = SOURCES[source];
    let none = error_free(model);
    let (mut only, mut without) = (none.clone(), model.clone());
    copy(model, &mut only);
    copy(&none, &mut without);
    (only != none).then_some([only, without])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every error of the model belongs to a source: all copied into an error-free one restore it.
    #[test]
    fn sources_together_are_the_model() {
        let mut model = ErrorModel::mems();
        model.given_heading_sigma_deg = Some(3.0);
        model.gyro_deg_h.misalignment_sigma = 0.002;
        model.gyro_deg_h.warming_sigma = 50.0;
        model.accel_mps2.resolution = 0.01;
        model.imu.gyro_g_sensitivity_deg_h_g = 72.0;
        model.imu.dropped_fraction = 0.01;
        model.imu.stamp_jitter_s = 0.001;
        model.gnss.habits.velocity.sigma = 0.05;
        model.gnss.habits.smoothing_s = 0.2;
        let mut again = error_free(&model);
        assert_ne!(again, model);
        for (_, copy) in SOURCES {
            copy(&model, &mut again);
        }
        assert_eq!(again, model);
    }

    #[test]
    fn a_source_that_is_not_there_is_not_flown() {
        let model = ErrorModel::hg1700();
        let there = (0..SOURCES.len()).filter(|source| isolated(&model, *source).is_some());
        let names: Vec<&str> = there.map(|source| SOURCES[source].0).collect();
        assert!(names.contains(&"gyro noise") && names.contains(&"heading at the start"));
        assert!(!names.contains(&"gyro scale and misalignment"), "{names:?}");
    }
}
