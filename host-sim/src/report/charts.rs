//! What the plots of the report show.

use ins_core::earth::Geodetic;
use ins_core::{Estimate, ImuOutput, Manoeuvre, Phase, Solution, SolutionSigma, Time};
use plotly::common::MarkerSymbol;
use plotters::style::RGBColor;

use crate::compare::five_stage::Stage;
use crate::identify::against_truth;
use crate::identify::analysis::Analysis;
use crate::identify::error_model::{Sensors, allan};
use crate::identify::free_inertial::WINDOW_S;
use crate::identify::held_ins::LevelError;
use crate::identify::innovations::{Innovation, Off, consistency};
use crate::identify::quantities::{DEG_H_RADPS, Quantities, Quantity, in_axes};
use crate::identify::row::Row;
use crate::identify::run::Identification;
use crate::identify::true_errors::Truth;
use crate::identify::words::{is_used, of_fix};
use crate::log::BodyAxes;
use crate::page::chart::{Chart, Figure, MOST_POINTS, Point, Spread, Thinner, sampled, thinned};
use crate::page::html::Section;
use crate::page::plot::{BLUE, GREEN, GREY, ORANGE, RED, padded};

/// Errors below are drawn here, m and m/s.
const LEAST_ERROR: f64 = 1e-3;
/// Most points of a track, and most refused fixes that are marked.
const MOST_PLACES: usize = 4000;
const MOST_REFUSED: usize = 500;
const EAST_NORTH_UP: [(&str, RGBColor); 3] = [("east", BLUE), ("north", ORANGE), ("up", GREEN)];
const AXES: [(&str, RGBColor); 3] = [("x", BLUE), ("y", ORANGE), ("z", GREEN)];

/// An estimate as it converges.
pub(crate) struct Converging {
    pub(crate) title: String,
    pub(crate) unit: &'static str,
    /// Time since the first sample, value and one sigma.
    pub(crate) points: Vec<Spread>,
    pub(crate) truth: Option<f64>,
    /// When the vehicle did what shows it.
    pub(crate) shown: Vec<Point>,
}

impl Converging {
    /// Axis for where the estimate settles, several sigmas wide; the first guesses may run out of
    /// it.
    pub(crate) fn settled_range(&self) -> Point {
        let settled = &self.points[self.points.len() / 4..];
        let ends = |&(_, value, sigma): &Spread| [value - sigma, value + sigma];
        let mut edges: Vec<f64> = settled.iter().flat_map(ends).collect();
        edges.sort_by(f64::total_cmp);
        let part = edges.len() / 20;
        let middle = edges.get(part..edges.len() - part).unwrap_or_default();
        let wide = |&(_, value, sigma): &Spread| [value - 6.0 * sigma, value + 6.0 * sigma];
        let end = self.points.last().map(wide);
        padded(
            (middle.iter().copied())
                .chain(end.into_iter().flatten())
                .chain(self.truth),
            1e-3,
        )
    }

    fn figure(&self, duration_s: f64) -> Figure {
        let mut chart = Chart::over_time(&self.title, self.unit, duration_s);
        if !self.shown.is_empty() {
            chart = chart.shade("manoeuvres that show it", &self.shown);
        }
        chart = chart.band(
            "estimate, one sigma",
            BLUE,
            &sampled(&self.points, MOST_POINTS),
        );
        if let Some(truth) = self.truth {
            chart = chart.reference("truth", RED, &[(0.0, truth), (duration_s, truth)]);
        }
        chart.range(self.settled_range()).figure()
    }
}

/// The estimates of the summary, and when each was observable.
pub(crate) fn converging(analysis: &Analysis) -> Vec<Converging> {
    let (found, axes) = (&analysis.found, analysis.log.meta.body_axes);
    let level = Some(Stage::LevelAccels);
    // The others show all the time.
    let kinds = [
        ("Azimuth error", "deg", Some(Stage::Azimuth)),
        ("Accelerometer bias x", "mg", level),
        ("Accelerometer bias y", "mg", level),
        ("Accelerometer bias z", "mg", None),
        ("Gyro bias x", "deg/h", None),
        ("Gyro bias y", "deg/h", None),
        ("Gyro bias z", "deg/h", None),
        ("GNSS latency", "ms", Some(Stage::Latency)),
    ];
    let truths = analysis.truth.as_ref().map(Truth::columns);
    let rows: Vec<_> = navigating(found)
        .map(|row| {
            (
                since(found, row.time),
                Quantities::of_log(&row.estimates, &analysis.log.meta).columns(),
            )
        })
        .collect();
    let seconds = |(from, to)| (since(found, from), since(found, to));
    let one = |(index, (title, unit, stage)): (usize, (&str, _, Option<Stage>))| Converging {
        title: match index {
            1..=6 => format!("{title}, {}", axes.direction((index - 1) % 3)),
            _ => title.to_owned(),
        },
        unit,
        points: (rows.iter())
            .map(|(time, columns)| spread(*time, &columns[index].1))
            .collect(),
        truth: truths.and_then(|truths| truths[index]),
        shown: stage.map_or_else(Vec::new, |stage| {
            let intervals = stage.intervals(&found.history);
            intervals.into_iter().map(seconds).collect()
        }),
    };
    kinds.into_iter().enumerate().map(one).collect()
}

fn spread(time_s: f64, quantity: &Quantity) -> Spread {
    (time_s, quantity.value, quantity.sigma)
}

/// All plots of a log.
pub(super) fn sections(analysis: &Analysis, sensors: Option<&Sensors>) -> Vec<Section> {
    let charts = Charts {
        analysis,
        found: &analysis.found,
        axes: analysis.log.meta.body_axes,
        duration_s: since(&analysis.found, analysis.found.end.time).max(1.0),
    };
    let section = |title, note, figures| Section {
        title,
        note,
        figures,
    };
    let mut sections = vec![
        section("Estimates as they converge", "", charts.estimates()),
        section("What the estimates are worth", "", charts.worth()),
        section("Where it went", "", charts.track().into_iter().collect()),
        section("Attitude, height and speed", "", charts.motion()),
        section(
            "Innovations: GNSS minus the solution of its moment",
            "Expected: spread of the solution and noise of the fix, as the receiver states it or as \
             configured. Root mean square over expectation: 1 where they agree.",
            charts.innovations(),
        ),
        section("Fixes, gaps and latency", "", charts.stamps()),
        section("Sensors as logged", "", charts.sensors()),
        section(
            "Sensors at rest",
            "",
            sensors.map_or_else(Vec::new, allan_figures),
        ),
        section("Damping signals", "", charts.damping()),
    ];
    sections.retain(|section| !section.figures.is_empty());
    sections
}

struct Charts<'a> {
    analysis: &'a Analysis,
    found: &'a Identification,
    axes: BodyAxes,
    duration_s: f64,
}

impl Charts<'_> {
    fn over_time(&self, title: impl Into<String>, unit: &str) -> Chart {
        Chart::over_time(title, unit, self.duration_s)
    }

    /// Something of every row of the history in which it navigates.
    fn rows(&self, value: impl Fn(&Row) -> Spread) -> Vec<Spread> {
        navigating(self.found).map(value).collect()
    }

    fn estimates(&self) -> Vec<Figure> {
        let lever = |axis: usize| {
            let arm = |row: &Row| {
                let arm = in_axes(self.axes, &row.estimates.lever_arm_m, 1.0);
                spread(since(self.found, row.time), arm.named()[axis].1)
            };
            Converging {
                title: format!("Antenna {}, {}", AXES[axis].0, self.axes.direction(axis)),
                unit: "m",
                points: self.rows(arm),
                truth: None,
                shown: Vec::new(),
            }
        };
        let mut all = converging(self.analysis);
        if self.analysis.summary.lever_arm_m.is_some() {
            all.extend((0..3).map(lever));
        }
        all.retain(|one| !one.points.is_empty());
        all.iter().map(|one| one.figure(self.duration_s)).collect()
    }

    /// A free INS within windows, and against the truth.
    fn worth(&self) -> Vec<Figure> {
        let mut figures = Vec::new();
        if let Some(error) = &self.found.velocity_error {
            let growth = |value: fn(&crate::identify::free_inertial::Growth) -> f64| -> Vec<Point> {
                error.growth.iter().map(|g| (g.since_s, value(g))).collect()
            };
            let title = "Horizontal velocity error of a free INS, RMS";
            let chart = Chart::new(title, "time since GNSS was taken away, s", "m/s")
                .line("sensors as logged", RED, &growth(|g| g.before_mps))
                .line("estimates applied", GREEN, &growth(|g| g.after_mps));
            figures.push(
                chart
                    .note(format!("{} windows of {WINDOW_S:.0} s", error.windows))
                    .figure(),
            );
        }
        let Some(errors) = &self.found.against_truth else {
            return figures;
        };
        let curve = |points: &[against_truth::Point], value: fn(&LevelError) -> f64| {
            // Nothing at zero, which no logarithm shows.
            let point = |(time, error): &(Time, LevelError)| {
                (since(self.found, *time), value(error).max(LEAST_ERROR))
            };
            thinned(points.iter().map(point))
        };
        let figure = |title, unit, value: fn(&LevelError) -> f64| {
            let curves = [&errors.logged, &errors.free, &errors.damped].map(|e| curve(e, value));
            self.over_time(title, unit)
                .line("free, as logged", RED, &curves[0])
                .line("free, estimates applied", GREEN, &curves[1])
                .line("damped", BLUE, &curves[2])
                .logarithmic_y(curves.iter().flatten().map(|point| point.1))
                .figure()
        };
        figures.push(figure("Horizontal position error", "m", |e| e.position_m));
        figures.push(figure("Horizontal velocity error", "m/s", |e| {
            e.velocity_mps
        }));
        figures
    }

    /// Where it went, coloured by manoeuvre.
    fn track(&self) -> Option<Figure> {
        let rows: Vec<(Manoeuvre, Point)> = navigating(self.found)
            .filter_map(|row| Some((row.manoeuvre, place(&row.solution?.position))))
            .collect();
        let ((_, start), (_, end)) = (*rows.first()?, *rows.last()?);
        let rows = sampled(&rows, MOST_PLACES);
        let fixes: Vec<Point> = (sampled(&self.analysis.log.gnss, MOST_PLACES).iter())
            .filter_map(|fix| fix.geodetic_or(0.0).as_ref().map(place))
            .collect();
        let mut chart = Chart::map("Track", start.1.to_radians().cos().recip());
        chart = chart.reference("GNSS", GREY, &fixes);
        for (manoeuvre, name, colour) in [
            (Manoeuvre::Rest, "standing", GREY),
            (Manoeuvre::Steady, "steady", BLUE),
            (Manoeuvre::Accelerating, "accelerating", GREEN),
            (Manoeuvre::Braking, "braking", RED),
            (Manoeuvre::Turning, "turning", ORANGE),
        ] {
            let runs = runs(&rows, manoeuvre);
            if !runs.is_empty() {
                chart = chart.line(name, colour, &runs);
            }
        }
        let mark = |place, text: &str| [(place, text.to_owned())];
        chart = chart
            .marks(
                "start",
                GREEN,
                MarkerSymbol::TriangleUp,
                &mark(start, "start"),
            )
            .marks("end", RED, MarkerSymbol::Square, &mark(end, "end"));
        Some(chart.figure())
    }

    /// The solution in its sigmas, over the reference where there is one.
    fn motion(&self) -> Vec<Figure> {
        let rows: Vec<(f64, Solution, [f64; 5])> = navigating(self.found)
            .filter_map(|row| Some((row, row.solution?)))
            .map(|(row, s)| {
                let known = row.sigma.map_or([f64::NAN; 5], |sigma| sigmas(&sigma, &s));
                (since(self.found, row.time), s, known)
            })
            .collect();
        let (rows, truth) = (sampled(&rows, MOST_POINTS), &self.analysis.log.truth);
        let truth = sampled(truth, MOST_POINTS);
        let figure = |index: usize, title, unit| {
            let points: Vec<Spread> = (rows.iter())
                .map(|(time, s, sigmas)| (*time, values(s)[index], sigmas[index]))
                .collect();
            let reference: Vec<Spread> = (truth.iter())
                .map(|s| (since(self.found, s.time), values(s)[index], 0.0))
                .collect();
            let mut chart = self.over_time(title, unit);
            if !reference.is_empty() {
                let curve: Vec<Point> = unwound(&reference).iter().map(|p| (p.0, p.1)).collect();
                chart = chart.reference("reference", RED, &curve);
            }
            // The first sigmas would flatten the rest.
            let inner = padded(points.iter().map(|point| point.1), 1e-3);
            chart = chart.band("solution, one sigma", BLUE, &unwound(&points));
            let chart = if index == 2 {
                chart.circle()
            } else {
                chart.range(inner)
            };
            chart.figure()
        };
        if rows.is_empty() {
            return Vec::new();
        }
        let mut figures = vec![
            figure(0, "Roll", "deg"),
            figure(1, "Pitch", "deg"),
            figure(2, "Heading, clockwise from north", "deg"),
            figure(3, "Height above the ellipsoid", "m"),
            figure(4, "Speed over ground", "m/s"),
        ];
        let enu = ["east", "north", "up"];
        figures.extend(
            [
                self.one_sigma(
                    "attitude",
                    "deg",
                    ["roll", "pitch", "heading"],
                    |sigma, s| {
                        let [roll, pitch, heading, ..] = sigmas(sigma, s);
                        [roll, pitch, heading]
                    },
                ),
                self.one_sigma("position", "m", enu, |sigma, _| sigma.position_m.into()),
                self.one_sigma("velocity", "m/s", enu, |sigma, _| sigma.velocity_mps.into()),
            ]
            .into_iter()
            .flatten(),
        );
        figures
    }

    /// Three sigmas of the solution; none where they are not known.
    fn one_sigma(
        &self,
        of: &str,
        unit: &str,
        names: [&str; 3],
        three: impl Fn(&SolutionSigma, &Solution) -> [f64; 3],
    ) -> Option<Figure> {
        let rows: Vec<(f64, [f64; 3])> = navigating(self.found)
            .filter_map(|row| {
                Some((
                    since(self.found, row.time),
                    three(&row.sigma?, &row.solution?),
                ))
            })
            .collect();
        let values = rows.iter().flat_map(|(_, sigmas)| *sigmas);
        let mut chart = (self.over_time(format!("One sigma of {of}"), unit)).logarithmic_y(values);
        for (index, (name, (_, colour))) in names.iter().zip(AXES).enumerate() {
            let curve = thinned(rows.iter().map(|(t, sigmas)| (*t, sigmas[index])));
            chart = chart.line(name, colour, &curve);
        }
        (!rows.is_empty()).then(|| chart.figure())
    }

    /// Each component of the fixes against the solution of its moment.
    fn innovations(&self) -> Vec<Figure> {
        type Component = fn(&Innovation) -> [Option<Off>; 3];
        let kinds: [(&str, &str, Component); 2] = [
            ("Velocity", "m/s", |i| i.velocity_mps),
            ("Position", "m", |i| i.position_m),
        ];
        let mut figures = Vec::new();
        for (quantity, unit, component) in kinds {
            for (axis, (direction, colour)) in EAST_NORTH_UP.into_iter().enumerate() {
                let offs: Vec<(f64, Off)> = (self.found.innovations.iter())
                    .filter_map(|i| Some((since(self.found, i.time), component(i)[axis]?)))
                    .collect();
                let Some(ratio) = consistency(offs.iter().map(|(_, off)| *off)) else {
                    continue;
                };
                let sigmas: Vec<Point> = offs.iter().map(|(t, off)| (*t, off.sigma)).collect();
                let values: Vec<f64> = offs.iter().map(|(_, off)| off.value).collect();
                let curve = thinned(offs.iter().map(|(t, off)| (*t, off.value)));
                let chart = self
                    .over_time(format!("{quantity}, {direction}"), unit)
                    .note(format!("RMS over expectation: {ratio:.2}"))
                    .noise("GNSS minus solution", colour, &curve)
                    .expected("expected, one sigma", RED, &sampled(&sigmas, MOST_POINTS))
                    .range(inner_range(&[&values]));
                figures.push(chart.figure());
            }
        }
        figures
    }

    /// Intervals between stamps, what was refused, and latency as it is at each moment.
    fn stamps(&self) -> Vec<Figure> {
        let log = &self.analysis.log;
        let step = |pair: &[Time]| {
            let seconds = pair[1].seconds_since(pair[0]);
            (since(self.found, pair[1]), seconds.max(1e-6))
        };
        let fixes: Vec<Time> = self.found.fixes.iter().map(|fix| fix.0).collect();
        let fix_steps: Vec<Point> = fixes.windows(2).map(step).collect();
        let refused: Vec<(Point, String)> = (self.found.fixes.iter())
            .filter(|(_, outcome)| !is_used(*outcome))
            .map(|(time, outcome)| {
                let seconds = since(self.found, *time);
                let at = fix_steps.partition_point(|step| step.0 < seconds);
                let height = fix_steps
                    .get(at)
                    .or(fix_steps.last())
                    .map_or(1.0, |step| step.1);
                (
                    (seconds, height),
                    format!("{seconds:.1} s: {}", of_fix(*outcome)),
                )
            })
            .collect();
        let mut chart = self
            .over_time("Interval between fixes", "s")
            .note(format!(
                "{} used, {} refused",
                fixes.len() - refused.len(),
                refused.len()
            ))
            .line("interval", BLUE, &thinned(fix_steps.iter().copied()))
            .logarithmic_y(fix_steps.iter().map(|step| step.1));
        if !refused.is_empty() {
            let shown = sampled(&refused, MOST_REFUSED);
            chart = chart.marks("refused", RED, MarkerSymbol::X, &shown);
        }
        let mut sample_steps = Thinner::new(log.imu.len().saturating_sub(1));
        for [last, sample] in log.imu.pairs() {
            sample_steps.push(step(&[last.time, sample.time]));
        }
        let sample_steps = sample_steps.finish();
        let samples = self
            .over_time("Interval between inertial samples", "s")
            .line("interval", BLUE, &sample_steps)
            .logarithmic_y(sample_steps.iter().map(|step| step.1));
        let now = |row: &Row| {
            let Estimate { value, sigma, .. } = row.estimates.gnss_latency_now_s;
            (since(self.found, row.time), 1e3 * value, 1e3 * sigma)
        };
        let latency = Converging {
            title: "GNSS latency at the moment".to_owned(),
            unit: "ms",
            points: self.rows(now),
            truth: None,
            shown: Vec::new(),
        };
        let mut figures = vec![chart.figure(), samples.figure()];
        if !latency.points.is_empty() {
            figures.push(latency.figure(self.duration_s));
        }
        figures
    }

    /// Gyros and accelerometers in the axes of the log.
    fn sensors(&self) -> Vec<Figure> {
        let log = &self.analysis.log;
        let rates = log.meta.imu == ImuOutput::Rates;
        let curve = || Thinner::new(log.imu.len().saturating_sub(1));
        let [mut gyros, mut accels] = [0, 1].map(|_| [0, 1, 2].map(|_| curve()));
        for [last, sample] in log.imu.pairs() {
            let seconds = sample.time.seconds_since(last.time);
            let per_second = if rates { 1.0 } else { seconds.recip() };
            let time_s = since(self.found, sample.time);
            let gyro = self
                .axes
                .from_rfu(sample.gyro * 1_f64.to_degrees() * per_second);
            let accel = self.axes.from_rfu(sample.accel * per_second);
            for axis in 0..3 {
                gyros[axis].push((time_s, gyro[axis]));
                accels[axis].push((time_s, accel[axis]));
            }
        }
        let figure = |title, unit, curves: [Thinner; 3]| {
            let mut chart = self.over_time(title, unit);
            for (axis, ((name, colour), curve)) in AXES.into_iter().zip(curves).enumerate() {
                let name = format!("{name}, {}", self.axes.direction(axis));
                chart = chart.line(&name, colour, &curve.finish());
            }
            chart.figure()
        };
        vec![
            figure("Gyros", "deg/s", gyros),
            figure("Accelerometers", "m/s\u{b2}", accels),
        ]
    }

    /// The corrections f^C and omega^C, and what they come from.
    fn damping(&self) -> Vec<Figure> {
        type Signal = fn(&Row) -> nalgebra::Vector3<f64>;
        let kinds: [(&str, &str, f64, Signal); 3] = [
            ("Into the velocity block, f^C", "m/s\u{b2}", 1.0, |row| {
                row.signals.accel_enu_mps2
            }),
            (
                "Into the attitude block, \u{3c9}^C",
                "deg/h",
                DEG_H_RADPS,
                |row| row.signals.rate_enu_radps,
            ),
            ("Velocity, INS minus GNSS", "m/s", 1.0, |row| {
                row.signals.difference_enu_mps
            }),
        ];
        if navigating(self.found).next().is_none() {
            return Vec::new();
        }
        let figure = |(title, unit, scale, signal): (&str, &str, f64, Signal)| {
            let values = |axis: usize| -> Vec<Point> {
                navigating(self.found)
                    .map(|row| (since(self.found, row.time), signal(row)[axis] / scale))
                    .collect()
            };
            let curves = [0, 1, 2].map(values);
            let ys = curves
                .each_ref()
                .map(|c| c.iter().map(|p| p.1).collect::<Vec<f64>>());
            let mut chart = self.over_time(title, unit);
            for ((name, colour), curve) in EAST_NORTH_UP.into_iter().zip(&curves) {
                chart = chart.noise(name, colour, &thinned(curve.iter().copied()));
            }
            chart.range(inner_range(&[&ys[0], &ys[1], &ys[2]])).figure()
        };
        kinds.into_iter().map(figure).collect()
    }
}

/// Allan deviations beside the white noise that was found.
pub(super) fn allan_figures(sensors: &Sensors) -> Vec<Figure> {
    let (model, at_rest) = (sensors.model.model(), sensors.at_rest);
    let figure = |title, unit, points: &[allan::Point], noise: f64| {
        let line = |value: &dyn Fn(&allan::Point) -> f64| -> Vec<Point> {
            points.iter().map(|p| (p.tau_s, value(p))).collect()
        };
        let deviations = points
            .iter()
            .flat_map(|p| p.deviation)
            .map(|sigma| sigma.value);
        let mut chart = Chart::new(title, "cluster time, s", unit)
            .logarithmic_x(points.iter().map(|p| p.tau_s))
            .logarithmic_y(deviations);
        for (axis, (name, (_, colour))) in ["right", "forward", "up"].iter().zip(AXES).enumerate() {
            chart = chart.line(name, colour, &line(&|p| p.deviation[axis].value));
        }
        let white = line(&|p| noise / p.tau_s.sqrt());
        chart.reference("white noise found", RED, &white).figure()
    };
    if at_rest.gyro_deg_h.is_empty() {
        return Vec::new();
    }
    vec![
        figure(
            "Gyros at rest, Allan deviation",
            "deg/h",
            &at_rest.gyro_deg_h,
            model.gyro_deg_h.white_noise,
        ),
        figure(
            "Accelerometers at rest, Allan deviation",
            "m/s\u{b2}",
            &at_rest.accel_mps2,
            model.accel_mps2.white_noise,
        ),
    ]
}

/// Roll, pitch, heading, deg; height, m; speed, m/s.
fn values(solution: &Solution) -> [f64; 5] {
    let euler = solution.euler();
    [
        euler.roll_rad.to_degrees(),
        euler.pitch_rad.to_degrees(),
        euler.heading_rad.to_degrees().rem_euclid(360.0),
        solution.position.height_m,
        solution.velocity_enu_mps.xy().norm(),
    ]
}

/// One sigma of each.
fn sigmas(sigma: &SolutionSigma, solution: &Solution) -> [f64; 5] {
    // East and north turned to along and across a direction; what they have in common is not known.
    let along = |angle: f64, east: f64, north: f64| (angle.sin() * east).hypot(angle.cos() * north);
    let across = |angle: f64, east: f64, north: f64| along(angle, north, east);
    let (heading, tilt) = (solution.euler().heading_rad, sigma.attitude_rad);
    let velocity = solution.velocity_enu_mps;
    let course = velocity.x.atan2(velocity.y);
    [
        along(heading, tilt.x, tilt.y).to_degrees(),
        across(heading, tilt.x, tilt.y).to_degrees(),
        tilt.z.to_degrees(),
        sigma.position_m.z,
        along(course, sigma.velocity_mps.x, sigma.velocity_mps.y),
    ]
}

/// Broken where an angle goes through north, or through 180 deg.
fn unwound(points: &[Spread]) -> Vec<Spread> {
    let mut broken = Vec::with_capacity(points.len());
    for (index, point) in points.iter().enumerate() {
        if index > 0 && (point.1 - points[index - 1].1).abs() > 180.0 {
            broken.push((point.0, f64::NAN, f64::NAN));
        }
        broken.push(*point);
    }
    broken
}

/// Axis that a few wild values, like those of the start, do not flatten.
fn inner_range(series: &[&[f64]]) -> Point {
    let mut values: Vec<f64> = series.iter().flat_map(|s| s.iter().copied()).collect();
    values.sort_by(f64::total_cmp);
    let part = values.len() / 200;
    let (low, high) = padded(values[part..values.len() - part].iter().copied(), 1e-3);
    (low.min(-high), high.max(-low))
}

/// Longitude and latitude, deg.
fn place(position: &Geodetic) -> Point {
    (
        position.longitude_rad.to_degrees(),
        position.latitude_rad.to_degrees(),
    )
}

/// The stretches of one manoeuvre, each to where the next begins, with breaks between.
fn runs(rows: &[(Manoeuvre, Point)], which: Manoeuvre) -> Vec<Point> {
    let mut points = Vec::new();
    for pair in rows.windows(2) {
        if pair[0].0 == which {
            points.push(pair[0].1);
            if pair[1].0 != which {
                points.extend([pair[1].1, (f64::NAN, f64::NAN)]);
            }
        }
    }
    points
}

fn navigating(found: &Identification) -> impl Iterator<Item = &Row> {
    let rows = found.history.iter();
    rows.filter(|row| row.phase == Phase::Navigating)
}

/// Seconds since the first sample.
fn since(found: &Identification, time: Time) -> f64 {
    let first = found.history.first();
    first.map_or(0.0, |first| time.seconds_since(first.time))
}
