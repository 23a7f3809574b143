//! What the plots of the report show.

use ins_core::{Manoeuvre, Phase, Time};
use plotters::style::RGBColor;
use serde::Serialize;

use super::plot::{BLUE, GREEN, GREY, Mark, ORANGE, Plot, RED, padded};
use crate::against_truth::Point;
use crate::five_stage::Stage;
use crate::held_ins::Error;
use crate::identify::{Identification, Row};
use crate::log::Log;
use crate::quantities::{DEG_H_RADPS, Quantities, Quantity};
use crate::truth::Truth;

pub(super) const SMALL: (u32, u32) = (460, 210);
const WIDE: (u32, u32) = (940, 230);
/// Errors below are drawn here, m and m/s.
const LEAST_ERROR: f64 = 1e-3;

/// The stage that shows each estimate in manoeuvres of its own; the others show all the time.
const STAGES: [Option<Stage>; 8] = [
    Some(Stage::Azimuth),
    Some(Stage::LevelAccels),
    Some(Stage::LevelAccels),
    None,
    None,
    None,
    None,
    Some(Stage::Latency),
];

/// A plot with its heading and the meaning of its colours.
#[derive(Serialize)]
pub(crate) struct Panel {
    pub(crate) title: String,
    pub(crate) svg: String,
    pub(crate) keys: Vec<Key>,
}

/// What a colour means.
#[derive(Serialize)]
pub(crate) struct Key {
    pub(crate) colour: String,
    pub(crate) text: String,
}

pub(crate) fn key(colour: RGBColor, text: &str) -> Key {
    Key {
        colour: format!("#{:02x}{:02x}{:02x}", colour.0, colour.1, colour.2),
        text: text.to_owned(),
    }
}

/// Each estimate as it converges, in a band of one sigma.
pub(super) fn estimates(
    log: &Log,
    found: &Identification,
    truth: Option<&Truth>,
    size: (u32, u32),
) -> Vec<Panel> {
    let axes = log.meta.body_axes;
    // A point for each pixel, and the last one.
    let count = navigating(found).count();
    let every = (count / size.0 as usize).max(1);
    let rows: Vec<(f64, [(&str, Quantity); 8])> = navigating(found)
        .skip((count + every - 1) % every)
        .step_by(every)
        .map(|row| {
            (
                since(found, row.time),
                Quantities::new(&row.estimates, axes).columns(),
            )
        })
        .collect();
    let titles = [
        "Azimuth error",
        "Accelerometer x",
        "Accelerometer y",
        "Accelerometer z",
        "Gyro x",
        "Gyro y",
        "Gyro z",
        "GNSS latency",
    ];
    let units = ["deg", "mg", "mg", "mg", "deg/h", "deg/h", "deg/h", "ms"];
    let truths = truth.map(Truth::columns).unwrap_or_default();
    (0..titles.len())
        .map(|index| {
            let series: Vec<(f64, Quantity)> = rows
                .iter()
                .map(|(time, columns)| (*time, columns[index].1))
                .collect();
            let shown = STAGES[index].map_or_else(Vec::new, |stage| observable(found, stage));
            let mut title = titles[index].to_owned();
            if (1..=6).contains(&index) {
                title = format!("{title} ({})", axes.direction((index - 1) % 3));
            }
            let plot = Plot {
                size,
                x_label: "time, s".to_owned(),
                y_label: units[index].to_owned(),
                x: duration(found),
                y: settled_range(&series, truths[index]),
                marks: Vec::new(),
            };
            estimate(title, plot, &series, truths[index], shown)
        })
        .collect()
}

/// When the quantity of a stage was observable, s since the first sample.
fn observable(found: &Identification, stage: Stage) -> Vec<(f64, f64)> {
    let seconds = |(from, to)| (since(found, from), since(found, to));
    let intervals = stage.intervals(&found.history);
    intervals.into_iter().map(seconds).collect()
}

fn estimate(
    title: String,
    axes: Plot,
    series: &[(f64, Quantity)],
    truth: Option<f64>,
    shown: Vec<(f64, f64)>,
) -> Panel {
    let x = axes.x;
    let band = series
        .iter()
        .map(|(t, q)| (*t, q.value - q.sigma, q.value + q.sigma))
        .collect();
    let line = series.iter().map(|(t, q)| (*t, q.value)).collect();
    let mut marks = vec![
        Mark::Shade(shown, GREY),
        Mark::Band(band, BLUE),
        Mark::Line(line, BLUE),
    ];
    let mut keys = vec![
        key(BLUE, "estimate, band: one sigma"),
        key(GREY, "grey: manoeuvres that show it"),
    ];
    if let Some(truth) = truth {
        marks.insert(2, Mark::Reference(vec![(x.0, truth), (x.1, truth)], RED));
        keys.push(key(RED, "truth"));
    }
    Panel {
        svg: Plot { marks, ..axes }.svg(),
        title,
        keys,
    }
}

/// Axis for where the estimate settles, several sigmas wide; the first guesses may run out of it.
fn settled_range(series: &[(f64, Quantity)], truth: Option<f64>) -> (f64, f64) {
    let settled = &series[series.len() / 4..];
    let mut edges: Vec<f64> = settled
        .iter()
        .flat_map(|(_, q)| [q.value - q.sigma, q.value + q.sigma])
        .collect();
    edges.sort_by(f64::total_cmp);
    let part = edges.len() / 20;
    let middle = edges.get(part..edges.len() - part).unwrap_or_default();
    let end = series
        .last()
        .map(|(_, q)| [q.value - 6.0 * q.sigma, q.value + 6.0 * q.sigma]);
    padded(
        middle
            .iter()
            .copied()
            .chain(end.into_iter().flatten())
            .chain(truth),
        1e-3,
    )
}

/// Points, their colour and its meaning.
type Series = (Vec<(f64, f64)>, RGBColor, &'static str);

/// The corrections f^C and omega^C.
pub(super) fn damping(found: &Identification) -> Vec<Panel> {
    let series = |f: &dyn Fn(&Row) -> f64| -> Vec<(f64, f64)> {
        navigating(found)
            .map(|row| (since(found, row.time), f(row)))
            .collect()
    };
    let force = [
        (series(&|row| row.signals.accel_enu_mps2.x), BLUE, "east"),
        (series(&|row| row.signals.accel_enu_mps2.y), ORANGE, "north"),
    ];
    let rate = |axis: usize| series(&|row| row.signals.rate_enu_radps[axis] / DEG_H_RADPS);
    let rates = [
        (rate(0), BLUE, "east"),
        (rate(1), ORANGE, "north"),
        (rate(2), GREEN, "up"),
    ];
    let difference = [
        (
            series(&|row| row.signals.difference_enu_mps.x),
            BLUE,
            "east",
        ),
        (
            series(&|row| row.signals.difference_enu_mps.y),
            ORANGE,
            "north",
        ),
    ];
    vec![
        signal("Into the velocity block, f^C", "m/s\u{b2}", found, &force),
        signal("Into the attitude block, \u{3c9}^C", "deg/h", found, &rates),
        signal("Velocity, INS minus GNSS", "m/s", found, &difference),
    ]
}

fn signal<const N: usize>(
    title: &str,
    unit: &str,
    found: &Identification,
    series: &[Series; N],
) -> Panel {
    let keys = series
        .iter()
        .map(|(_, colour, text)| key(*colour, text))
        .collect();
    let mut values: Vec<f64> = series
        .iter()
        .flat_map(|s| s.0.iter().map(|p| p.1))
        .collect();
    values.sort_by(f64::total_cmp);
    // The transient of the start would flatten all the rest.
    let part = values.len() / 100;
    let y = padded(values[part..values.len() - part].iter().copied(), 1e-3);
    let pale = series
        .iter()
        .map(|(points, colour, _)| Mark::Pale(points.clone(), *colour));
    let means = series
        .iter()
        .map(|(points, colour, _)| Mark::Line(means(points), *colour));
    let marks = pale.chain(means).collect();
    Panel {
        title: title.to_owned(),
        svg: small(duration(found), y, unit, marks),
        keys,
    }
}

/// Means over a hundredth of the points each: what lasts among the noise.
fn means(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mean = |chunk: &[(f64, f64)]| {
        let count = chunk.len() as f64;
        let sum = chunk
            .iter()
            .fold((0.0, 0.0), |sum, p| (sum.0 + p.0, sum.1 + p.1));
        (sum.0 / count, sum.1 / count)
    };
    points
        .chunks((points.len() / 100).max(1))
        .map(mean)
        .collect()
}

/// Growth of the free-inertial velocity error within a window.
pub(super) fn velocity_error(found: &Identification) -> Option<Panel> {
    let error = found.velocity_error.as_ref()?;
    let before: Vec<_> = error
        .growth
        .iter()
        .map(|g| (g.since_s, g.before_mps))
        .collect();
    let after: Vec<_> = error
        .growth
        .iter()
        .map(|g| (g.since_s, g.after_mps))
        .collect();
    let y = padded(before.iter().chain(&after).map(|p| p.1).chain([0.0]), 1e-3);
    let plot = Plot {
        size: WIDE,
        x_label: "time since GNSS was taken away, s".to_owned(),
        y_label: "m/s".to_owned(),
        x: (0.0, crate::free_inertial::WINDOW_S),
        y: (0.0, y.1),
        marks: vec![Mark::Line(before, RED), Mark::Line(after, GREEN)],
    };
    Some(Panel {
        title: "Horizontal velocity error of a free INS (RMS)".to_owned(),
        svg: plot.svg(),
        keys: vec![
            key(RED, "sensors as logged"),
            key(GREEN, "estimates applied"),
        ],
    })
}

/// Horizontal errors of the solution: damped, and free from the middle on.
pub(super) fn against_truth(found: &Identification) -> Vec<Panel> {
    let Some(errors) = &found.against_truth else {
        return Vec::new();
    };
    let panel = |title: &str, unit: &str, value: fn(&Error) -> f64| {
        let line = |points: &[Point]| -> Vec<(f64, f64)> {
            // A point for each pixel; and nothing at zero, which no logarithm shows.
            let every = (points.len() / WIDE.0 as usize).max(1);
            let shown = points.iter().step_by(every);
            shown
                .map(|(time, error)| (since(found, *time), value(error).max(LEAST_ERROR)))
                .collect()
        };
        let lines = [
            (line(&errors.logged), RED),
            (line(&errors.free), GREEN),
            (line(&errors.damped), BLUE),
        ];
        let values = || {
            lines
                .iter()
                .flat_map(|(points, _)| points.iter().map(|p| p.1))
        };
        let plot = Plot {
            size: WIDE,
            x_label: "time, s".to_owned(),
            y_label: unit.to_owned(),
            x: duration(found),
            y: (
                0.8 * values().fold(f64::MAX, f64::min),
                1.25 * values().fold(LEAST_ERROR, f64::max),
            ),
            marks: lines
                .map(|(points, colour)| Mark::Line(points, colour))
                .into(),
        };
        Panel {
            title: title.to_owned(),
            svg: plot.svg_log_y(),
            keys: vec![
                key(BLUE, "damped"),
                key(GREEN, "free, estimates applied"),
                key(RED, "free, as logged"),
            ],
        }
    };
    vec![
        panel("Horizontal position error", "m", |error| error.position_m),
        panel("Horizontal velocity error", "m/s", |error| {
            error.velocity_mps
        }),
    ]
}

/// The way of the vehicle, coloured by manoeuvre.
pub(super) fn track(log: &Log, found: &Identification) -> Option<Panel> {
    let origin = found.solutions.first()?.position;
    let place = |position: &ins_core::earth::Geodetic| {
        let metres = position.enu_from(&origin);
        (metres.x, metres.y)
    };
    let fixes: Vec<_> = log
        .gnss
        .iter()
        .filter_map(|f| f.geodetic_or(0.0).as_ref().map(place))
        .collect();
    let mut marks = vec![Mark::Reference(fixes, GREY)];
    let rows: Vec<&Row> = navigating(found).collect();
    for (colour, points) in runs(&rows, place) {
        marks.push(Mark::Line(points, colour));
    }
    let size = (940, 620);
    let (x, y) = equal_scale(&marks, size);
    let (x_label, y_label) = ("east, m".to_owned(), "north, m".to_owned());
    Some(Panel {
        title: "Track and manoeuvres".to_owned(),
        svg: Plot {
            size,
            x_label,
            y_label,
            x,
            y,
            marks,
        }
        .svg(),
        keys: vec![
            key(BLUE, "steady"),
            key(GREEN, "accelerating"),
            key(RED, "braking"),
            key(ORANGE, "turning"),
            key(GREY, "standing; thin: GNSS"),
        ],
    })
}

/// Stretches of one manoeuvre each; every one begins where the last has ended.
fn runs(
    rows: &[&Row],
    place: impl Fn(&ins_core::earth::Geodetic) -> (f64, f64),
) -> Vec<(RGBColor, Vec<(f64, f64)>)> {
    let mut runs: Vec<(RGBColor, Vec<(f64, f64)>)> = Vec::new();
    for row in rows {
        let Some(solution) = row.solution else {
            continue;
        };
        let (point, colour) = (place(&solution.position), colour(row.manoeuvre));
        match runs.last_mut() {
            Some((known, points)) if *known == colour => points.push(point),
            Some((_, points)) => {
                points.push(point);
                runs.push((colour, vec![point]));
            }
            None => runs.push((colour, vec![point])),
        }
    }
    runs
}

fn colour(manoeuvre: Manoeuvre) -> RGBColor {
    match manoeuvre {
        Manoeuvre::Rest => GREY,
        Manoeuvre::Steady => BLUE,
        Manoeuvre::Accelerating => GREEN,
        Manoeuvre::Braking => RED,
        Manoeuvre::Turning => ORANGE,
    }
}

/// Axes on which a metre is as long east as north.
fn equal_scale(marks: &[Mark], size: (u32, u32)) -> ((f64, f64), (f64, f64)) {
    let points: Vec<(f64, f64)> = marks
        .iter()
        .flat_map(|mark| match mark {
            Mark::Line(points, _) | Mark::Reference(points, _) => points.as_slice(),
            Mark::Pale(..) | Mark::Band(..) | Mark::Shade(..) => &[],
        })
        .copied()
        .collect();
    let x = padded(points.iter().map(|p| p.0), 10.0);
    let y = padded(points.iter().map(|p| p.1), 10.0);
    // What margins and labels leave of the drawing.
    let (width, height) = (f64::from(size.0) - 80.0, f64::from(size.1) - 50.0);
    let metre = ((x.1 - x.0) / width).max((y.1 - y.0) / height);
    let around = |(low, high): (f64, f64), pixels: f64| {
        let (middle, half) = (0.5 * (low + high), 0.5 * pixels * metre);
        (middle - half, middle + half)
    };
    (around(x, width), around(y, height))
}

fn small(x: (f64, f64), y: (f64, f64), unit: &str, marks: Vec<Mark>) -> String {
    let (x_label, y_label) = ("time, s".to_owned(), unit.to_owned());
    Plot {
        size: SMALL,
        x_label,
        y_label,
        x,
        y,
        marks,
    }
    .svg()
}

fn navigating(found: &Identification) -> impl Iterator<Item = &Row> {
    found
        .history
        .iter()
        .filter(|row| row.phase == Phase::Navigating)
}

/// Seconds since the first sample.
fn since(found: &Identification, time: Time) -> f64 {
    found
        .history
        .first()
        .map_or(0.0, |first| time.seconds_since(first.time))
}

fn duration(found: &Identification) -> (f64, f64) {
    (0.0, since(found, found.end.time).max(1.0))
}
