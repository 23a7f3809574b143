//! Output of `study flights`.

use std::path::Path;

use miette::Result;

use super::run::{BIASES_DEG_H, Run, VARIANTS, WALKS_DEG_SQRT_H};
use super::schuler::{Oscillation, Point};
use super::summary::{End, Growth, Summary, THESIS_KM, Walk};
use crate::page::plot::{BLUE, GREEN, GREY, Mark, ORANGE, Plot, padded};
use crate::page::table::{Table, heads, titled};
use crate::page::{self, output};

/// File name of the summary; marks the folder as ours.
pub const SUMMARY: &str = "flights.json";

/// Writes the summary, a table with one row per flight, and pictures.
pub fn write(folder: &Path, runs: &[Run], summary: &Summary) -> Result<()> {
    for (name, contents) in [
        (SUMMARY, page::json(summary)?),
        ("flights.csv", table(runs)?),
        ("free_flight.svg", oscillation(&summary.schuler.curves)),
        ("position_error.svg", growth(summary)),
    ] {
        output::write(folder, name, contents)?;
    }
    Ok(())
}

/// One row per flight: residual errors of the estimates, errors at the end.
fn table(runs: &[Run]) -> Result<String> {
    let mut names = "seed,gyro_left_deg_h_x,gyro_left_deg_h_y,gyro_left_deg_h_z,accel_left_mg_x,\
                     accel_left_mg_y,accel_left_mg_z,azimuth_left_deg,latency_left_ms"
        .to_owned();
    names.extend(VARIANTS.map(|name| format!(",{name}_position_m,{name}_velocity_mps")));
    let row = |run: &Run| {
        let left = &run.left;
        let mut values = [left.gyro_deg_h, left.accel_mg].concat();
        values.extend([left.azimuth_deg, left.latency_ms]);
        let ends = run.free.iter().filter_map(|errors| errors.last());
        values.extend(ends.flat_map(|end| [end.position_m, end.velocity_mps]));
        let cells = values.into_iter().map(|value| format!("{value:.6}"));
        let seed = std::iter::once(run.seed.to_string());
        seed.chain(cells).collect::<Vec<_>>()
    };
    page::csv(&names, runs.iter().map(row))
}

// --- pictures ---

/// Velocity error of the long straight flight, and by (1)-(2).
fn oscillation(curves: &[Point]) -> String {
    let line = |which: usize, axis: usize| -> Vec<(f64, f64)> {
        curves
            .iter()
            .map(|point| (point.time_s / 60.0, point.errors_mps[which][axis]))
            .collect()
    };
    let all = || curves.iter().flat_map(|point| point.errors_mps);
    Plot {
        size: (900, 420),
        labels: [
            "time without GNSS, min: east (blue), north (orange), by (1)-(2) (grey), with the \
             rotation of the frame (green)",
            "velocity error, m/s",
        ],
        x: padded(curves.iter().map(|point| point.time_s / 60.0), 1.0),
        y: padded(all().flat_map(|error| [error.x, error.y]), 0.1),
        marks: vec![
            Mark::Line(line(0, 0), BLUE),
            Mark::Line(line(0, 1), ORANGE),
            Mark::Reference(line(1, 0), GREY),
            Mark::Reference(line(1, 1), GREY),
            Mark::Reference(line(2, 0), GREEN),
            Mark::Reference(line(2, 1), GREEN),
        ],
    }
    .svg()
}

fn growth(summary: &Summary) -> String {
    let line = |value: fn(&Growth) -> f64| -> Vec<(f64, f64)> {
        let minutes = summary.growth.iter();
        minutes.map(|at| (at.minute as f64, value(at))).collect()
    };
    let applied = line(|at| at.with_estimates_km);
    let quiet = line(|at| at.without_noise_km);
    let minutes = summary.growth.len() as f64;
    let thesis = vec![(0.0, THESIS_KM), (minutes, THESIS_KM)];
    Plot {
        size: (900, 340),
        labels: [
            "time without GNSS, min: estimates applied (blue), without noise (orange), thesis \
             after 1 h (grey)",
            "RMS position error, km",
        ],
        x: (0.0, minutes),
        y: padded(applied.iter().map(|p| p.1).chain([0.0, THESIS_KM]), 1.0),
        marks: vec![
            Mark::Line(applied, BLUE),
            Mark::Line(quiet, ORANGE),
            Mark::Reference(thesis, GREY),
        ],
    }
    .svg()
}

// --- tables ---

pub fn readable(summary: &Summary) -> String {
    text(summary, Table::plain)
}

pub fn markdown(summary: &Summary) -> String {
    text(summary, Table::markdown)
}

fn text(summary: &Summary, text_of: fn(&Table) -> String) -> String {
    let left = &summary.left;
    let [gx, gy, gz] = left.gyro_deg_h;
    let [ax, ay, az] = left.accel_mg;
    let tables = [ends, grid, walks, models].map(|table| table(summary));
    format!(
        "{} flights of the Cessna 172, ring-laser class (1 deg/h, 0.125 deg/sqrt(h)): {} min damped\n\
         by GNSS, then {} min free, at a height held by a barometer. RMS errors left in the\n\
         estimates: gyros {gx:.2}, {gy:.2}, {gz:.2} deg/h, accelerometers {ax:.3}, {ay:.3}, {az:.3} mg,\n\
         azimuth {:.3} deg, latency {:.1} ms.\n\n{}",
        summary.runs,
        summary.minutes_aided,
        summary.minutes_free,
        left.azimuth_deg,
        left.latency_ms,
        titled(&tables, text_of)
    )
}

fn ends(summary: &Summary) -> Table {
    let row = |name: &str, end: &End| {
        vec![
            name.to_owned(),
            format!("{:.2}", end.position_km.rms),
            (end.position_km.rms_95).map_or_else(
                || "-".to_owned(),
                |[low, high]| format!("{low:.2} to {high:.2}"),
            ),
            format!("{:.2}", end.position_km.median),
            format!("{:.2}", end.velocity_mps.rms),
        ]
    };
    let alone = |name: &str, position_km: f64| {
        let mut cells = vec![name.to_owned(), format!("{position_km:.2}")];
        cells.extend([const { String::new() }; 3]);
        cells
    };
    let quiet = "the same, sensors without noise from then on";
    let rows = [
        row("estimates applied", &summary.with_estimates),
        row(quiet, &summary.without_noise),
        row("readings as they are", &summary.raw),
        alone("R * 1 deg/h * t", summary.one_deg_h_km),
        alone("thesis, after 1 h", THESIS_KM),
    ];
    let header = heads("| RMS, km | 95 % | median, km | RMS, m/s");
    Table::of("Horizontal error at the end:", header, rows)
}

fn grid(summary: &Summary) -> Table {
    let mut header = heads("random walk, deg/sqrt(h)");
    header.extend(BIASES_DEG_H.map(|bias| format!("bias {bias} deg/h")));
    let row = |(row, walk): (usize, &Walk)| {
        let cells_of_walk = (summary.grid.iter().skip(row)).step_by(WALKS_DEG_SQRT_H.len());
        let mut cells = vec![walk.random_walk_deg_sqrt_h.to_string()];
        cells.extend(cells_of_walk.map(|cell| {
            let mark = if cell.reached == Some(true) { " *" } else { "" };
            format!("{:.2}{mark}", cell.position_km)
        }));
        cells
    };
    let legend = if summary.grid.iter().any(|cell| cell.reached.is_some()) {
        format!("; * reaches the {THESIS_KM} km of the thesis")
    } else {
        String::new()
    };
    let title = format!("RMS position error, km, of residual gyro errors alone{legend}:");
    Table::of(title, header, summary.walks.iter().enumerate().map(row))
}

fn walks(summary: &Summary) -> Table {
    let row = |walk: &Walk| {
        let room = walk.largest_bias_deg_h;
        vec![
            walk.random_walk_deg_sqrt_h.to_string(),
            format!("{:.2}", walk.position_km),
            format!("{:.2}", walk.linear_model_km),
            room.map_or("none".to_owned(), |bias| format!("{bias:.3}")),
        ]
    };
    let title = format!(
        "The random walk alone, and the bias that it leaves room for within {THESIS_KM} km:"
    );
    let header = heads("random walk, deg/sqrt(h) | flown, km | linear model, km | bias, deg/h");
    Table::of(title, header, summary.walks.iter().map(row))
}

/// Velocity errors against the linear model: differences, and the oscillation.
fn models(summary: &Summary) -> Table {
    let (model, schuler) = (&summary.linear_model, &summary.schuler);
    let number = |value: f64| format!("{value:.2}");
    let percent = |name: &str, both: [f64; 2]| {
        let [printed, rotating] = both.map(|part| number(100.0 * part));
        vec![format!("{name}, %"), String::new(), printed, rotating]
    };
    let all = [&schuler.ins, &schuler.model, &schuler.rotating_model];
    let straight = format!("straight flight of {} min, biases only", schuler.minutes);
    let oscillation = |name: &str, value: fn(&Oscillation) -> f64| {
        let [ins, printed, rotating] = all.map(|of| number(value(of)));
        vec![format!("{straight}: {name}"), ins, printed, rotating]
    };
    Table {
        title: format!(
            "Velocity errors against the linear model: RMS difference over RMS error, and the\n\
             oscillation ({:.2} min by 2 pi sqrt(R/g)):",
            schuler.period_min
        ),
        header: heads("| INS | (1)-(2) | with the frame's rotation"),
        rows: vec![
            percent(
                "free parts, estimates applied",
                [model.with_estimates, model.with_estimates_rotating],
            ),
            percent(
                "free parts, readings as they are",
                [model.raw, model.raw_rotating],
            ),
            percent(
                &straight,
                [schuler.model_difference, schuler.rotating_model_difference],
            ),
            oscillation("period, min", |o| o.period_min),
            oscillation("amplitude east, m/s", |o| o.east_mps),
            oscillation("amplitude north, m/s", |o| o.north_mps),
        ],
    }
}
