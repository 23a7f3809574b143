//! Files and tables of a rehearsal.

use std::path::Path;

use miette::Result;
use serde::Serialize;

use super::run::{Gnss, HEADING, POSITION, QUANTITIES};
use super::settings::{DriveVerdict, Key};
use super::summary::{BUDGETED, BudgetLine, FEWEST_MODELS, Models, Moment, Row, Summary, Tested};
use crate::page::chart::{Chart, Figure, Point};
use crate::page::html::{Page, REPORT, Section};
use crate::page::output::replace;
use crate::page::plot::{BLUE, GREEN, GREY, ORANGE, RED};
use crate::page::table::{Table, cells, heads, titled};
use crate::page::{self, digits, json};

/// File names; the first marks a rehearsal as finished.
pub const SUMMARY: &str = "rehearsal.json";
const TABLE: &str = "errors.csv";
const OVERVIEW: &str = "overview.md";
const TIMES: &str = "times.json";

/// Smaller errors are drawn at this value.
const LEAST: f64 = 1e-3;
/// Colours of the algorithms, in turn.
const COLOURS: [plotters::style::RGBColor; 5] = [BLUE, ORANGE, GREEN, RED, GREY];

/// Writes all files but the model's. Times are in a file of their own: the others are the same to the bit
/// when the flights are repeated.
pub fn write(folder: &Path, summary: &Summary) -> Result<()> {
    #[derive(Serialize)]
    struct Took<'a> {
        with: &'a str,
        seconds_a_flight: f64,
    }
    let times = summary.tested.iter().map(|tested| Took {
        with: &tested.with,
        seconds_a_flight: tested.took_s,
    });
    let times: Vec<Took> = times.collect();
    let files = [
        (TABLE, csv(summary)?),
        (REPORT, page_of(summary).html()?),
        (OVERVIEW, for_a_page(summary)),
        (TIMES, json(&times)?),
        (SUMMARY, json(summary)?),
    ];
    for (name, text) in files {
        replace(&folder.join(name), &text)?;
    }
    Ok(())
}

/// Errors over time, algorithm by algorithm.
fn csv(summary: &Summary) -> Result<String> {
    let mut names = "with,noise,time_s,gnss".to_owned();
    for quantity in &QUANTITIES {
        let name = quantity.name.replace(' ', "_");
        let unit = quantity.unit.replace("m/s", "mps");
        names.extend(["rms", "median", "below_95"].map(|what| format!(",{name}_{what}_{unit}")));
        names.extend([",", &name, "_flights"]);
    }
    let row = |tested: &Tested, moment: &Moment| {
        let noise = ["white", "recorded"][usize::from(tested.recorded_noise)];
        let mut row = vec![
            tested.with.clone(),
            noise.to_owned(),
            moment.time_s.to_string(),
            u8::from(moment.gnss == Gnss::Aided).to_string(),
        ];
        for errors in &moment.errors {
            match errors {
                Some(e) => {
                    row.extend([e.rms, e.median, e.below_95].map(|value| format!("{value:.6}")));
                    row.push(e.flights.to_string());
                }
                None => row.extend(cells(["", "", "", "0"])),
            }
        }
        row
    };
    let rows = (summary.tested.iter())
        .flat_map(|tested| tested.moments.iter().map(move |moment| row(tested, moment)));
    page::csv(&names, rows)
}

// --- tables ---

fn name(tested: &Tested) -> String {
    if tested.recorded_noise {
        format!("{}, recorded noise", tested.with)
    } else {
        tested.with.clone()
    }
}

fn interval([low, high]: [f64; 2]) -> String {
    let width = 0.5 * (high - low);
    // One flight has no interval.
    if width <= 0.0 {
        return "-".to_owned();
    }
    format!("{} to {}", digits(width, low), digits(width, high))
}

/// Three digits.
pub(super) fn shown(value: f64) -> String {
    digits(0.1 * value, value)
}

fn seconds(value: f64) -> String {
    format!("{value:.0} s")
}

fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}

fn overview(summary: &Summary) -> Table {
    let free_s = summary.last_s;
    let mut header = heads("RMS | flights | with GNSS: position, m | heading, deg");
    if free_s.is_some() {
        header.extend(heads(
            "without: position, m | 95 % of the flights below | velocity, m/s | heading, deg",
        ));
    }
    header.push("s a flight".to_owned());
    let row = |tested: &Tested| {
        let value = |quantity, at, of: fn(&Row) -> f64| {
            let row = tested.row(quantity, at);
            row.map_or_else(|| "-".to_owned(), |row| shown(of(row)))
        };
        let rms = |row: &Row| row.figure.rms;
        let mut row = vec![
            name(tested),
            format!("{} of {}", summary.solved(tested), summary.flights),
            value(POSITION, None, rms),
            value(HEADING, None, rms),
        ];
        if free_s.is_some() {
            row.extend([
                value(POSITION, free_s, rms),
                value(POSITION, free_s, |row| row.below_95),
                value(2, free_s, rms),
                value(HEADING, free_s, rms),
            ]);
        }
        row.push(if tested.flights > 0 {
            format!("{:.2}", tested.took_s)
        } else {
            "-".to_owned()
        });
        row
    };
    let title = format!(
        "{} flight{} of {}, the last {} without GNSS; model of {} drive{}",
        summary.flights,
        plural(summary.flights as usize),
        seconds(summary.duration_s),
        seconds(summary.free_s),
        summary.drives.len(),
        plural(summary.drives.len())
    );
    Table::of(title, header, summary.tested.iter().map(row))
}

fn details(tested: &Tested) -> Table {
    let with_model = tested.models.is_some();
    let mut header = cells(["error", "", "flights", "RMS", "95 %, flights"]);
    if with_model {
        header.push("95 %, model".to_owned());
    }
    header.extend(cells(["median", "95 % of the flights below"]));
    let row = |row: &Row| {
        let place = row.without_gnss_s.map_or_else(
            || "with GNSS".to_owned(),
            |since_s| format!("{since_s} s without"),
        );
        let mut cells = vec![
            format!("{}, {}", row.quantity, row.unit),
            place,
            row.flights.to_string(),
            shown(row.figure.rms),
            (row.figure.rms_95).map_or_else(|| "-".to_owned(), interval),
        ];
        if with_model {
            cells.push(row.model_95.map_or_else(|| "-".to_owned(), interval));
        }
        cells.extend([shown(row.figure.median), shown(row.below_95)]);
        cells
    };
    Table::of(name(tested), header, tested.rows.iter().map(row))
}

/// Flights without an answer, and those that the aircraft could not fly.
fn outcomes(summary: &Summary) -> Option<Table> {
    let row = |name: &str, outcome: &str, flights: usize, first: &str, cause: &str| {
        cells([name, outcome, &flights.to_string(), first, cause])
    };
    let mut rows = Vec::new();
    for tested in &summary.tested {
        let name = name(tested);
        rows.extend(tested.failures.iter().map(|failed| {
            let first = format!("flight {}, {}", failed.first, seconds(failed.at_s));
            let fault = failed.fault.in_words();
            row(&name, fault, failed.flights, &first, &failed.cause)
        }));
        let without = tested.flights - summary.solved(tested);
        if without > 0 {
            let never = "had none where errors are looked at last";
            rows.push(row(&name, "no solution", without, "", never));
        }
        for models in tested.models.iter().filter(|models| models.without > 0) {
            let cause = format!(
                "with {} of {} models drawn: the intervals of the model are of the others",
                models.without, models.drawn
            );
            rows.push(cells([&name, "no solution", "", "", &cause]));
        }
        let solved = |models: &Models| models.drawn as usize - models.without;
        let few = |models: &Models| (1..FEWEST_MODELS).contains(&solved(models));
        if tested.models.as_ref().is_some_and(few) {
            let cause = format!("an interval of the model takes {FEWEST_MODELS} models drawn");
            rows.push(cells([&name, "no interval", "", "", &cause]));
        }
    }
    if let Some(not) = &summary.not_flown {
        let first = format!("flight {}", not.first);
        rows.push(row("-", "not flown", not.flights, &first, &not.cause));
    }
    let header = heads("| outcome | flights | first | cause");
    (!rows.is_empty()).then(|| Table::of("Flights without a result", header, rows))
}

fn budget(summary: &Summary) -> Option<Table> {
    let mut header = cells([""]);
    for (quantity, free) in BUDGETED {
        let q = &QUANTITIES[quantity];
        let place = if free { "without GNSS" } else { "with GNSS" };
        header.push(format!("{}, {}, {place}: alone", q.name, q.unit));
        header.push("without it".to_owned());
    }
    let row = |cost: &BudgetLine| {
        let cell = |value: Option<f64>| value.map_or_else(String::new, shown);
        let mut row = vec![cost.source.unwrap_or("all").to_owned()];
        for (alone, without) in cost.alone.into_iter().zip(cost.without) {
            row.extend([cell(alone), cell(without)]);
        }
        row
    };
    let first = summary.tested.first().map_or("", |tested| &tested.with);
    let title =
        format!("What each error costs {first}: RMS with it alone, and what is left without it");
    (!summary.budget.is_empty()).then(|| Table::of(title, header, summary.budget.iter().map(row)))
}

fn assumed(summary: &Summary) -> Table {
    let row = |part: &crate::identify::error_model::Assumed| part.cells().to_vec();
    let title = "What the drives do not show, and what was assumed instead";
    Table::of(
        title,
        heads("| assumed | why"),
        summary.assumed.iter().map(row),
    )
}

fn set(summary: &Summary) -> Option<Table> {
    let row = |key: &Key| cells([&key.name, &key.value.to_string()]);
    let title = "Set by --set, in place of what was identified or assumed";
    (!summary.set.is_empty())
        .then(|| Table::of(title, cells(["", ""]), summary.set.iter().map(row)))
}

fn tables(summary: &Summary) -> Vec<Table> {
    let mut all = vec![overview(summary)];
    all.extend(outcomes(summary));
    let with_rows = summary.tested.iter().filter(|t| !t.rows.is_empty());
    all.extend(with_rows.map(details));
    all.extend(budget(summary));
    let model = Table {
        title: "The model, with what the drives leave open".to_owned(),
        ..summary.model.clone()
    };
    all.extend([model, assumed(summary)]);
    all.extend(set(summary));
    all
}

pub fn readable(summary: &Summary) -> String {
    let tables = titled(&tables(summary), Table::plain);
    format!("{}\n\n{tables}\n", verdicts(summary).join("\n"))
}

/// Whether the drives can be trusted.
fn verdicts(summary: &Summary) -> Vec<String> {
    summary
        .verdicts
        .iter()
        .flat_map(DriveVerdict::lines)
        .collect()
}

/// The algorithms beside each other, in Markdown.
fn for_a_page(summary: &Summary) -> String {
    let mut tables = vec![overview(summary)];
    tables.extend(outcomes(summary));
    titled(&tables, Table::markdown) + "\n"
}

// --- page ---

fn page_of(summary: &Summary) -> Page {
    Page {
        title: "Rehearsal: how accurate it will be in the air".to_owned(),
        facts: format!(
            "model of {} \u{b7} host-sim {}",
            summary.drives.join(", "),
            env!("CARGO_PKG_VERSION")
        ),
        verdicts: verdicts(summary),
        tables: tables(summary),
        sections: vec![Section {
            title: "Errors over time",
            note: "RMS of all flights.",
            figures: (0..QUANTITIES.len())
                .map(|quantity| figure(summary, quantity))
                .collect(),
        }],
    }
}

/// RMS of one quantity over time, by every algorithm.
fn figure(summary: &Summary, quantity: usize) -> Figure {
    let (end_s, of) = (summary.duration_s, &QUANTITIES[quantity]);
    let curve = |tested: &Tested| -> Vec<Point> {
        let points = tested.moments.iter();
        points
            .filter_map(|m| Some((m.time_s, m.errors[quantity]?.rms.max(LEAST))))
            .collect()
    };
    let curves: Vec<Vec<Point>> = summary.tested.iter().map(curve).collect();
    let mut chart = Chart::over_time(of.name, of.unit, end_s)
        .shade("without GNSS", &[(end_s - summary.free_s, end_s)]);
    let coloured = summary.tested.iter().zip(COLOURS.iter().cycle());
    for ((tested, colour), curve) in coloured.zip(&curves) {
        chart = chart.line(&name(tested), *colour, curve);
    }
    chart
        .logarithmic_y(curves.iter().flatten().map(|point| point.1))
        .figure()
}
