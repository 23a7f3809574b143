//! Figures 5, 8 and 9 and Table 1: velocity errors of a free INS.

use ins_core::increments::Increments;
use ins_core::{Solution, Time};
use miette::{IntoDiagnostic, Result};
use nalgebra::{Vector2, Vector3};
use plotters::style::RGBColor;
use rayon::prelude::*;

use super::drive::{Drive, Velocities};
use super::part::{GRADE, Number, Part, Settings, csv, here};
use crate::compare::five_stage::Stage;
use crate::identify::baro_aided_ins::BaroAidedIns;
use crate::identify::error_model::{Identified, Record};
use crate::identify::quantities::DEG_H_RADPS;
use crate::identify::row::Row;
use crate::log::Log;
use crate::page::plot::{BLUE, GREEN, GREY, Mark, ORANGE, RED, padded};
use crate::page::sheet::{self, Panel};
use crate::sim::car::Car;
use crate::sim::drive::Recording;
use crate::sim::{DriveConfig, ErrorModel, SimulatedDrive, record};
use crate::statistics::{median, rms};
use crate::study::accuracy::config_of;
use crate::study::flights::route::Route;
use crate::study::flights::schuler::oscillation;

/// Least change of velocity in Figure 5, m/s.
const MIN_GAIN_MPS: f64 = 3.0;
/// Start of the free INS on the running estimates, s.
const RUNNING_FROM_S: f64 = 1200.0;
/// Table 1 of the thesis: spans, east and north, m/s.
const VEHICLES: [(&str, [f64; 2]); 3] = [
    ("at rest", [13.0, 9.0]),
    ("car", [134.0, 70.0]),
    ("light aircraft", [72.0, 94.0]),
];

// --- Figure 5: an azimuth error turns a change of velocity into a cross-track velocity error ---

/// One start or braking: its end since the first sample, and the cross-track velocity error gained by a free
/// INS, m/s: with the heading as given, compensated, and true.
struct Gain {
    end_s: f64,
    across_mps: [f64; 3],
}

pub(super) fn figure_5(drives: &[Drive]) -> Result<Part> {
    let gains: Vec<Vec<Gain>> = drives.iter().map(gains).collect();
    let all = |which: usize| rms(gains.iter().flatten().map(|gain| gain.across_mps[which]));
    let [given, compensated, exact] = [0, 1, 2].map(all);
    let first = gains.first().map_or(&[][..], Vec::as_slice);
    let line = |name, colour, which: usize| {
        let points = first
            .iter()
            .map(|gain| (gain.end_s, gain.across_mps[which]));
        (name, colour, points.collect())
    };
    let lines = vec![
        line("heading as given", RED, 0),
        line("true attitude", GREY, 2),
        line("azimuth compensated", GREEN, 1),
    ];
    Ok(Part {
        name: "figure-5",
        title: "Figure 5: cross-channel velocity error, azimuth compensated".to_owned(),
        how: format!(
            "{} starts and brakings of {} drives. At the beginning of each the INS is let go; \
             the error of the velocity that it has gained by the end, across the true gain. \
             Azimuth as found by the five stages. With the true attitude the rest stays: it is not \
             the azimuth's.",
            gains.iter().map(Vec::len).sum::<usize>(),
            drives.len()
        ),
        numbers: vec![
            here("heading as given, m/s RMS", given),
            here("azimuth compensated, m/s RMS", compensated),
            here("true attitude, m/s RMS", exact),
            here("improvement factor of compensation", given / compensated),
        ],
        svg: Some(sheet::svg(&[panel("Velocity error across", lines)])),
        csv: csv(
            "time_s,given_mps,compensated_mps,true_attitude_mps",
            first.iter().map(|gain| {
                let [given, compensated, exact] = gain.across_mps;
                vec![gain.end_s, given, compensated, exact]
            }),
        )?,
    })
}

fn gains(drive: &Drive) -> Vec<Gain> {
    let row = |history: &[Row], time| {
        let at = history.binary_search_by_key(&time, |row| row.time).ok()?;
        history[at].solution
    };
    let gain = |&(from, to): &_| {
        let (before, after) = (drive.truth(from)?, drive.truth(to)?);
        let gained = (after.velocity_enu_mps - before.velocity_enu_mps).xy();
        if gained.norm() < MIN_GAIN_MPS {
            return None;
        }
        let along = gained.normalize();
        let across = |start: &Solution, compensated: bool| {
            let known = |time| {
                if compensated {
                    drive.found(time)
                } else {
                    [Vector3::zeros(); 2]
                }
            };
            let begin = (start.velocity_enu_mps - before.velocity_enu_mps).xy();
            let errors = drive.free(&drive.log, start, known, to);
            errors.last().map(|(_, end)| along.perp(&(end - begin)))
        };
        Some(Gain {
            end_s: drive.since(to),
            across_mps: [
                across(&row(&drive.open, from)?, false)?,
                across(&row(&drive.stages.history, from)?, true)?,
                across(before, true)?,
            ],
        })
    };
    let intervals = Stage::Azimuth.intervals(&drive.open);
    intervals.iter().filter_map(gain).collect()
}

// --- Figure 8: before and after compensation of the gyros ---

struct Compensated {
    /// Raw gyros, and compensated by the bias history, over the whole drive.
    as_read: Velocities,
    history: Velocities,
    /// Compensated by a constant.
    constant: Velocities,
    /// From [`RUNNING_FROM_S`] on: raw, compensated by the running estimates, and the same without angular
    /// random walk.
    late_as_read: Velocities,
    running: Velocities,
    running_without_arw: Velocities,
}

pub(super) fn figure_8(drives: &[Drive]) -> Result<Part> {
    let all: Vec<Compensated> = drives.par_iter().filter_map(compensated).collect();
    let rms_of = |errors: fn(&Compensated) -> &Velocities| rms_velocity(all.iter().map(errors));
    let as_read = rms_of(|v| &v.as_read);
    let history = rms_of(|v| &v.history);
    let late = rms_of(|v| &v.late_as_read);
    let constant = as_read / rms_of(|v| &v.constant);
    let running = late / rms_of(|v| &v.running);
    let without_arw = late / rms_of(|v| &v.running_without_arw);
    let minutes = drives.first().map_or(0.0, |d| d.log.duration_s() / 60.0);
    let first = all
        .first()
        .map(|one| [&one.as_read, &one.history].map(thinned));
    Ok(Part {
        name: "figure-8",
        title: "Figure 8: free-inertial velocity error before and after".to_owned(),
        how: format!(
            "{} drives of {minutes:.0} min. The INS is let go when its alignment ends and runs free \
             to the end, height held by a barometer, accelerometers compensated in all cases: \
             horizontal velocity against the truth, RMS over all that time. A gyro history is that \
             of the run after the five stages, (9) over intervals of 10 s: it holds the walk of the \
             angle as GNSS saw it. A constant (the last running estimate) cannot, nor can the \
             running estimates with which an INS is let go at 20 min: at 0.125 deg/sqrt(h) the walk \
             is most of what they leave. The thesis says an order of magnitude: 10.",
            all.len()
        ),
        numbers: vec![
            here("uncorrected gyros, m/s RMS", as_read),
            here("gyro histories taken out, m/s RMS", history),
            Number::new("improvement factor", Some(10.0), as_read / history),
            here("improvement factor, one constant per gyro", constant),
            here(
                "improvement factor, running estimates from 20 min on",
                running,
            ),
            here(
                "improvement factor, the same on gyros without random walk",
                without_arw,
            ),
        ],
        svg: first.as_ref().map(|[before, after]| {
            let lines = [
                ("uncorrected gyros", RED, before),
                ("gyro histories taken out", GREEN, after),
            ];
            east_and_north(["Velocity error east", "Velocity error north"], &lines)
        }),
        csv: first.map_or(Ok(String::new()), |[before, after]| {
            let header = "time_s,east_as_read_mps,north_as_read_mps,east_after_mps,north_after_mps";
            csv_of(header, [&before, &after])
        })?,
    })
}

fn compensated(drive: &Drive) -> Option<Compensated> {
    let accels = drive.accels();
    let end = drive.log.imu.last()?.time;
    let constant = running(&drive.found.history, end);
    let start = drive.stages.history.iter().find_map(|row| row.solution)?;
    let mut rows = drive.found.history.iter();
    let late = rows.find(|row| drive.since(row.time) >= RUNNING_FROM_S);
    let late = late?.solution?;
    let free = |log: &Log, start: &Solution, gyros: &dyn Fn(Time) -> Vector3<f64>| {
        drive.free(log, start, |time| [gyros(time), accels], end)
    };
    let as_read = |_| Vector3::zeros();
    let running = |time| running(&drive.found.history, time);
    Some(Compensated {
        as_read: free(&drive.log, &start, &as_read),
        history: free(&drive.log, &start, &|time| drive.stages.gyros.at(time)),
        constant: free(&drive.log, &start, &|_| constant),
        late_as_read: free(&drive.log, &late, &as_read),
        running: free(&drive.log, &late, &running),
        running_without_arw: free(&drive.without_arw, &late, &running),
    })
}

/// The running estimates at a time.
fn running(history: &[Row], time: Time) -> Vector3<f64> {
    let after = history.partition_point(|row| row.time <= time);
    let row = history[..after].last();
    row.map_or(Vector3::zeros(), |row| {
        Vector3::from(row.estimates.gyro_bias_radps.map(|bias| bias.value))
    })
}

// --- Figure 9: a simulated flight with the error model identified from drives ---

pub(super) fn figure_9(settings: &Settings, drives: &[Drive], route: &Route) -> Result<Part> {
    let records: Vec<Record> = (drives.iter())
        .map(|drive| Record::new(&drive.log, &drive.found))
        .collect();
    let model = Identified::new(&records, GRADE, None).model();
    let run = flown(settings.seed, settings.flight_minutes, route, &model)?;
    let errors = free(&run);
    // Horizontal velocities of GNSS and of the INS, and the error of the latter.
    let [mut gnss, mut ins, mut ins_errors] = [const { Velocities::new() }; 3];
    for &(time_s, error) in &errors {
        let fix = run
            .gnss
            .partition_point(|fix| fix.time.as_seconds() < time_s);
        let truth = run.truth.partition_point(|t| t.time.as_seconds() < time_s);
        let velocity = run.gnss.get(fix).and_then(|fix| fix.velocity_en_mps);
        if let Some((velocity, truth)) = velocity.zip(run.truth.get(truth)) {
            gnss.push((time_s, velocity));
            ins.push((time_s, truth.velocity_enu_mps.xy() + error));
            ins_errors.push((time_s, error));
        }
    }
    let found = oscillation(&errors);
    let [right, forward, _] = run.errors.gyro_bias_radps.map(|bias| bias / DEG_H_RADPS);
    let error = |axis: usize| rms(errors.iter().map(|(_, error)| error[axis]));
    let lines = [
        ("INS, free", ORANGE, &thinned(&ins)),
        ("GNSS", BLUE, &thinned(&gnss)),
        ("error of the INS", RED, &thinned(&ins_errors)),
    ];
    Ok(Part {
        name: "figure-9",
        title: "Figure 9: a simulated flight, GNSS and a free INS with the errors of the drives"
            .to_owned(),
        how: format!(
            "{} drives give the error model of the sensors; errors drawn from it are laid over the \
             ideal readings of a route flight of {:.0} min: level gyros of {right:.1} and \
             {forward:.1} deg/h at its end. The INS is let go without error at the \
             start, height held by a barometer. Its error oscillates as (1) says: \
             2 pi sqrt(R/g) is 84.4 min. The random walk of the gyros drives the oscillation, so \
             that it is not one sine.",
            drives.len(),
            settings.flight_minutes
        ),
        numbers: vec![
            here("INS velocity error, east, m/s RMS", error(0)),
            here("INS velocity error, north, m/s RMS", error(1)),
            here("period of the sine that fits it, min", found.period_min),
        ],
        svg: Some(east_and_north(["Velocity east", "Velocity north"], &lines)),
        csv: csv_of(
            "time_s,gnss_east_mps,gnss_north_mps,ins_east_mps,ins_north_mps,ins_error_east_mps,\
             ins_error_north_mps",
            [&gnss, &ins, &ins_errors],
        )?,
    })
}

// --- Table 1: span of the error at rest, in a car and in an aircraft ---

pub(super) fn table_1(settings: &Settings, route: &Route) -> Result<Part> {
    let units = (settings.seeds(settings.units).into_par_iter())
        .map(|seed| {
            let runs = vehicles(seed, settings.unit_minutes, route, &GRADE.errors())?;
            Ok(runs.each_ref().map(free))
        })
        .collect::<Result<Vec<[Velocities; 3]>>>()?;
    let mut numbers = Vec::new();
    for (which, (vehicle, thesis)) in VEHICLES.into_iter().enumerate() {
        for (axis, direction) in ["east", "north"].into_iter().enumerate() {
            let spans = units.iter().map(|unit| span(&unit[which], axis));
            let what = format!("span {vehicle}, {direction}, m/s");
            numbers.push(Number::new(what, Some(thesis[axis]), median(spans)));
        }
    }
    let panel = |(errors, (vehicle, _)): (&Velocities, (&str, _))| {
        let errors = thinned(errors);
        let lines = vec![
            ("east", BLUE, of_axis(&errors, 0)),
            ("north", ORANGE, of_axis(&errors, 1)),
        ];
        panel(&format!("Free velocity error, {vehicle}"), lines)
    };
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
        svg: first.map(|unit| {
            let panels: Vec<Panel> = unit.iter().zip(VEHICLES).map(panel).collect();
            sheet::svg(&panels)
        }),
        csv: first.map_or(Ok(String::new()), |unit| {
            csv_of(
                "time_s,rest_east_mps,rest_north_mps,car_east_mps,car_north_mps,\
                 aircraft_east_mps,aircraft_north_mps",
                unit.each_ref(),
            )
        })?,
    })
}

fn span(errors: &Velocities, axis: usize) -> f64 {
    let values = errors.iter().map(|(_, error)| error[axis]);
    let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
    high - low
}

// --- runs ---

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

/// Errors of a free INS without initial errors, vertical channel damped; needs the truth at every sample.
pub(super) fn free(run: &SimulatedDrive) -> Velocities {
    let config = config_of(GRADE);
    let Some((first, start)) = run.imu.first().zip(run.truth.first()) else {
        return Velocities::new();
    };
    let mut ins = BaroAidedIns::new(start);
    let mut increments = Increments::new(config.imu_output, first);
    let mut errors = Velocities::new();
    // The truth begins one interval before the samples.
    let pairs = run.truth.iter().zip(&run.truth[1..]);
    for (count, (sample, (before, now))) in (1_u32..).zip(run.imu.iter().zip(pairs)) {
        let interval = increments.interval(sample, now.time.seconds_since(before.time));
        ins.step(&interval, before.position.height_m, &config.damping);
        if count.is_multiple_of(100) {
            errors.push((now.time.as_seconds(), ins.velocity_error_mps(now)));
        }
    }
    errors
}

/// RMS horizontal velocity error over all runs, m/s.
pub(super) fn rms_velocity<'a>(runs: impl Iterator<Item = &'a Velocities>) -> f64 {
    rms(runs.flatten().map(|(_, error)| error.norm()))
}

// --- drawings and data ---

/// A named line, m/s over s.
type Line = (&'static str, RGBColor, Vec<(f64, f64)>);

/// Every tenth point, for drawings.
fn thinned(velocities: &Velocities) -> Velocities {
    velocities.iter().step_by(10).copied().collect()
}

fn of_axis(velocities: &Velocities, axis: usize) -> Vec<(f64, f64)> {
    velocities.iter().map(|(t, v)| (*t, v[axis])).collect()
}

fn east_and_north(
    titles: [&str; 2],
    velocities: &[(&'static str, RGBColor, &Velocities)],
) -> String {
    let axis = |axis: usize| {
        let lines = velocities.iter();
        let lines = lines.map(|(name, colour, of)| (*name, *colour, of_axis(of, axis)));
        panel(titles[axis], lines.collect())
    };
    sheet::svg(&[axis(0), axis(1)])
}

/// Lines over time, the first in the background.
fn panel(title: &str, lines: Vec<Line>) -> Panel {
    let points = || lines.iter().flat_map(|(.., points)| points);
    let end_s = points().fold(1.0, |end, point| f64::max(end, point.0));
    let y = padded(points().map(|point| point.1), 1e-2);
    let keys = (lines.iter())
        .map(|(name, colour, _)| (*colour, *name))
        .collect();
    let marks = (lines.into_iter()).map(|(_, colour, points)| Mark::Line(points, colour));
    Panel {
        title: title.to_owned(),
        svg: sheet::plot(["time, s", "m/s"], (0.0, end_s), y, marks.collect()).svg(),
        keys,
    }
}

/// Times of the first series, and both components of each.
fn csv_of<const N: usize>(header: &str, velocities: [&Velocities; N]) -> Result<String> {
    let count = velocities.map(Vec::len).into_iter().min().unwrap_or(0);
    let row = |index: usize| {
        let vectors = velocities.iter().map(|of| of[index].1);
        let components = vectors.flat_map(|v: Vector2<f64>| [v.x, v.y]);
        [velocities[0][index].0]
            .into_iter()
            .chain(components)
            .collect()
    };
    csv(header, (0..count).map(row))
}
