//! The simulated aircraft, and flights and drives on ideal sensors.

use std::path::Path;

use miette::{Result, miette};

use crate::aircraft::cessna172;
use crate::aircraft::dynamics::Dynamics;
use crate::aircraft::flight::Flight;
use crate::aircraft::plan::Plan;
use crate::page::brief;
use crate::page::table::{Table, heads};
use crate::sim::car::Car;
use crate::sim::{DriveConfig, Grade};
use crate::study::error_free::{Worst, strapdown};
use crate::study::reproduce::performance::{PerformanceRow, performance};

const HOUR_S: u32 = 3600;

/// Specification, the thesis's model, ours.
pub(super) fn performance_table() -> Result<String> {
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
    Ok(Table::of("", header, performance()?.map(row)).markdown())
}

/// An hour of driving and of flying on ideal sensors, at several sample rates.
pub(super) fn error_free(root: &Path) -> Result<String> {
    let mut rows = vec![row("car", 100, &drive())];
    for rate_hz in [50, 100, 200, 400] {
        rows.push(row("aircraft", rate_hz, &flight(root, rate_hz)?));
    }
    let header =
        heads("1 h of | samples, Hz | position, m | velocity, mm/s | attitude, arc seconds");
    Ok(Table::of("", header, rows).markdown())
}

fn drive() -> Worst {
    let config = DriveConfig::new(1, Grade::Ideal, f64::from(HOUR_S) / 60.0);
    let recording = config.recording;
    let car = Car::new(recording.seed, recording.duration_s, config.initial_rest_s);
    strapdown(car, recording.origin, 100, HOUR_S)
}

fn flight(root: &Path, rate_hz: u32) -> Result<Worst> {
    let dynamics = Dynamics::new(&cessna172());
    let file = root.join("host-sim/plans/route_one_hour.toml");
    let plan = Plan::read(&file, &dynamics)?;
    let in_plan = |error| miette!("{}: {error}", file.display());
    let flight = Flight::new(&dynamics, &plan, 1).map_err(in_plan)?;
    Ok(strapdown(flight, plan.start.position, rate_hz, HOUR_S))
}

fn row(vehicle: &str, rate_hz: u32, worst: &Worst) -> Vec<String> {
    let arc_seconds = 3600.0 * worst.attitude_rad.to_degrees();
    vec![
        vehicle.to_owned(),
        rate_hz.to_string(),
        brief(worst.position_m),
        brief(1e3 * worst.velocity_mps),
        brief(arc_seconds),
    ]
}
