//! Accuracy of identified error models: many simulated units, each identified from its drives or flights,
//! against the true models.

use std::path::Path;

use clap::Args;
use indicatif::ProgressBar;
use miette::Result;
use nalgebra::Matrix4;
use rayon::prelude::*;
use serde::Serialize;

use crate::identify::configure;
use crate::identify::error_model::filter::{Candidate, Class, Dynamics};
use crate::identify::error_model::fit;
use crate::identify::error_model::identified::in_file;
use crate::identify::error_model::interval::{Interval, student};
use crate::identify::error_model::{Identified, Parameter, Record};
use crate::identify::quantities::DEG_H_RADPS;
use crate::identify::run::identify;
use crate::log::{BodyAxes, Grade, Log};
use crate::page::progress::{bar, counted};
use crate::page::table::{Table, cells, heads, side_by_side, titled};
use crate::page::{self, output};
use crate::sim::errors::{BiasModel, Law};
use crate::sim::receiver::Correlated;
use crate::sim::vehicles::{Begin, Plane};
use crate::sim::{DriveConfig, ErrorModel, SimulatedDrive, record, simulate};
use crate::statistics::mean_and_variance;
use crate::study::options::{MOST_SEED, minutes};

/// Names of the files; the first marks a folder as ours.
pub const JSON: &str = "recovery.json";
const MARKDOWN: &str = "recovery.md";

/// Distance of the seeds of units, above the drives of a unit, and of kinds of units, above the seeds of a
/// study.
const UNIT_SEEDS: u64 = 1000;
const KIND_SEEDS: u64 = 1_000_000_000;

/// Banks of the turns of a flight, rad.
const BANK_RAD: [f64; 2] = [0.45, 0.7];

/// Coloured noise of GNSS velocity, m/s.
const GNSS_COLOURED: Correlated = Correlated {
    sigma: 0.03,
    time_s: 10.0,
};

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Vehicle {
    Car,
    /// A light aircraft that begins at rest.
    Aircraft,
}

#[derive(Args, Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Study {
    #[arg(skip = Grade::Hg1700)]
    pub class: Grade,
    /// Vehicle of all units.
    #[arg(skip = Vehicle::Car)]
    pub vehicle: Vehicle,
    /// Number of units, of each model of the gyro biases.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(2..=100_000))]
    pub units: u64,
    /// Drives of a unit.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=100))]
    pub drives: u64,
    /// Length of a drive.
    #[arg(long, default_value_t = 40.0, value_parser = minutes)]
    pub minutes: f64,
    /// Seed of the first drive of the first unit.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=MOST_SEED))]
    pub first_seed: u64,
}

struct Unit {
    parameters: Vec<Parameter>,
    /// Curvature of the log-likelihood at the true values.
    information: Matrix4<f64>,
    /// Degrees of freedom of the noise at rest: readings of a second, all axes, less the means.
    rest_dof: f64,
}

/// The model of a class, with gyro bias drift: in ring lasers partly hidden by the noise of minutes, in
/// MEMS above it.
pub fn true_model(class: Grade, law: Law) -> ErrorModel {
    let mut model = class.errors();
    model.gnss.habits.velocity = GNSS_COLOURED;
    let [initial_sigma, random_sigma] = match (class, law) {
        (Grade::Hg1700, Law::Wave) => [1.0, 2.0],
        (Grade::Hg1700, Law::Continuous) => [2.0, 2.0],
        (Grade::Mems, _) => [model.gyro_deg_h.bias.initial_sigma(), 40.0],
    };
    model.gyro_deg_h.bias = match law {
        Law::Wave => BiasModel::Wave {
            initial_sigma,
            interval_s: 300.0,
            jump_mean: 0.15 * random_sigma,
            jump_sigma: random_sigma,
        },
        Law::Continuous => BiasModel::Continuous {
            initial_sigma,
            slope_sigma_per_s: 0.0005 * random_sigma,
            correlated_sigma: random_sigma,
            correlation_time_s: 150.0,
        },
    };
    model
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Path in the model file.
    pub name: &'static str,
    pub unit: &'static str,
    /// Value in the true model.
    pub truth: f64,
    /// Units with a value.
    pub units: usize,
    /// Mean error of the estimate.
    pub bias: f64,
    /// 95 % bound of that mean by chance.
    pub bias_95: f64,
    /// Intervals that contain the truth, percent.
    pub coverage_percent: f64,
    /// Standard deviation of the estimate.
    pub scatter: f64,
    /// Cramer-Rao bound of that; none where none is known.
    pub bound: Option<f64>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Results {
    #[serde(flatten)]
    pub study: Study,
    /// Thesis equation of the gyro biases.
    pub gyro_model: &'static str,
    pub rows: Vec<Row>,
}

impl Study {
    /// Units of both classes, in both vehicles, with gyro biases of both laws.
    pub fn of_all_kinds(self) -> Vec<Results> {
        let classes = [Grade::Hg1700, Grade::Mems];
        let vehicles = [Vehicle::Car, Vehicle::Aircraft];
        let kinds = classes.map(|class| vehicles.map(|vehicle| (class, vehicle)));
        let of = |((class, vehicle), place)| {
            let study = Self {
                class,
                vehicle,
                first_seed: self.first_seed + KIND_SEEDS * place,
                ..self
            };
            study.of_both_laws()
        };
        kinds.into_iter().flatten().zip(0..).flat_map(of).collect()
    }

    /// Units with gyro biases of either law.
    pub fn of_both_laws(self) -> Vec<Results> {
        [Law::Wave, Law::Continuous]
            .map(|law| self.results(law))
            .into()
    }

    /// Simulates and identifies all units; the results do not depend on the number of threads.
    fn results(self, law: Law) -> Results {
        let progress = bar().with_message("units");
        progress.set_length(self.units);
        let units: Vec<Unit> = (0..self.units)
            .into_par_iter()
            .map(counted(&progress, |unit| self.identify_unit(unit, law)))
            .collect();
        Results {
            study: self,
            gyro_model: match law {
                Law::Wave => "(3)",
                Law::Continuous => "(4)",
            },
            rows: rows(&self, law, &units),
        }
    }

    fn identify_unit(&self, unit: u64, law: Law) -> Unit {
        let (model, class) = (true_model(self.class, law), self.class);
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
            information: fit::information(&records, &true_candidate(&model)),
            rest_dof: rest().map(|blocks| 3.0 * (blocks.len() as f64 - 1.0)).sum(),
        }
    }
}

/// Record for identification of one simulated drive with sensors of a model.
pub(crate) fn drive_record(seed: u64, model: &ErrorModel, grade: Grade, minutes: f64) -> Record {
    let config = drive(seed, model, minutes);
    identified_record(simulate(&config), model, grade)
}

/// The same of a flight.
pub(crate) fn flight_record(seed: u64, model: &ErrorModel, grade: Grade, minutes: f64) -> Record {
    let recording = drive(seed, model, minutes).recording;
    let plane = Plane::new(seed, recording.duration_s, BANK_RAD, Begin::OnGround);
    identified_record(record(plane, &recording), model, grade)
}

fn drive(seed: u64, model: &ErrorModel, minutes: f64) -> DriveConfig {
    let mut config = DriveConfig::new(seed, Grade::Hg1700, minutes);
    config.recording.errors = model.clone();
    config
}

fn identified_record(run: SimulatedDrive, model: &ErrorModel, grade: Grade) -> Record {
    let log = Log {
        truth: Vec::new(),
        ..run.into_log(BodyAxes::Rfu, model.imu.output)
    };
    let config = configure::config(&log, grade);
    let found = identify(&log, config, &ProgressBar::hidden()).expect("presets are valid");
    Record::new(&log, &found)
}

/// The true model as a candidate of the likelihood.
fn true_candidate(model: &ErrorModel) -> Candidate {
    Candidate {
        gyro_noise: model.gyro_deg_h.white_noise * DEG_H_RADPS,
        accel_noise: model.accel_mps2.white_noise,
        gnss_sigma_mps: model.gnss.velocity_sigma_mps,
        gnss_coloured: model.gnss.habits.velocity,
        dynamics: Dynamics::of(&model.gyro_deg_h.bias, DEG_H_RADPS),
        class: Class::of(model),
    }
}

fn rows(study: &Study, law: Law, units: &[Unit]) -> Vec<Row> {
    let model = true_model(study.class, law);
    let bounds = Bounds::new(study, &model, units);
    (all_parameters(units).into_iter())
        .map(|parameter| {
            let same_name = |p: &&Parameter| p.name == parameter.name;
            let found: Vec<Interval> = (units.iter())
                .filter_map(|unit| unit.parameters.iter().find(same_name)?.found)
                .collect();
            let truth = in_file(&model, parameter.name);
            row(parameter, truth, &found, bounds.of(parameter.name))
        })
        .collect()
}

/// The parameters of all units: one whose model was not identified has fewer.
fn all_parameters(units: &[Unit]) -> Vec<&Parameter> {
    let mut each: Vec<&Parameter> = Vec::new();
    for parameter in units.iter().flat_map(|unit| &unit.parameters) {
        if each.iter().all(|other| other.name != parameter.name) {
            each.push(parameter);
        }
    }
    each
}

fn row(parameter: &Parameter, truth: f64, found: &[Interval], bound: Option<f64>) -> Row {
    let count = found.len() as f64;
    let values: Vec<f64> = found.iter().map(|f| f.value).collect();
    let single = (values.first().copied().unwrap_or(f64::NAN), f64::NAN);
    let (mean, variance) = mean_and_variance(&values).unwrap_or(single);
    let scatter = variance.sqrt();
    let covering = found.iter().filter(|f| f.holds(truth)).count();
    Row {
        name: parameter.name,
        unit: parameter.unit,
        truth,
        units: found.len(),
        bias: mean - truth,
        bias_95: student(count - 1.0) * scatter / count.sqrt(),
        coverage_percent: 100.0 * covering as f64 / count,
        scatter,
        bound,
    }
}

/// Cramer-Rao bounds: of the likelihood at the true values, averaged over the units, or of draws
/// observed without error.
struct Bounds<'a> {
    model: &'a ErrorModel,
    /// Relative, of gyro noise, GNSS noise, size and time of the random part; none if unobservable.
    likelihood: [Option<f64>; 4],
    draws: f64,
    jumps: f64,
    rest_dof: f64,
}

impl<'a> Bounds<'a> {
    fn new(study: &Study, model: &'a ErrorModel, units: &[Unit]) -> Self {
        let count = units.len() as f64;
        let sum: Matrix4<f64> = units.iter().map(|unit| unit.information).sum();
        let mut mean = sum / count;
        let draws = 3.0 * study.drives as f64;
        let mut jumps = 0.0;
        if let BiasModel::Wave { interval_s, .. } = model.gyro_deg_h.bias {
            jumps = draws * (60.0 * study.minutes / interval_s).floor();
            // The likelihood has steps where jump times change: no bound, and no correlation with others.
            for other in 0..3 {
                (mean[(3, other)], mean[(other, 3)]) = (0.0, 0.0);
            }
        }
        Self {
            model,
            likelihood: relative(mean),
            draws,
            jumps,
            rest_dof: units.iter().map(|unit| unit.rest_dof).sum::<f64>() / count,
        }
    }

    fn of(&self, name: &str) -> Option<f64> {
        let truth = in_file(self.model, name);
        let [gyro, gnss, size, time] = self.likelihood;
        let of_draws = |count: f64| 1.0 / (2.0 * count).sqrt();
        let bound = match name {
            "gyro_deg_h.white_noise" => gyro? * truth,
            "gnss.velocity_sigma_mps" => gnss? * truth,
            "gyro_deg_h.bias.jump_sigma" | "gyro_deg_h.bias.correlated_sigma" => size? * truth,
            "gyro_deg_h.bias.correlation_time_s" => time? * truth,
            "gyro_deg_h.bias.initial_sigma"
            | "gyro_deg_h.bias.slope_sigma_per_s"
            | "accel_mps2.bias.initial_sigma" => of_draws(self.draws) * truth,
            "accel_mps2.white_noise" => of_draws(self.rest_dof) * truth,
            "gyro_deg_h.bias.jump_mean" => {
                let sigma = in_file(self.model, "gyro_deg_h.bias.jump_sigma");
                sigma / self.jumps.sqrt()
            }
            _ => return None,
        };
        // Without draws there is none.
        Some(bound).filter(|bound| bound.is_finite())
    }
}

/// Sigmas of an information matrix; none of a parameter without information, which would make it
/// singular.
fn relative(mut information: Matrix4<f64>) -> [Option<f64>; 4] {
    let observed = [0, 1, 2, 3].map(|which| information[(which, which)] > 0.0);
    for which in (0..4).filter(|which| !observed[*which]) {
        information.fill_row(which, 0.0);
        information.fill_column(which, 0.0);
        information[(which, which)] = 1.0;
    }
    let variance = information.try_inverse();
    [0, 1, 2, 3].map(|which| {
        let variance = variance.filter(|_| observed[which])?[(which, which)];
        (variance > 0.0).then(|| variance.sqrt())
    })
}

// --- tables ---

/// A table for each kind of units; or one of all with the coverage of the intervals only.
pub fn tables(all: &[Results], coverage_alone: bool) -> Vec<Table> {
    if coverage_alone {
        vec![coverage(all)]
    } else {
        all.iter().map(Results::table).collect()
    }
}

pub fn readable(tables: &[Table]) -> String {
    titled(tables, Table::plain) + "\n"
}

pub fn write(results: &[Results], tables: &[Table], folder: &Path) -> Result<()> {
    output::write(folder, MARKDOWN, titled(tables, Table::markdown))?;
    Ok(output::write(folder, JSON, page::json(&results)?)?)
}

/// A row for each parameter, a column for each of the results.
fn coverage(all: &[Results]) -> Table {
    let mut header = cells([""]);
    header.extend(all.iter().map(Results::kind));
    let column = |results: &Results| {
        let cell = |row: &Row| (row.name.to_owned(), row.coverage(results.study.units));
        results.rows.iter().map(cell).collect()
    };
    let rows = side_by_side(&all.iter().map(column).collect::<Vec<_>>());
    let title = "95 % intervals that hold the truth:";
    Table::of(title, header, rows)
}

impl Results {
    fn kind(&self) -> String {
        let Study { class, vehicle, .. } = self.study;
        format!("{class:?} {vehicle:?} {}", self.gyro_model).to_lowercase()
    }

    fn table(&self) -> Table {
        let header = heads(
            "| unit | truth | bias | bias by chance | coverage | scatter | bound | scatter / bound",
        );
        let title = format!("Gyro biases of equation {}:", self.gyro_model);
        // The core does not estimate some, such as scale errors.
        let found = self.rows.iter().filter(|row| row.units > 0);
        let units = self.study.units;
        Table::of(title, header, found.map(|row| row.cells(units)))
    }
}

impl Row {
    /// Also the number of units, unless all have a value.
    fn coverage(&self, of_units: u64) -> String {
        match self.units {
            0 => "no value".to_owned(),
            units if units as u64 == of_units => format!("{:.0} %", self.coverage_percent),
            units => format!("{:.0} % of {units}", self.coverage_percent),
        }
    }

    fn cells(&self, of_units: u64) -> Vec<String> {
        let digits = |value: f64| match self.units {
            1 => page::brief(value),
            _ => page::digits(self.scatter, value),
        };
        vec![
            self.name.to_owned(),
            self.unit.to_owned(),
            self.truth.to_string(),
            digits(self.bias),
            format!("± {}", digits(self.bias_95)),
            self.coverage(of_units),
            digits(self.scatter),
            self.bound.map_or("none".to_owned(), digits),
            (self.bound).map_or(String::new(), |bound| {
                format!("{:.2}", self.scatter / bound)
            }),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOISE: &str = "gyro_deg_h.white_noise";
    const MEAN: &str = "gyro_deg_h.bias.jump_mean";

    fn unit(found: &[(&'static str, f64)]) -> Unit {
        let parameter = |&(name, value): &(&'static str, f64)| Parameter {
            name,
            unit: "",
            found: Some(Interval {
                value,
                low: value - 1.0,
                high: value + 1.0,
            }),
            observable: true,
            why: "",
        };
        Unit {
            parameters: found.iter().map(parameter).collect(),
            information: Matrix4::identity(),
            rest_dof: 100.0,
        }
    }

    fn study(units: u64) -> Study {
        Study {
            class: Grade::Hg1700,
            vehicle: Vehicle::Car,
            units,
            drives: 1,
            minutes: 40.0,
            first_seed: 0,
        }
    }

    #[test]
    fn parameters_missing_in_the_first_unit_are_in_the_table_with_their_number_of_units() {
        let units = [
            unit(&[(NOISE, 7.0)]),
            unit(&[(NOISE, 8.0), (MEAN, 0.0)]),
            unit(&[(NOISE, 7.5), (MEAN, 0.6)]),
        ];
        let study = study(3);
        let rows = rows(&study, Law::Wave, &units);
        let counts: Vec<(&str, usize)> = rows.iter().map(|row| (row.name, row.units)).collect();
        assert_eq!(counts, [(NOISE, 3), (MEAN, 2)]);
        let results = Results {
            study,
            gyro_model: "(3)",
            rows,
        };
        let table = results.table().plain();
        assert!(table.contains("100 % of 2"), "{table}");
    }

    /// An unobservable parameter has no bound, and does not make those of the others zero.
    #[test]
    fn parameters_without_information_have_no_bound() {
        let mut information = Matrix4::identity() * 4.0;
        information[(3, 3)] = 0.0;
        assert_eq!(
            relative(information),
            [Some(0.5), Some(0.5), Some(0.5), None]
        );
        (information[(0, 1)], information[(1, 0)]) = (8.0, 8.0);
        assert_eq!(relative(information), [None, None, Some(0.5), None]);
    }

    /// Two values 0.6 apart: 12.7 (Student's t, one degree of freedom) times 0.3, not 1.96.
    #[test]
    fn bound_by_chance_of_few_units_is_from_the_t_distribution() {
        let units = [unit(&[(MEAN, 0.0)]), unit(&[(MEAN, 0.6)])];
        let row = rows(&study(2), Law::Wave, &units)[0].clone();
        assert!((row.bias_95 - 12.706 * 0.3).abs() < 1e-3, "{row:?}");
    }
}
