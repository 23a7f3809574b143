//! `accuracy.json`, `accuracy.csv`, `accuracy.svg`, and the table as text.

use std::path::Path;

use miette::Result;

use super::{QUANTITIES, Results, RmsPoint, Row, Run};
use crate::page::plot::{BLUE, Mark, ORANGE};
use crate::page::sheet::{self, Panel};
use crate::page::table::{Table, heads};
use crate::page::{self, brief, digits, output};

/// Names of the files; the first marks the folder as ours.
pub const JSON: &str = "accuracy.json";
/// Error and sigma of every run at its end.
const CSV: &str = "accuracy.csv";
/// RMS error beside RMS sigma over time.
const PICTURE: &str = "accuracy.svg";

pub fn write(results: &Results, folder: &Path) -> Result<()> {
    output::write(folder, JSON, page::json(results)?)?;
    output::write(folder, PICTURE, picture(results))?;
    Ok(output::write(folder, CSV, of_runs(&results.runs)?)?)
}

fn of_runs(runs: &[Run]) -> Result<String> {
    let mut names = "seed,converged".to_owned();
    names.extend(QUANTITIES.map(|quantity| format!(",{0}_error,{0}_sigma", quantity.name)));
    let row = |run: &Run| {
        let mut cells = vec![run.seed.to_string(), u8::from(run.converged).to_string()];
        let end = run.history.last().into_iter().flatten().flatten();
        let numbers = end.flat_map(|check| [check.error, check.sigma]);
        cells.extend(numbers.map(|number| format!("{number:.6}")));
        // Empty without a solution there.
        cells.resize(2 + 2 * QUANTITIES.len(), String::new());
        cells
    };
    page::csv(&names, runs.iter().map(row))
}

pub fn readable(results: &Results) -> String {
    let study = &results.study;
    let limits = if study.has_limits() {
        "limit: a Kalman filter that knows the exact noises, on the linear model.\n"
    } else {
        ""
    };
    format!(
        "{} drives of {} min, seeds from {}: {} converged.\n\n{}\n{limits}\
         With honest sigmas {:.0} +- {:.0} % of the errors lie within one sigma (95 times out of 100).\n",
        study.runs,
        study.minutes,
        study.first_seed,
        results.converged,
        results.table().plain(),
        68.0,
        results.coverage_spread_percent(),
    )
}

/// RMS error beside RMS sigma over time, a panel for each quantity.
pub fn picture(results: &Results) -> String {
    let panels: Vec<Panel> = (0..QUANTITIES.len())
        .map(|which| panel(results, which))
        .collect();
    sheet::svg(&panels)
}

fn panel(results: &Results, which: usize) -> Panel {
    let curve = |series: fn(&RmsPoint) -> &[f64; 8]| -> Vec<(f64, f64)> {
        let point = |point: &RmsPoint| (point.time_s / 60.0, series(point)[which]);
        results.history.iter().map(point).collect()
    };
    let error = curve(|point| &point.rms_error);
    let sigma = curve(|point| &point.rms_sigma);
    let values = || error.iter().chain(&sigma).map(|point| point.1);
    let least = values().filter(|v| *v > 0.0).fold(f64::MAX, f64::min);
    let most = values().fold(least, f64::max);
    let plot = sheet::plot(
        ["time, min", QUANTITIES[which].unit],
        (0.0, results.study.minutes),
        (0.8 * least, 1.25 * most),
        vec![Mark::Line(sigma, ORANGE), Mark::Line(error, BLUE)],
    );
    let (first, rest) = QUANTITIES[which].title.split_at(1);
    Panel {
        title: first.to_uppercase() + rest,
        svg: plot.svg_log_y(),
        keys: vec![
            (BLUE, "RMS error of the runs"),
            (ORANGE, "RMS of the stated sigma"),
        ],
    }
}

impl Results {
    pub fn table(&self) -> Table {
        let header =
            heads("| RMS error | RMS sigma | within 1 sigma | settled after | limit | goal");
        let rows = self.quantities.iter().map(Row::cells);
        Table::of("", header, rows)
    }
}

impl Row {
    fn cells(&self) -> Vec<String> {
        let cell = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
        vec![
            self.quantity.head(),
            brief(self.rms_error),
            digits(self.rms_error, self.rms_sigma),
            format!("{:.0} %", self.within_sigma_percent),
            format!("{:.1} min", self.settled_s / 60.0),
            cell(self.quantity.limit),
            cell(self.quantity.goal),
        ]
    }
}
