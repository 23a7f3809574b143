//! The simulated aircraft, and flights and drives on ideal sensors.

use std::path::Path;

use host_sim::aircraft::cessna172;
use host_sim::aircraft::dynamics::Dynamics;
use host_sim::aircraft::flight::Flight;
use host_sim::aircraft::plan::Plan;
use host_sim::page::brief;
use host_sim::page::table::{heads, markdown};
use host_sim::sim::car::Car;
use host_sim::sim::ideal::strapdown_errors;
use host_sim::sim::{DriveConfig, ErrorModel};
use host_sim::study::flights::{self, Settings};
use host_sim::study::reproduce::{PerformanceRow, performance};
use indicatif::ProgressBar;
use miette::{Result, miette};

const HOUR_S: u32 = 3600;

/// Specification, the thesis's model, ours.
pub fn performance_table() -> Result<String> {
    let row = |row: PerformanceRow| {
        let mut cells = vec![row.name.to_owned()];
        cells.extend([row.specification, row.thesis, row.ours].map(|value| format!("{value:.1}")));
        cells.push(format!(
            "{:+.1} %",
            100.0 * (row.ours / row.specification - 1.0)
        ));
        cells
    };
    let header = heads("| specification | thesis's model | this model | off by");
    Ok(markdown(&header, &performance()?.map(row)))
}

/// Statistics of flights, aided and then unaided.
pub fn flights(runs: u64) -> Result<String> {
    let settings = Settings {
        minutes_aided: 40,
        minutes_free: 60,
        errors: ErrorModel::hg1700(),
    };
    let (_, summary) = flights::measure(0..runs, &settings, &ProgressBar::new(runs))?;
    Ok(flights::markdown(&summary))
}

/// An hour of driving and of flying on ideal sensors, at several sample rates.
pub fn error_free(root: &Path) -> Result<String> {
    let mut rows = vec![row("car", 100, drive())];
    for rate_hz in [50, 100, 200, 400] {
        rows.push(row("aircraft", rate_hz, flight(root, rate_hz)?));
    }
    let header =
        heads("1 h of | samples, Hz | position, m | velocity, mm/s | attitude, arc seconds");
    Ok(markdown(&header, &rows))
}

fn drive() -> [f64; 3] {
    let config = DriveConfig::ideal(1, f64::from(HOUR_S) / 60.0);
    let recording = config.recording;
    let car = Car::new(recording.seed, recording.duration_s, config.initial_rest_s);
    strapdown_errors(car, recording.origin, 100, HOUR_S)
}

fn flight(root: &Path, rate_hz: u32) -> Result<[f64; 3]> {
    let dynamics = Dynamics::new(&cessna172());
    let file = root.join("host-sim/plans/route_one_hour.toml");
    let plan = Plan::read(&file, &dynamics)?;
    let in_plan = |error| miette!("{}: {error}", file.display());
    let flight = Flight::new(&dynamics, &plan, 1).map_err(in_plan)?;
    Ok(strapdown_errors(
        flight,
        plan.start.position,
        rate_hz,
        HOUR_S,
    ))
}

fn row(vehicle: &str, rate_hz: u32, worst: [f64; 3]) -> Vec<String> {
    let [position_m, velocity_mps, attitude_rad] = worst;
    let arc_seconds = 3600.0 * attitude_rad.to_degrees();
    vec![
        vehicle.to_owned(),
        rate_hz.to_string(),
        brief(position_m),
        brief(1e3 * velocity_mps),
        brief(arc_seconds),
    ]
}
