//! Table 1: how far the velocity error of a free INS swings at rest, in a car and in an aircraft.

use ins_core::Solution;
use ins_core::increments::{Increments, Interval};
use miette::{IntoDiagnostic, Result};
use nalgebra::Vector2;
use rayon::prelude::*;

use super::part::{GRADE, Number, Part, Settings, csv};
use super::velocity_plot::{Line, panel};
use crate::identify::held_ins::HeldIns;
use crate::page::plot::{BLUE, ORANGE};
use crate::page::sheet;
use crate::sim::car::Car;
use crate::sim::drive::Recording;
use crate::sim::{DriveConfig, ErrorModel, SimulatedDrive, record};
use crate::statistics::median;
use crate::study::accuracy::config_of;
use crate::study::flights::route::Route;

/// The thesis's spans, east and north, m/s.
const VEHICLES: [(&str, [f64; 2]); 3] = [
    ("at rest", [13.0, 9.0]),
    ("car", [134.0, 70.0]),
    ("light aircraft", [72.0, 94.0]),
];

/// Velocity errors, east and north, once a second.
pub(super) type Errors = Vec<(f64, Vector2<f64>)>;

pub(super) fn table_1(settings: &Settings, route: &Route) -> Result<Part> {
    let units = (settings.seeds(settings.units).into_par_iter())
        .map(|seed| {
            let runs = vehicles(seed, settings.unit_minutes, route, &GRADE.errors())?;
            Ok(runs.each_ref().map(free))
        })
        .collect::<Result<Vec<[Errors; 3]>>>()?;
    let mut numbers = Vec::new();
    for (which, (vehicle, thesis)) in VEHICLES.into_iter().enumerate() {
        for (axis, direction) in ["east", "north"].into_iter().enumerate() {
            let spans = units.iter().map(|unit| span(&unit[which], axis));
            let what = format!("span {vehicle}, {direction}, m/s");
            numbers.push(Number::new(what, Some(thesis[axis]), median(spans)));
        }
    }
    let first = units.first();
    Ok(Part {
        name: "table-1",
        title: "Table 1: span of the velocity error of a free INS".to_owned(),
        how: format!(
            "Largest less smallest error over {:.0} min from an error-free start, readings as they \
             are, height held by a barometer: median of {} units. The thesis has one unit and one \
             interval of each, of a length not known here: an illustration, not a target.",
            settings.unit_minutes,
            units.len()
        ),
        numbers,
        svg: first.map(picture),
        csv: first.map_or(String::new(), data),
    })
}

fn span(errors: &Errors, axis: usize) -> f64 {
    let values = errors.iter().map(|(_, error)| error[axis]);
    let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
    high - low
}

/// The same unit at rest, in a car and in an aircraft.
pub(super) fn vehicles(
    seed: u64,
    minutes: f64,
    route: &Route,
    errors: &ErrorModel,
) -> Result<[SimulatedDrive; 3]> {
    let recording = recording(seed, minutes, errors);
    let after = recording.duration_s + 1.0;
    let [rest, car] = [Some([after, after + 1.0]), None]
        .map(|rest_s| record(Car::new(seed, recording.duration_s, rest_s), &recording));
    Ok([rest, car, flown(seed, minutes, route, errors)?])
}

/// A route flight.
pub(super) fn flown(
    seed: u64,
    minutes: f64,
    route: &Route,
    errors: &ErrorModel,
) -> Result<SimulatedDrive> {
    let recording = Recording {
        origin: route.plan().start.position,
        ..recording(seed, minutes, errors)
    };
    let flight = (route.flight(seed, recording.duration_s)).into_diagnostic()?;
    // Flown once without sensors: what cannot be flown must not end as a figure.
    flight.duration_s().into_diagnostic()?;
    Ok(record(flight, &recording))
}

/// With the truth at every sample.
fn recording(seed: u64, minutes: f64, errors: &ErrorModel) -> Recording {
    Recording {
        truth_every: 1,
        errors: errors.clone(),
        ..DriveConfig::new(seed, GRADE, minutes).recording
    }
}

/// Of an INS let go without error at the start, height held; the truth is that of every sample.
pub(super) fn free(run: &SimulatedDrive) -> Errors {
    let config = config_of(GRADE);
    let Some((first, start)) = run.imu.first().zip(run.truth.first()) else {
        return Errors::new();
    };
    let mut ins = HeldIns::new(start);
    let mut increments = Increments::new(config.imu_output, first);
    let mut errors = Errors::new();
    // The truth begins one interval before the samples.
    for (count, (sample, pair)) in (1_u32..).zip(run.imu.iter().zip(run.truth.windows(2))) {
        let [before, now]: &[Solution; 2] = pair.try_into().expect("windows of two");
        let interval: Interval = increments.interval(sample, now.time.seconds_since(before.time));
        ins.step(&interval, before.position.height_m, &config.damping);
        if count.is_multiple_of(100) {
            errors.push((now.time.as_seconds(), ins.velocity_error_mps(now)));
        }
    }
    errors
}

fn picture(unit: &[Errors; 3]) -> String {
    let panels = unit.iter().zip(VEHICLES).map(|(errors, (vehicle, _))| {
        let line = |name, colour, axis: usize| {
            let thinned = errors.iter().step_by(10);
            Line {
                name,
                colour,
                points: thinned.map(|(t, error)| (*t, error[axis])).collect(),
            }
        };
        let lines = vec![line("east", BLUE, 0), line("north", ORANGE, 1)];
        panel(format!("Free velocity error, {vehicle}"), lines)
    });
    sheet::svg(&panels.collect::<Vec<_>>())
}

fn data(unit: &[Errors; 3]) -> String {
    let [rest, car, aircraft] = unit;
    let rows = rest
        .iter()
        .zip(car)
        .zip(aircraft)
        .map(|((rest, car), aircraft)| {
            let mut row = vec![rest.0];
            row.extend([rest.1, car.1, aircraft.1].iter().flat_map(|v| [v.x, v.y]));
            row
        });
    csv(
        "time_s,rest_east_mps,rest_north_mps,car_east_mps,car_north_mps,aircraft_east_mps,\
         aircraft_north_mps",
        rows,
    )
}
