//! Bias, coverage and scatter of each parameter over the units.

use indicatif::ProgressBar;
use nalgebra::Matrix4;
use rayon::prelude::*;
use serde::Serialize;

use super::{Study, Unit, truth};
use crate::identify::error_model::Parameter;
use crate::identify::error_model::identified::in_file;
use crate::identify::error_model::interval::Interval;
use crate::page;
use crate::page::progress::counted;
use crate::page::table::{Table, cells, heads};
use crate::sim::ErrorModel;
use crate::sim::errors::{BiasModel, Law};

/// One parameter over all units.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Path in the model file.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// What the units were made with.
    pub truth: f64,
    /// Units with a value.
    pub units: usize,
    /// Mean error of the estimate.
    pub bias: f64,
    /// 95 % bound of what chance alone does to that mean.
    pub bias_95: f64,
    /// Intervals that hold the truth, percent.
    pub coverage_percent: f64,
    /// Standard deviation of the estimate.
    pub scatter: f64,
    /// Bound of Cramer and Rao on that; none where none is known.
    pub bound: Option<f64>,
}

/// All units of one kind.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Results {
    /// What was made.
    #[serde(flatten)]
    pub study: Study,
    /// Thesis equation of the gyro biases.
    pub gyro_model: &'static str,
    /// A row for each parameter.
    pub rows: Vec<Row>,
}

impl Study {
    /// Makes and identifies all units; what comes out does not depend on the number of threads.
    pub fn results(self, law: Law, progress: &ProgressBar) -> Results {
        progress.set_length(self.units);
        let units: Vec<Unit> = (0..self.units)
            .into_par_iter()
            .map(counted(progress, |unit| self.identified(unit, law)))
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
}

fn rows(study: &Study, law: Law, units: &[Unit]) -> Vec<Row> {
    let model = truth(study.class, law);
    let Some(first) = units.first() else {
        return Vec::new();
    };
    let bounds = Bounds::new(study, &model, units);
    (first.parameters.iter())
        .map(|parameter| {
            let same = |p: &&Parameter| p.name == parameter.name;
            let found: Vec<Interval> = (units.iter())
                .filter_map(|unit| unit.parameters.iter().find(same)?.found)
                .collect();
            let truth = in_file(&model, parameter.name);
            let bound = bounds.of(parameter.name);
            row(parameter.name, parameter.unit, truth, &found, bound)
        })
        .collect()
}

fn row(
    name: &'static str,
    unit: &'static str,
    truth: f64,
    found: &[Interval],
    bound: Option<f64>,
) -> Row {
    let count = found.len() as f64;
    let mean = found.iter().map(|f| f.value).sum::<f64>() / count;
    let squares: f64 = found.iter().map(|f| (f.value - mean).powi(2)).sum();
    let scatter = (squares / (count - 1.0).max(1.0)).sqrt();
    let held = found.iter().filter(|f| f.holds(truth)).count();
    Row {
        name,
        unit,
        truth,
        units: found.len(),
        bias: mean - truth,
        bias_95: 1.96 * scatter / count.sqrt(),
        coverage_percent: 100.0 * held as f64 / count,
        scatter,
        bound,
    }
}

/// Bounds of Cramer and Rao: of the likelihood at the true values, averaged over the units, or of
/// draws seen without error.
struct Bounds<'a> {
    model: &'a ErrorModel,
    /// Relative, of gyro noise, GNSS noise, size and time of the random part.
    likelihood: [f64; 4],
    draws: f64,
    jumps: f64,
    rest_freedom: f64,
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
            // The times of jumps make steps in the likelihood: no bound, and no part in others.
            for other in 0..3 {
                (mean[(3, other)], mean[(other, 3)]) = (0.0, 0.0);
            }
        }
        let variance = mean.try_inverse().unwrap_or_default();
        Self {
            model,
            likelihood: [0, 1, 2, 3].map(|which| variance[(which, which)].max(0.0).sqrt()),
            draws,
            jumps,
            rest_freedom: units.iter().map(|unit| unit.rest_freedom).sum::<f64>() / count,
        }
    }

    fn of(&self, name: &str) -> Option<f64> {
        let truth = in_file(self.model, name);
        let [gyro, gnss, size, time] = self.likelihood;
        let of_draws = |count: f64| 1.0 / (2.0 * count).sqrt();
        Some(match name {
            "gyro_deg_h.white_noise" => gyro * truth,
            "gnss.velocity_sigma_mps" => gnss * truth,
            "gyro_deg_h.bias.jump_sigma" | "gyro_deg_h.bias.correlated_sigma" => size * truth,
            "gyro_deg_h.bias.correlation_time_s" => time * truth,
            "gyro_deg_h.bias.initial_sigma"
            | "gyro_deg_h.bias.slope_sigma_per_s"
            | "accel_mps2.bias.initial_sigma" => of_draws(self.draws) * truth,
            "accel_mps2.white_noise" => of_draws(self.rest_freedom) * truth,
            "gyro_deg_h.bias.jump_mean" => {
                let sigma = in_file(self.model, "gyro_deg_h.bias.jump_sigma");
                sigma / self.jumps.sqrt()
            }
            _ => return None,
        })
    }
}

/// Whether models come back: a row for each parameter, a column for each of the results.
pub(crate) fn coverage(all: &[Results]) -> Table {
    let mut header = cells([""]);
    header.extend(all.iter().map(Results::kind));
    let mut names: Vec<&str> = Vec::new();
    for row in all.iter().flat_map(|results| &results.rows) {
        if !names.contains(&row.name) {
            names.push(row.name);
        }
    }
    let line = |name: &str| {
        let mut line = cells([name]);
        line.extend(all.iter().map(|results| results.coverage(name)));
        line
    };
    let title = "95 % intervals that hold the truth";
    Table::of(title, header, names.into_iter().map(line))
}

impl Results {
    fn kind(&self) -> String {
        let Study { class, vehicle, .. } = self.study;
        format!("{class:?} {vehicle:?} {}", self.gyro_model).to_lowercase()
    }

    /// Of one parameter; with the number of units if not all have a value.
    fn coverage(&self, name: &str) -> String {
        let Some(row) = self.rows.iter().find(|row| row.name == name) else {
            return String::new();
        };
        match row.units {
            0 => "no value".to_owned(),
            units if units as u64 == self.study.units => format!("{:.0} %", row.coverage_percent),
            units => format!("{:.0} % of {units}", row.coverage_percent),
        }
    }

    /// A row for each parameter.
    pub(crate) fn table(&self) -> Table {
        let header = heads(
            "| unit | truth | bias | bias by chance | coverage | scatter | bound | scatter / bound",
        );
        let title = format!("Gyro biases of equation {}", self.gyro_model);
        Table::of(title, header, self.rows.iter().map(Row::cells))
    }
}

impl Row {
    fn cells(&self) -> Vec<String> {
        let digits = |value: f64| page::digits(self.scatter, value);
        vec![
            self.name.to_owned(),
            self.unit.to_owned(),
            self.truth.to_string(),
            digits(self.bias),
            format!("± {}", digits(self.bias_95)),
            format!("{:.0} %", self.coverage_percent),
            digits(self.scatter),
            self.bound.map_or("none".to_owned(), digits),
            (self.bound).map_or(String::new(), |bound| {
                format!("{:.2}", self.scatter / bound)
            }),
        ]
    }
}
