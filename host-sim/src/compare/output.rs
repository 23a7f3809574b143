//! `compare.json`, `compare.csv`, `outages.csv`, `report.html`, and the tables for people.

use std::io::Write;
use std::path::Path;

use miette::{IntoDiagnostic, Result};
use plotters::style::RGBColor;

use super::measure::{NAMES, columns};
use super::outage::OutageTest;
use super::{Comparison, MethodResult, QuantityResult};
use crate::identify::words::with_sigma;
use crate::page::chart::{Chart, Figure, MOST_POINTS, sampled};
use crate::page::digits;
use crate::page::html::{Page, Section};
use crate::page::plot::{BLUE, GREEN, GREY, ORANGE, RED, padded};
use crate::page::table::{Table, heads};
use crate::page::{self, output};

/// Name of the file that marks the folder as ours.
pub const JSON: &str = "compare.json";
const TITLES: [&str; 8] = [
    "Heading, deg",
    "Accelerometer x, mg",
    "Accelerometer y, mg",
    "Accelerometer z, mg",
    "Gyro x, deg/h",
    "Gyro y, deg/h",
    "Gyro z, deg/h",
    "GNSS latency, ms",
];
/// Of the methods, in their order.
const SHORT: [&str; 8] = [
    "exact",
    "literal",
    "five stages",
    "repeated",
    "Kalman",
    "smoother",
    "noise / 3",
    "noise x 3",
];
const COLOURS: [RGBColor; 8] = [
    BLUE,
    GREY,
    RGBColor(190, 170, 60),
    RGBColor(70, 170, 180),
    ORANGE,
    GREEN,
    RGBColor(150, 90, 180),
    RGBColor(160, 120, 80),
];

impl Comparison {
    /// Writes all files into a folder.
    pub fn write(&self, folder: &Path) -> Result<()> {
        output::write(folder, JSON, page::json(self)?)?;
        output::write(folder, "report.html", self.html().into_diagnostic()?)?;
        (self.write_quantities(output::create(folder, "compare.csv")?)).into_diagnostic()?;
        (self.write_outages(output::create(folder, "outages.csv")?)).into_diagnostic()
    }

    fn write_quantities(&self, to: impl Write) -> csv::Result<()> {
        let mut to = csv::Writer::from_writer(to);
        let header = "method,quantity,value,sigma,observable,error,settled_s";
        to.write_record(header.split(','))?;
        let number = |value: Option<f64>| value.map_or(String::new(), |v| format!("{v:.6}"));
        for method in &self.methods {
            for result in &method.quantities {
                let quantity = &result.quantity;
                to.write_record([
                    method.method.as_str(),
                    result.name,
                    &format!("{:.6}", quantity.value),
                    &format!("{:.6}", quantity.sigma),
                    if quantity.observable() { "1" } else { "0" },
                    &number(result.error),
                    &number(result.settled_s),
                ])?;
            }
        }
        Ok(to.flush()?)
    }

    fn write_outages(&self, to: impl Write) -> csv::Result<()> {
        let mut to = csv::Writer::from_writer(to);
        let header = "navigator,start_s,position_end_m,velocity_end_mps,position_max_m,\
                      velocity_max_mps";
        to.write_record(header.split(','))?;
        for drifts in self.outages.iter().flat_map(|test| &test.navigators) {
            for drift in &drifts.outages {
                let numbers = [
                    drift.start_s,
                    drift.position_end_m,
                    drift.velocity_end_mps,
                    drift.position_max_m,
                    drift.velocity_max_mps,
                ];
                let mut cells = vec![drifts.navigator.to_owned()];
                cells.extend(numbers.map(|number| format!("{number:.4}")));
                to.write_record(cells)?;
            }
        }
        Ok(to.flush()?)
    }

    fn html(&self) -> Result<String, minijinja::Error> {
        let page = Page {
            title: format!("{}: compensation and Kalman", self.log),
            facts: format!(
                "{:.1} min \u{b7} body axes {} \u{b7} sensor class {} \u{b7} all methods on the same \
                 samples and fixes, from the same alignment",
                self.duration_s / 60.0,
                self.body_axes,
                self.grade.name()
            ),
            verdicts: Vec::new(),
            tables: tables(self),
            sections: vec![Section {
                title: "Estimates as they converge",
                note: "",
                figures: (1..NAMES.len()).map(|which| self.figure(which)).collect(),
            }],
        };
        page.html()
    }

    /// One estimate by every method, as it converges.
    fn figure(&self, which: usize) -> Figure {
        let starts = self.tracks.iter().filter_map(|track| track.points.first());
        let first = starts.map(|p| p.time).min().unwrap_or_default();
        let (title, unit) = TITLES[which]
            .split_once(", ")
            .unwrap_or((TITLES[which], ""));
        let mut chart = Chart::over_time(title, unit, self.duration_s);
        let mut settled = Vec::new();
        for ((track, method), colour) in self.tracks.iter().zip(SHORT).zip(COLOURS) {
            let point = |p: &super::tracks::Point| {
                let value = columns(self.body_axes, p)[which].value;
                (p.time.seconds_since(first), value)
            };
            let line: Vec<_> = track.points.iter().map(point).collect();
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

/// All tables, for a terminal.
pub fn plain(comparison: &Comparison) -> String {
    let texts: Vec<String> = tables(comparison)
        .iter()
        .map(|t| format!("{}\n\n{}", t.title, t.plain()))
        .collect();
    texts.join("\n")
}

fn tables(comparison: &Comparison) -> Vec<Table> {
    let mut tables = vec![by_method(
        "At the end of the log, one sigma",
        comparison,
        &|result| {
            if result.quantity.observable() {
                with_sigma(&result.quantity)
            } else {
                "not observed".to_owned()
            }
        },
    )];
    if comparison.simulated {
        tables.push(by_method("Error", comparison, &|result| {
            result
                .error
                .map_or("-".to_owned(), |error| digits(result.quantity.sigma, error))
        }));
    }
    let against = if comparison.simulated {
        "the truth"
    } else {
        "its last value"
    };
    tables.push(by_method(
        &format!("Stays close to {against} from, s"),
        comparison,
        &|result| {
            result
                .settled_s
                .map_or("-".to_owned(), |s| format!("{s:.0}"))
        },
    ));
    tables.extend(trajectories(comparison));
    tables.push(costs(comparison));
    tables.extend(outages(comparison));
    tables
}

/// A row for each quantity, a column for each method.
fn by_method(
    title: &str,
    comparison: &Comparison,
    cell: &dyn Fn(&QuantityResult) -> String,
) -> Table {
    let mut header = vec![String::new()];
    header.extend(
        comparison
            .methods
            .iter()
            .map(|method| method.method.clone()),
    );
    let row = |which: usize| {
        let mut row = vec![NAMES[which].to_owned()];
        row.extend(comparison.methods.iter().map(|method: &MethodResult| {
            method.quantities.get(which).map_or("-".to_owned(), cell)
        }));
        row
    };
    Table::new(title, header, (0..NAMES.len()).map(row).collect())
}

fn trajectories(comparison: &Comparison) -> Option<Table> {
    let rows: Vec<Vec<String>> = comparison
        .methods
        .iter()
        .filter_map(|method| {
            let error = method.trajectory?;
            let mut row = vec![method.method.clone()];
            row.extend(
                [error.position_m, error.velocity_mps, error.heading_deg].map(|v| digits(v, v)),
            );
            Some(row)
        })
        .collect();
    let title = "RMS difference from truth.csv, second half of the log";
    let header = heads("| position, m | velocity, m/s | heading, deg");
    (!rows.is_empty()).then(|| Table::new(title, header, rows))
}

fn costs(comparison: &Comparison) -> Table {
    let row = |cost: &super::Cost| {
        vec![
            cost.method.to_owned(),
            format!("{:.0}", cost.sample_ns),
            format!("{:.1}", cost.ratio),
        ]
    };
    let title = "Cost of an inertial sample with its share of the fixes, on this machine";
    let rows = comparison.costs.iter().map(row).collect();
    Table::new(title, heads("| ns | ratio"), rows)
}

fn outages(comparison: &Comparison) -> Option<Table> {
    comparison.outages.as_ref().map(OutageTest::table)
}
