//! Table 2, and the hour of flight without GNSS.

use miette::{IntoDiagnostic, Result, miette};
use rayon::prelude::*;

use super::part::{Number, Part, Settings, csv};
use crate::aircraft::cessna172;
use crate::aircraft::dynamics::Dynamics;
use crate::aircraft::performance::performance as of_aircraft;
use crate::page::plot::{BLUE, GREEN, Mark, RED, padded};
use crate::page::sheet::{self, Panel};
use crate::sim::ErrorModel;
use crate::statistics::rms;
use crate::study::flights::route::Route;
use crate::study::flights::run::{Settings as FlightSettings, run_alone};
use crate::study::flights::summary::THESIS_KM;

/// Durations with GNSS, and free after it, min.
const AIDED_MIN: u32 = 40;
const FREE_MIN: u32 = 60;
/// Random walk with which the thesis's figure is reached, deg/sqrt(h).
const SMALL_WALK_DEG_SQRT_H: f64 = 0.01;

/// A line of the thesis's Table 2.
#[derive(Debug)]
pub struct PerformanceRow {
    pub name: &'static str,
    pub specification: f64,
    /// The thesis's model.
    pub thesis: f64,
    pub ours: f64,
}

/// The thesis's Table 2.
pub fn performance() -> Result<[PerformanceRow; 3]> {
    let dynamics = Dynamics::new(&cessna172());
    let ours = of_aircraft(&dynamics).ok_or_else(|| miette!("the aircraft cannot fly level"))?;
    let published = (dynamics.parameters.specification.as_ref())
        .ok_or_else(|| miette!("the aircraft has no published performance"))?;
    let row = |(name, thesis), [specification, ours]: [f64; 2]| PerformanceRow {
        name,
        specification,
        thesis,
        ours,
    };
    let speed = [published.max_speed_kmh, ours.max_speed_kmh];
    let stall = [published.stall_speed_kmh, ours.stall_speed_kmh];
    let climb = [published.climb_rate_mps, ours.climb_rate_mps];
    Ok([
        row(("maximum level speed, km/h", 240.0), speed),
        row(("stall speed, flaps down, km/h", 85.0), stall),
        row(("rate of climb, m/s", 5.0), climb),
    ])
}

pub(super) fn table_2() -> Result<Part> {
    let rows = performance()?;
    let mut csv = "quantity,specification,thesis,ours\n".to_owned();
    csv.extend(rows.iter().map(|row| {
        let name = row.name.replace(',', "");
        format!(
            "{name},{},{},{:.3}\n",
            row.specification, row.thesis, row.ours
        )
    }));
    let specification: Vec<String> = rows
        .iter()
        .map(|row| row.specification.to_string())
        .collect();
    Ok(Part {
        name: "table-2",
        title: "Table 2: performance of the simulated Cessna 172".to_owned(),
        how: format!(
            "At sea level, standard atmosphere. The specification has {}.",
            specification.join(", ")
        ),
        numbers: rows
            .into_iter()
            .map(|row| Number::new(row.name, Some(row.thesis), row.ours))
            .collect(),
        svg: None,
        csv,
    })
}

/// Free flights on the estimates that were found with GNSS.
pub(super) fn hour(settings: &Settings, route: &Route, class: &ErrorModel) -> Result<Part> {
    let mut small_walk = class.clone();
    // deg/sqrt(h) is deg/h/sqrt(Hz) / 60.
    small_walk.gyro_deg_h.white_noise = 60.0 * SMALL_WALK_DEG_SQRT_H;
    let growths = [
        growth(settings, route, class)?,
        growth(settings, route, &small_walk)?,
    ];
    let end = |which: usize| growths[which].last().copied().unwrap_or(f64::NAN);
    let walk = class.gyro_deg_h.white_noise / 60.0;
    let number = |walk: f64, which: usize| {
        let what = format!("position after {FREE_MIN} min, walk {walk} deg/sqrt(h), km RMS");
        Number::new(what, Some(THESIS_KM), end(which))
    };
    Ok(Part {
        name: "hour-of-flight",
        title: "An hour of flight without GNSS".to_owned(),
        how: format!(
            "{} route flights, gyros of 1 deg/h: {AIDED_MIN} min damped by GNSS, then {FREE_MIN} \
             min free on the estimates, height held by a barometer. The random walk of the thesis's \
             gyros is not known here; with that typical of the class its figure is out of reach \
             however good the estimates.",
            settings.flights
        ),
        numbers: vec![number(walk, 0), number(SMALL_WALK_DEG_SQRT_H, 1)],
        svg: Some(picture(&growths, walk)),
        csv: csv(
            "minute,rms_km,rms_small_walk_km",
            (1..)
                .zip(growths[0].iter().zip(&growths[1]))
                .map(|(minute, (a, b))| vec![f64::from(minute), *a, *b]),
        )?,
    })
}

/// RMS position error at each minute of the free part, km.
fn growth(settings: &Settings, route: &Route, errors: &ErrorModel) -> Result<Vec<f64>> {
    let flight_settings = FlightSettings {
        minutes_aided: AIDED_MIN,
        minutes_free: FREE_MIN,
        errors: errors.clone(),
    };
    let flights = (settings.seeds(settings.flights).into_par_iter())
        .map(|seed| run_alone(seed, route, &flight_settings).map(|(_, errors)| errors))
        .collect::<Result<Vec<_>, _>>()
        .into_diagnostic()?;
    let at = |minute: usize| {
        rms(flights
            .iter()
            .map(|errors| 1e-3 * errors[minute].position_m))
    };
    Ok((0..FREE_MIN as usize).map(at).collect())
}

fn picture([class, small_walk]: &[Vec<f64>; 2], walk: f64) -> String {
    let line = |values: &[f64]| -> Vec<(f64, f64)> {
        let minutes = (1..).map(f64::from);
        minutes.zip(values.iter().copied()).collect()
    };
    let (class, small_walk) = (line(class), line(small_walk));
    let thesis = vec![(0.0, THESIS_KM), (f64::from(FREE_MIN), THESIS_KM)];
    let values = class.iter().chain(&small_walk).map(|point| point.1);
    let y = padded(values.chain([0.0]), 1e-2);
    let marks = vec![
        Mark::Reference(thesis, RED),
        Mark::Line(class, BLUE),
        Mark::Line(small_walk, GREEN),
    ];
    let plot = sheet::plot(
        ["time without GNSS, min", "km"],
        (0.0, f64::from(FREE_MIN)),
        y,
        marks,
    );
    sheet::svg(&[Panel {
        title: format!("RMS position error, walk {walk} and {SMALL_WALK_DEG_SQRT_H}"),
        svg: plot.svg(),
        keys: vec![
            (BLUE, "typical walk of the class"),
            (GREEN, "small walk"),
            (RED, "thesis, after an hour"),
        ],
    }])
}
