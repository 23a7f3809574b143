//! Compensation against Kalman on one log: estimates, settling times, errors, cost; and the files
//! `compare.json`, `compare.csv`, `outages.csv` and `report.html`.

pub(crate) mod cost;
pub mod five_stage;
pub mod kalman;
pub(crate) mod measure;
pub mod outage;
pub(crate) mod tracks;

use std::path::Path;

use indicatif::ProgressBar;
use ins_core::Time;
use miette::{Result, bail, miette};
use plotters::style::RGBColor;
use serde::Serialize;

use crate::identify::analysis;
use crate::identify::true_errors::Truth;
use crate::identify::words::with_sigma;
use crate::log::{BodyAxes, Grade, Meta};
use crate::page::chart::{Chart, Figure, MOST_POINTS, sampled};
use crate::page::html::{Page, Section};
use crate::page::plot::{BLUE, GREEN, GREY, ORANGE, RED, padded};
use crate::page::table::{Table, heads, titled};
use crate::page::{self, brief, digits, output};
pub use cost::{Cost, measure as measure_costs};
use measure::{COMPARED, columns_of_log};
pub use measure::{MethodResult, QuantityResult};
use outage::{Drift, OutageTest};
use tracks::{Input, Point, Track, noise};

/// File by which a folder is recognized as output of this command.
pub const JSON: &str = "compare.json";
/// Curves of the methods, in their order.
const CURVES: [(&str, RGBColor); 8] = [
    ("exact", BLUE),
    ("literal", GREY),
    ("five stages", RGBColor(190, 170, 60)),
    ("repeated", RGBColor(70, 170, 180)),
    ("Kalman", ORANGE),
    ("smoother", GREEN),
    ("noise / 3", RGBColor(150, 90, 180)),
    ("noise x 3", RGBColor(160, 120, 80)),
];

#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    pub log: String,
    pub duration_s: f64,
    /// Axes of the biases.
    pub body_axes: BodyAxes,
    /// Sensor class in the core's configuration.
    pub grade: Grade,
    /// Whether the true errors are known.
    pub simulated: bool,
    pub methods: Vec<MethodResult>,
    /// Time of whole passes over the log, in one run.
    pub costs: Vec<Cost>,
    /// Drift without GNSS; none where no outage fits.
    pub outages: Option<OutageTest>,
    /// First stamp of the log.
    #[serde(skip)]
    start: Time,
    #[serde(skip)]
    meta: Meta,
    #[serde(skip)]
    tracks: Vec<Track>,
    #[serde(skip)]
    truth: Option<Truth>,
}

impl Comparison {
    pub fn of_input(mut read: analysis::Input, progress: &ProgressBar) -> Result<Self> {
        // No other method uses a barometer.
        read.log.baro.clear();
        let (log, config, grade, truth) = (&read.log, read.config, read.grade, read.truth);
        let input = Input {
            log,
            config,
            noise: noise(grade, &config, truth.is_some()),
            truth: truth.as_ref(),
        };
        let unusable = |error: ins_core::ConfigError| miette!("cannot be used: {}", error);
        progress.set_message("all methods");
        let tracks = tracks::all(&input).map_err(unusable)?;
        if tracks.iter().all(|track| track.points.is_empty()) {
            bail!(
                help = "a longer log, with motion: see the warnings",
                "No method ever navigates: there is nothing to compare."
            );
        }
        progress.set_message("outages");
        let outages = outage::test(log, truth.is_some(), config, input.noise).map_err(unusable)?;
        progress.set_message("cost");
        let costs = cost::measure(log, config, input.noise).map_err(unusable)?;
        progress.finish_and_clear();
        Ok(Self {
            log: read.name,
            duration_s: log.duration_s(),
            body_axes: log.meta.body_axes,
            grade,
            simulated: truth.is_some(),
            methods: measure::results(&input, grade, &tracks),
            costs,
            outages,
            start: log.start(),
            meta: log.meta.clone(),
            tracks,
            truth,
        })
    }

    pub fn write(&self, folder: &Path) -> Result<()> {
        output::write(folder, JSON, page::json(self)?)?;
        self.page().write(folder)?;
        output::write(folder, "compare.csv", self.quantities_csv()?)?;
        Ok(output::write(folder, "outages.csv", self.outages_csv()?)?)
    }

    fn quantities_csv(&self) -> Result<String> {
        let number = |value: Option<f64>| value.map_or(String::new(), |v| format!("{v:.6}"));
        let row = |method: &MethodResult, result: &QuantityResult| {
            let quantity = &result.quantity;
            [
                method.method.clone(),
                result.name.to_owned(),
                number(Some(quantity.value)),
                number(Some(quantity.sigma)),
                u8::from(quantity.observable()).to_string(),
                number(result.error),
                number(result.settled_s),
            ]
        };
        let rows = (self.methods.iter()).flat_map(|method| {
            method
                .quantities
                .iter()
                .map(move |result| row(method, result))
        });
        page::csv(
            "method,quantity,value,sigma,observable,error,settled_s",
            rows,
        )
    }

    fn outages_csv(&self) -> Result<String> {
        let row = |navigator: &str, drift: &Drift| {
            let numbers = [
                drift.start_s,
                drift.position_end_m,
                drift.velocity_end_mps,
                drift.position_max_m,
                drift.velocity_max_mps,
            ];
            let mut cells = vec![navigator.to_owned()];
            cells.extend(numbers.map(|number| format!("{number:.4}")));
            cells
        };
        let all = self.outages.iter().flat_map(|test| &test.navigators);
        let rows = all.flat_map(|of| of.outages.iter().map(move |drift| row(of.navigator, drift)));
        let names = "navigator,start_s,position_end_m,velocity_end_mps,position_max_m,\
                     velocity_max_mps";
        page::csv(names, rows)
    }

    fn page(&self) -> Page {
        Page {
            title: format!("{}: compensation and Kalman", self.log),
            facts: format!(
                "{:.1} min \u{b7} body axes {} \u{b7} sensor class {} \u{b7} all methods on the same \
                 samples and fixes, from the same alignment, without a barometer",
                self.duration_s / 60.0,
                self.body_axes,
                self.grade.name()
            ),
            verdicts: Vec::new(),
            tables: tables(self),
            sections: vec![Section {
                title: "Estimates as they converge",
                note: "",
                figures: (1..COMPARED.len())
                    .map(|which| self.figure(which))
                    .collect(),
            }],
        }
    }

    /// One estimate by every method over time.
    fn figure(&self, which: usize) -> Figure {
        let (_, title, unit) = COMPARED[which];
        let mut chart = Chart::over_time(title, unit, self.duration_s);
        let mut settled = Vec::new();
        for (track, (method, colour)) in self.tracks.iter().zip(CURVES) {
            let point = |p: &Point| {
                let quantity = columns_of_log(&self.meta, p)[which];
                let time_s = p.time.seconds_since(self.start);
                quantity.observable().then_some((time_s, quantity.value))
            };
            let line: Vec<_> = track.points.iter().filter_map(point).collect();
            settled.extend(line.iter().skip(line.len() / 4).map(|point| point.1));
            chart = chart.line(method, colour, &sampled(&line, MOST_POINTS));
        }
        if let Some(truth) = self.truth.and_then(|truth| truth.columns()[which]) {
            settled.push(truth);
            let ends = [(0.0, truth), (self.duration_s, truth)];
            chart = chart.reference("truth", RED, &ends);
        }
        chart.range(padded(settled.into_iter(), 1e-3)).figure()
    }
}

pub fn plain(comparison: &Comparison) -> String {
    titled(&tables(comparison), Table::plain)
}

fn tables(comparison: &Comparison) -> Vec<Table> {
    let by_method = |title: &str, cell: fn(&QuantityResult) -> Option<String>, none: &str| {
        let methods = comparison.methods.iter();
        let names = methods.map(|method| method.method.clone());
        let header = [String::new()].into_iter().chain(names).collect();
        let row = |which: usize| {
            let cells = comparison.methods.iter().map(|method| {
                let Some(result) = method.quantities.get(which) else {
                    return "-".to_owned();
                };
                cell(result).unwrap_or_else(|| none.to_owned())
            });
            let mut row = vec![COMPARED[which].0.to_owned()];
            row.extend(cells);
            row
        };
        Table::of(title, header, (0..COMPARED.len()).map(row))
    };
    let value = |result: &QuantityResult| {
        let quantity = &result.quantity;
        quantity.observable().then(|| with_sigma(quantity))
    };
    let error = |result: &QuantityResult| Some(digits(result.quantity.sigma, result.error?));
    let settled = |result: &QuantityResult| Some(format!("{:.0}", result.settled_s?));
    let mut tables = vec![by_method(
        "At the end of the log, one sigma",
        value,
        "not observed",
    )];
    let against = if comparison.simulated {
        tables.push(by_method("Error", error, "-"));
        "the truth"
    } else {
        "its last value"
    };
    tables.push(by_method(
        &format!("Stays close to {against} from, s"),
        settled,
        "-",
    ));
    tables.extend(trajectories(comparison));
    tables.push(costs(comparison));
    tables.extend(comparison.outages.as_ref().map(OutageTest::table));
    tables
}

fn trajectories(comparison: &Comparison) -> Option<Table> {
    let rows: Vec<Vec<String>> = comparison
        .methods
        .iter()
        .filter_map(|method| {
            let error = method.trajectory?;
            let mut row = vec![method.method.clone()];
            row.extend([error.position_m, error.velocity_mps, error.heading_deg].map(brief));
            Some(row)
        })
        .collect();
    let title = "RMS difference from truth.csv, second half of the log";
    let header = heads("| position, m | velocity, m/s | heading, deg");
    (!rows.is_empty()).then(|| Table::of(title, header, rows))
}

fn costs(comparison: &Comparison) -> Table {
    let row = |cost: &Cost| {
        vec![
            cost.method.to_owned(),
            format!("{:.0}", cost.sample_ns),
            format!("{:.1}", cost.ratio),
        ]
    };
    let title = "Cost of an inertial sample with its share of the fixes, on this machine";
    Table::of(
        title,
        heads("| ns | ratio"),
        comparison.costs.iter().map(row),
    )
}
