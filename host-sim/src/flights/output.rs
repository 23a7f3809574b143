//! What `flights` writes and prints.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use miette::{IntoDiagnostic, Result};

use super::run::{BIASES_DEG_H, Run, WALKS_DEG_SQRT_H};
use super::schuler::{Oscillation, Point};
use super::summary::{End, NAMES, Summary, THESIS_KM};
use crate::output::{self, OutputError};
use crate::report::plot::{BLUE, GREEN, GREY, Mark, ORANGE, Plot, padded};

/// File name of the summary; marks the folder as ours.
pub const SUMMARY: &str = "flights.json";

/// Writes the summary, a table with one row per flight, and pictures.
pub fn write(out: &Path, force: bool, runs: &[Run], summary: &Summary) -> Result<()> {
    let json = serde_json::to_string_pretty(summary).into_diagnostic()? + "\n";
    let csv = table(runs).into_diagnostic()?;
    output::build(out, SUMMARY, force, |folder| -> Result<()> {
        for (name, contents) in [
            (SUMMARY, json.into_bytes()),
            ("flights.csv", csv),
            (
                "free_flight.svg",
                oscillation(&summary.schuler.curves).into_bytes(),
            ),
            ("position_error.svg", growth(summary).into_bytes()),
        ] {
            let path = folder.join(name);
            fs::write(&path, contents).map_err(|e| OutputError::io(&path, e))?;
        }
        Ok(())
    })
}

/// One row per flight: errors left in the estimates, errors at the end.
fn table(runs: &[Run]) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut head: Vec<String> = vec!["seed".into()];
    for name in ["gyro_left_deg_h", "accel_left_mg"] {
        head.extend(["x", "y", "z"].map(|axis| format!("{name}_{axis}")));
    }
    head.extend(["azimuth_left_deg", "latency_left_ms"].map(String::from));
    for name in NAMES {
        head.extend(["position_m", "velocity_mps"].map(|what| format!("{name}_{what}")));
    }
    writer.write_record(&head)?;
    for run in runs {
        let left = &run.left;
        let mut row = vec![run.seed.to_string()];
        let mut add = |value: f64| row.push(format!("{value:.6}"));
        left.gyro_deg_h.into_iter().for_each(&mut add);
        left.accel_mg.into_iter().for_each(&mut add);
        add(left.azimuth_deg);
        add(left.latency_ms);
        for end in run.free.iter().filter_map(|errors| errors.last()) {
            add(end.position_m);
            add(end.velocity_mps);
        }
        writer.write_record(&row)?;
    }
    writer
        .into_inner()
        .map_err(|error| error.into_error().into())
}

// --- pictures ---

/// Velocity error of the long straight flight, and what (1)-(2) say.
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
        x_label: "time without GNSS, min: east (blue), north (orange), by (1)-(2) (grey), with the rotation of the frame (green)".to_owned(),
        y_label: "velocity error, m/s".to_owned(),
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

/// Growth of the position error.
fn growth(summary: &Summary) -> String {
    let line = |value: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
        (0..summary.growth.len())
            .map(|at| (summary.growth[at].minute as f64, value(at)))
            .collect()
    };
    let (applied, quiet) = (
        line(&|at| summary.growth[at].with_estimates_km),
        line(&|at| summary.growth[at].without_noise_km),
    );
    let minutes = summary.growth.len() as f64;
    let thesis = vec![(0.0, THESIS_KM), (minutes, THESIS_KM)];
    Plot {
        size: (900, 340),
        x_label: "time without GNSS, min: estimates applied (blue), without noise (orange), thesis after 1 h (grey)".to_owned(),
        y_label: "RMS position error, km".to_owned(),
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

// --- text ---

/// The figures for a person.
pub fn readable(summary: &Summary) -> String {
    let mut text = format!(
        "{} flights of the Cessna 172, ring-laser class (1 deg/h, 0.125 deg/sqrt(h)): {} min damped\n\
         by GNSS, then {} min free, at a height held by a barometer.\n\n",
        summary.runs, summary.minutes_aided, summary.minutes_free
    );
    ends(&mut text, summary);
    grid(&mut text, summary);
    oscillations(&mut text, summary);
    text
}

fn ends(text: &mut String, summary: &Summary) {
    let left = &summary.left;
    let [gx, gy, gz] = left.gyro_deg_h;
    let [ax, ay, az] = left.accel_mg;
    let _ = writeln!(
        text,
        "RMS errors left in the estimates: gyros {gx:.3} {gy:.3} {gz:.3} deg/h, accelerometers \
         {ax:.3} {ay:.3} {az:.3} mg,\nazimuth {:.3} deg, latency {:.2} ms\n",
        left.azimuth_deg, left.latency_ms
    );
    let _ = writeln!(
        text,
        "{:<44}{:>10}{:>18}{:>9}{:>12}",
        "horizontal error at the end", "RMS, km", "95 %", "median", "RMS, m/s"
    );
    let rows: [(&str, &End); 3] = [
        ("estimates applied", &summary.with_estimates),
        ("the same without noise when free", &summary.without_noise),
        ("readings as they are", &summary.raw),
    ];
    for (name, end) in rows {
        let [low, high] = end.position_km.rms_95;
        let interval = format!("{low:.2} to {high:.2}");
        let _ = writeln!(
            text,
            "{name:<44}{:>10.2}{interval:>18}{:>9.2}{:>12.2}",
            end.position_km.rms, end.position_km.median, end.velocity_mps.rms
        );
    }
    let _ = writeln!(
        text,
        "{:<44}{THESIS_KM:>10.2}\n{:<44}{:>10.2}\n",
        "thesis, after 1 h", "R * 1 deg/h * t", summary.one_deg_h_km
    );
}

fn grid(text: &mut String, summary: &Summary) {
    let _ = writeln!(
        text,
        "RMS position error, km, of gyro errors alone; * reaches {THESIS_KM} km\n{:<28}{}",
        "residual bias, deg/h",
        BIASES_DEG_H.map(|bias| format!("{bias:>9}")).concat()
    );
    for (row, walk) in summary.walks.iter().enumerate() {
        let _ = write!(
            text,
            "{:<28}",
            format!("walk {} deg/sqrt(h)", walk.random_walk_deg_sqrt_h)
        );
        for cell in summary
            .grid
            .iter()
            .skip(row)
            .step_by(WALKS_DEG_SQRT_H.len())
        {
            let mark = if cell.reached { "*" } else { " " };
            let _ = write!(text, "{:>8.2}{mark}", cell.position_km);
        }
        text.push('\n');
    }
    let _ = writeln!(
        text,
        "\n{:<28}{:>10}{:>16}{:>24}",
        "random walk alone", "flown, km", "linear, km", "room for bias, deg/h"
    );
    for walk in &summary.walks {
        let room = walk
            .largest_bias_deg_h
            .map_or("none".to_owned(), |bias| format!("{bias:.4}"));
        let _ = writeln!(
            text,
            "{:<28}{:>10.2}{:>16.2}{room:>24}",
            format!("{} deg/sqrt(h)", walk.random_walk_deg_sqrt_h),
            walk.position_km,
            walk.linear_model_km
        );
    }
}

fn oscillations(text: &mut String, summary: &Summary) {
    let (model, schuler) = (&summary.linear_model, &summary.schuler);
    let _ = writeln!(
        text,
        "\nVelocity error against the linear model, RMS difference over RMS error, percent\n\
         {:<44}{:>12}{:>22}",
        "", "(1)-(2)", "with frame rotation"
    );
    let straight = format!("straight flight of {} min, biases only", schuler.minutes);
    for (name, printed, rotating) in [
        (
            "free parts, estimates applied",
            model.with_estimates,
            model.with_estimates_rotating,
        ),
        (
            "free parts, readings as they are",
            model.raw,
            model.raw_rotating,
        ),
        (
            straight.as_str(),
            schuler.model_difference,
            schuler.rotating_model_difference,
        ),
    ] {
        let _ = writeln!(
            text,
            "{name:<44}{:>12.2}{:>22.3}",
            100.0 * printed,
            100.0 * rotating
        );
    }
    let _ = writeln!(
        text,
        "\nSchuler oscillation of the straight flight ({:.2} min by 2 pi sqrt(R/g))\n\
         {:<44}{:>12}{:>14}{:>14}",
        schuler.period_min, "", "period, min", "east, m/s", "north, m/s"
    );
    let rows: [(&str, &Oscillation); 3] = [
        ("INS", &schuler.ins),
        ("(1)-(2)", &schuler.model),
        ("with frame rotation", &schuler.rotating_model),
    ];
    for (name, found) in rows {
        let _ = writeln!(
            text,
            "{name:<44}{:>12.2}{:>14.3}{:>14.3}",
            found.period_min, found.east_mps, found.north_mps
        );
    }
}
