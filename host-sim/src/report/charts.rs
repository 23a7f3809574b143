//! The plots of the report.

use ins_core::earth::Geodetic;
use ins_core::{Manoeuvre, Phase, Solution, SolutionSigma, Time};
use plotters::style::RGBColor;

use crate::compare::five_stage::Stage;
use crate::identify::against_truth;
use crate::identify::analysis::Analysis;
use crate::identify::baro_aided_ins::HorizontalError;
use crate::identify::error_model::{Sensors, allan};
use crate::identify::free_inertial::{Growth, WINDOW_S};
use crate::identify::innovations::{Innovation, Residual};
use crate::identify::quantities::{
    DEG_H_RADPS, QUANTITIES, Quantities, Quantity, axis_name, in_axes, latency_of_log, title,
};
use crate::identify::row::Row;
use crate::identify::run::Identification;
use crate::identify::true_errors::Truth;
use crate::identify::words::{is_used, of_fix};
use crate::log::BodyAxes;
use crate::page::chart::{
    BREAK, Chart, Figure, MOST_POINTS, Point, SigmaPoint, Thinner, sampled, thinned,
};
use crate::page::html::Section;
use crate::page::plot::{BLUE, GREEN, GREY, ORANGE, RED, padded};
use crate::statistics::rms_of_any;

/// Smaller errors are drawn as this on logarithmic axes, m and m/s.
const MIN_ERROR: f64 = 1e-3;
/// Limits of the points of a track, and of the refused fixes that are marked.
const MAX_TRACK_POINTS: usize = 4000;
const MAX_REFUSED: usize = 500;
/// Longest gap in the samples that does not break their curve, s.
const MAX_GAP_S: f64 = 0.5;
const COLOURS: [RGBColor; 3] = [BLUE, ORANGE, GREEN];
const EAST_NORTH_UP: [&str; 3] = ["east", "north", "up"];

pub(crate) struct EstimateHistory {
    pub(crate) title: String,
    pub(crate) unit: &'static str,
    /// Time since the first sample, value and one sigma.
    pub(crate) points: Vec<SigmaPoint>,
    pub(crate) truth: Option<f64>,
    /// Intervals of the manoeuvres that make it observable.
    pub(crate) observable_times: Vec<Point>,
}

impl EstimateHistory {
    fn new(
        title: String,
        unit: &'static str,
        estimates: impl Iterator<Item = (f64, Quantity)>,
    ) -> Self {
        let spread = |(time_s, q): (f64, Quantity)| (time_s, q.value, q.sigma);
        Self {
            title,
            unit,
            points: estimates.map(spread).collect(),
            truth: None,
            observable_times: Vec::new(),
        }
    }

    /// Range of the axis: that of the settled estimate, several sigmas wide; the first estimates may exceed
    /// it.
    pub(crate) fn settled_range(&self) -> Point {
        let settled = &self.points[self.points.len() / 4..];
        let ends = |&(_, value, sigma): &SigmaPoint| [value - sigma, value + sigma];
        let mut edges: Vec<f64> = settled.iter().flat_map(ends).collect();
        edges.sort_by(f64::total_cmp);
        let part = edges.len() / 20;
        let middle = edges.get(part..edges.len() - part).unwrap_or_default();
        let wide = |&(_, value, sigma): &SigmaPoint| [value - 6.0 * sigma, value + 6.0 * sigma];
        let end = self.points.last().map(wide);
        padded(
            (middle.iter().copied())
                .chain(end.into_iter().flatten())
                .chain(self.truth),
            1e-3,
        )
    }

    fn figure(&self, duration_s: f64) -> Figure {
        let points = sampled(&self.points, MOST_POINTS);
        let mut chart = Chart::over_time(&self.title, self.unit, duration_s)
            .shade("manoeuvres that show it", &self.observable_times)
            .band("estimate, one sigma", BLUE, &points);
        if let Some(truth) = self.truth {
            chart = chart.reference("truth", RED, &[(0.0, truth), (duration_s, truth)]);
        }
        chart.range(self.settled_range()).figure()
    }
}

pub(super) fn sections(analysis: &Analysis, sensors: Option<&Sensors>) -> Vec<Section> {
    let charts = Charts::new(analysis);
    let expected = "Expected: spread of the solution and noise of the fix, as the receiver states it or as \
         configured. Root mean square over expectation: 1 where they agree.";
    let sections = [
        ("Estimates as they converge", "", charts.estimates()),
        ("What the estimates are worth", "", charts.free_inertial()),
        ("Where it went", "", Vec::from_iter(charts.track())),
        ("Attitude, height and speed", "", charts.motion()),
        (
            "Innovations: GNSS minus the solution of its moment",
            expected,
            charts.innovations(),
        ),
        ("Fixes, gaps and latency", "", charts.stamps()),
        ("Sensors as logged", "", charts.sensors()),
        (
            "Sensors at rest",
            "",
            sensors.map_or_else(Vec::new, allan_figures),
        ),
        ("Damping signals", "", charts.damping()),
    ];
    let section = |(title, note, figures)| Section {
        title,
        note,
        figures,
    };
    sections.into_iter().map(section).collect()
}

pub(super) struct Charts<'a> {
    analysis: &'a Analysis,
    found: &'a Identification,
    axes: BodyAxes,
    duration_s: f64,
}

impl<'a> Charts<'a> {
    pub(super) fn new(analysis: &'a Analysis) -> Self {
        let mut charts = Self {
            analysis,
            found: &analysis.found,
            axes: analysis.log.meta.body_axes,
            duration_s: 1.0,
        };
        charts.duration_s = charts.since(analysis.found.end.time).max(1.0);
        charts
    }

    fn over_time(&self, title: impl Into<String>, unit: &str) -> Chart {
        Chart::over_time(title, unit, self.duration_s)
    }

    /// Seconds since the first sample.
    fn since(&self, time: Time) -> f64 {
        let first = self.found.history.first();
        first.map_or(0.0, |first| time.seconds_since(first.time))
    }

    /// Times and values of all rows of the history with phase navigating.
    fn rows<T>(&self, value: impl Fn(&Row) -> Option<T>) -> impl Iterator<Item = (f64, T)> {
        let rows = self.found.history.iter();
        rows.filter(|row| row.phase == Phase::Navigating)
            .filter_map(move |row| Some((self.since(row.time), value(row)?)))
    }

    /// Histories of the estimates of the summary, and when each was observable.
    pub(super) fn estimate_histories(&self) -> Vec<EstimateHistory> {
        let meta = &self.analysis.log.meta;
        let truths = self.analysis.truth.as_ref().map(Truth::columns);
        let quantities = |row: &Row| Some(Quantities::of_log(&row.estimates, meta).columns());
        let rows: Vec<_> = self.rows(quantities).collect();
        let one = |(index, (_, _, unit)): (usize, (&str, &str, &'static str))| {
            let stage = match index {
                0 => Some(Stage::Azimuth),
                1 | 2 => Some(Stage::LevelAccels),
                7 => Some(Stage::Latency),
                _ => None, // Always observable.
            };
            let intervals = stage.map(|stage| stage.intervals(&self.found.history));
            let intervals = intervals.into_iter().flatten();
            let estimates = (rows.iter()).map(|(time_s, columns)| (*time_s, columns[index].1));
            EstimateHistory {
                truth: truths.and_then(|truths| truths[index]),
                observable_times: intervals
                    .map(|(from, to)| (self.since(from), self.since(to)))
                    .collect(),
                ..EstimateHistory::new(title(index, self.axes), unit, estimates)
            }
        };
        QUANTITIES.into_iter().enumerate().map(one).collect()
    }

    fn estimates(&self) -> Vec<Figure> {
        let lever = |axis: usize| {
            let arm =
                |row: &Row| Some(in_axes(self.axes, &row.estimates.lever_arm_m, 1.0).each()[axis]);
            let title = format!("Antenna {}", axis_name(axis, self.axes));
            EstimateHistory::new(title, "m", self.rows(arm))
        };
        let mut all = self.estimate_histories();
        if self.analysis.summary.lever_arm_m.is_some() {
            all.extend((0..3).map(lever));
        }
        all.iter().map(|one| one.figure(self.duration_s)).collect()
    }

    /// A free INS within windows, and against the truth.
    fn free_inertial(&self) -> Vec<Figure> {
        let mut figures = Vec::new();
        let error = &self.found.velocity_error;
        if error.windows > 0 {
            let growth = |value: fn(&Growth) -> f64| -> Vec<Point> {
                error.growth.iter().map(|g| (g.since_s, value(g))).collect()
            };
            let title = "Horizontal velocity error of a free INS, RMS";
            let chart = Chart::new(title, "time since GNSS was taken away, s", "m/s")
                .note(format!("{} windows of {WINDOW_S:.0} s", error.windows))
                .line("sensors as logged", RED, &growth(|g| g.before_mps))
                .line("estimates applied", GREEN, &growth(|g| g.after_mps));
            figures.push(chart.figure());
        }
        let Some(errors) = &self.found.against_truth else {
            return figures;
        };
        let curve = |points: &[against_truth::Point], value: fn(&HorizontalError) -> f64| {
            // The logarithm of zero cannot be drawn.
            let point = |(time, error): &(Time, HorizontalError)| {
                (self.since(*time), value(error).max(MIN_ERROR))
            };
            thinned(points.iter().map(point))
        };
        let figure = |title, unit, value: fn(&HorizontalError) -> f64| {
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

    /// The track, coloured by manoeuvre.
    fn track(&self) -> Option<Figure> {
        let point = |row: &Row| Some((row.manoeuvre, lon_lat(&row.solution?.position)));
        let rows: Vec<(Manoeuvre, Point)> = self.rows(point).map(|(_, point)| point).collect();
        let ((_, start), (_, end)) = (*rows.first()?, *rows.last()?);
        let rows = sampled(&rows, MAX_TRACK_POINTS);
        let fixes: Vec<Point> = (sampled(&self.analysis.log.gnss, MAX_TRACK_POINTS).iter())
            .filter_map(|fix| fix.geodetic_or(0.0).as_ref().map(lon_lat))
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
            chart = chart.line(name, colour, &pieces(&rows, manoeuvre));
        }
        let mark = |point, text: &str| [(point, text.to_owned())];
        chart = chart
            .marks("start", GREEN, "triangle-up", &mark(start, "start"))
            .marks("end", RED, "square", &mark(end, "end"));
        Some(chart.figure())
    }

    /// The solution with its sigmas, and the reference, if any.
    fn motion(&self) -> Vec<Figure> {
        let solution = |row: &Row| {
            let solution = row.solution?;
            let known = row.sigma.map(|sigma| sigmas(&sigma, &solution));
            Some((values(&solution), known.unwrap_or([f64::NAN; 5])))
        };
        let rows: Vec<_> = self.rows(solution).collect();
        let (rows, truth) = (sampled(&rows, MOST_POINTS), &self.analysis.log.truth);
        let truth = sampled(truth, MOST_POINTS);
        let figure = |index: usize, title, unit| {
            let points: Vec<SigmaPoint> = (rows.iter())
                .map(|(time, (values, sigmas))| (*time, values[index], sigmas[index]))
                .collect();
            let reference: Vec<SigmaPoint> = (truth.iter())
                .map(|s| (self.since(s.time), values(s)[index], 0.0))
                .collect();
            let curve: Vec<Point> = wrapped(&reference).iter().map(|p| (p.0, p.1)).collect();
            // Not by the sigmas: the first ones are too large.
            let inner = padded(points.iter().map(|point| point.1), 1e-3);
            let chart = (self.over_time(title, unit))
                .reference("reference", RED, &curve)
                .band("solution, one sigma", BLUE, &wrapped(&points));
            let chart = if index == 2 {
                chart.circle()
            } else {
                chart.range(inner)
            };
            chart.figure()
        };
        let mut figures = vec![
            figure(0, "Roll", "deg"),
            figure(1, "Pitch", "deg"),
            figure(2, "Heading, clockwise from north", "deg"),
            figure(3, "Height above the ellipsoid", "m"),
            figure(4, "Speed over ground", "m/s"),
        ];
        let (angles, enu) = (["roll", "pitch", "heading"], EAST_NORTH_UP);
        let attitude = |sigma: &SolutionSigma, s: &Solution| {
            let [roll, pitch, heading, ..] = sigmas(sigma, s);
            [roll, pitch, heading]
        };
        figures.extend([
            self.one_sigma("attitude", "deg", angles, attitude),
            self.one_sigma("position", "m", enu, |sigma, _| sigma.position_m.into()),
            self.one_sigma("velocity", "m/s", enu, |sigma, _| sigma.velocity_mps.into()),
        ]);
        figures
    }

    /// Three sigmas of the solution.
    fn one_sigma(
        &self,
        of: &str,
        unit: &str,
        names: [&str; 3],
        three: impl Fn(&SolutionSigma, &Solution) -> [f64; 3],
    ) -> Figure {
        let sigmas = |row: &Row| Some(three(&row.sigma?, &row.solution?));
        let rows: Vec<(f64, [f64; 3])> = self.rows(sigmas).collect();
        let curve = |axis: usize| thinned(rows.iter().map(|(t, sigmas)| (*t, sigmas[axis])));
        let values = rows.iter().flat_map(|(_, sigmas)| *sigmas);
        let chart = self.over_time(format!("One sigma of {of}"), unit);
        three_lines(chart.logarithmic_y(values), names, &[0, 1, 2].map(curve)).figure()
    }

    /// Each component of the fixes against the solution at its time.
    fn innovations(&self) -> Vec<Figure> {
        type Component = fn(&Innovation) -> [Option<Residual>; 3];
        let kinds: [(&str, &str, Component); 2] = [
            ("Velocity", "m/s", |i| i.velocity_mps),
            ("Position", "m", |i| i.position_m),
        ];
        let mut figures = Vec::new();
        for (quantity, unit, component) in kinds {
            for (axis, direction) in EAST_NORTH_UP.into_iter().enumerate() {
                let residuals: Vec<(f64, Residual)> = (self.found.innovations.iter())
                    .filter_map(|i| Some((self.since(i.time), component(i)[axis]?)))
                    .collect();
                // 1 if the innovations agree with their expected sigma.
                let ratio = rms_of_any(residuals.iter().map(|(_, r)| r.value / r.sigma));
                let Some(ratio) = ratio else {
                    continue;
                };
                let sigmas: Vec<Point> = residuals.iter().map(|(t, r)| (*t, r.sigma)).collect();
                let values: Vec<f64> = residuals.iter().map(|(_, r)| r.value).collect();
                let curve = thinned(residuals.iter().map(|(t, r)| (*t, r.value)));
                let chart = self
                    .over_time(format!("{quantity}, {direction}"), unit)
                    .note(format!("RMS over expectation: {ratio:.2}"))
                    .noise("GNSS minus solution", COLOURS[axis], &curve)
                    .expected("expected, one sigma", RED, &sampled(&sigmas, MOST_POINTS))
                    .range(inner_range(values));
                figures.push(chart.figure());
            }
        }
        figures
    }

    /// Intervals between stamps, refused fixes, and the latency over time.
    fn stamps(&self) -> Vec<Figure> {
        let log = &self.analysis.log;
        let step = |from: Time, to: Time| (self.since(to), to.seconds_since(from).max(1e-6));
        let fixes = &self.found.fixes;
        let fix_steps: Vec<Point> = (fixes.windows(2))
            .map(|pair| step(pair[0].0, pair[1].0))
            .collect();
        let refused: Vec<(Point, String)> = (fixes.iter())
            .filter(|(_, outcome)| !is_used(*outcome))
            .map(|(time, outcome)| {
                let time_s = self.since(*time);
                let next = fix_steps.partition_point(|step| step.0 < time_s);
                let next = fix_steps.get(next).or(fix_steps.last());
                let text = format!("{time_s:.1} s: {}", of_fix(*outcome));
                ((time_s, next.map_or(1.0, |step| step.1)), text)
            })
            .collect();
        let chart = self
            .over_time("Interval between fixes", "s")
            .note(format!(
                "{} used, {} refused",
                fixes.len() - refused.len(),
                refused.len()
            ))
            .line("interval", BLUE, &thinned(fix_steps.iter().copied()))
            .logarithmic_y(fix_steps.iter().map(|step| step.1))
            .marks("refused", RED, "x", &sampled(&refused, MAX_REFUSED));
        let mut sample_steps = Thinner::new(log.imu.len().saturating_sub(1));
        for [last, sample] in log.imu.pairs() {
            sample_steps.push(step(last.time, sample.time));
        }
        let sample_steps = sample_steps.finish();
        let samples = self
            .over_time("Interval between inertial samples", "s")
            .line("interval", BLUE, &sample_steps)
            .logarithmic_y(sample_steps.iter().map(|step| step.1));
        let now = |row: &Row| {
            let now = &row.estimates.gnss_latency_now_s;
            Some(latency_of_log(now, &log.meta))
        };
        let latency = EstimateHistory::new(
            "GNSS latency at the moment".to_owned(),
            "ms",
            self.rows(now),
        );
        let latency = latency.figure(self.duration_s);
        vec![chart.figure(), samples.figure(), latency]
    }

    /// Gyros and accelerometers in the axes of the log.
    fn sensors(&self) -> Vec<Figure> {
        let log = &self.analysis.log;
        let curve = || Thinner::new(log.imu.len().saturating_sub(1));
        let [mut gyros, mut accels] = [0, 1].map(|_| [0, 1, 2].map(|_| curve()));
        // A gap narrower than a point is not visible.
        let visible_s = MAX_GAP_S.max(self.duration_s / MOST_POINTS as f64);
        for [last, sample] in log.imu.pairs() {
            let seconds = sample.time.seconds_since(last.time);
            if seconds > visible_s {
                gyros.iter_mut().chain(&mut accels).for_each(Thinner::cut);
            }
            let factor = log.meta.imu.per_rate(seconds);
            let per_second = factor.recip();
            let time_s = self.since(sample.time);
            let gyro = self
                .axes
                .from_rfu(sample.gyro * 1_f64.to_degrees() * per_second);
            let accel = self.axes.from_rfu(sample.accel * per_second);
            for axis in 0..3 {
                gyros[axis].push((time_s, gyro[axis]));
                accels[axis].push((time_s, accel[axis]));
            }
        }
        let names = [0, 1, 2].map(|axis| axis_name(axis, self.axes));
        let names = names.each_ref().map(String::as_str);
        let figure = |title, unit, curves: [Thinner; 3]| {
            let chart = self.over_time(title, unit);
            three_lines(chart, names, &curves.map(Thinner::finish)).figure()
        };
        vec![
            figure("Gyros", "deg/s", gyros),
            figure("Accelerometers", "m/s\u{b2}", accels),
        ]
    }

    /// The corrections f^C and omega^C, and the velocity difference that they are computed from.
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
        let figure = |(title, unit, scale, signal): (&str, &str, f64, Signal)| {
            let curves: [Vec<Point>; 3] = [0, 1, 2].map(|axis| {
                let value = |row: &Row| Some(signal(row)[axis] / scale);
                self.rows(value).collect()
            });
            let values = curves.iter().flatten().map(|point| point.1).collect();
            let mut chart = self.over_time(title, unit).range(inner_range(values));
            for ((name, colour), curve) in EAST_NORTH_UP.into_iter().zip(COLOURS).zip(&curves) {
                chart = chart.noise(name, colour, &thinned(curve.iter().copied()));
            }
            chart.figure()
        };
        kinds.into_iter().map(figure).collect()
    }
}

/// Allan deviations, and the identified white noise.
pub(super) fn allan_figures(sensors: &Sensors) -> Vec<Figure> {
    let (model, at_rest) = (sensors.model.model(), sensors.at_rest);
    let figure = |title, unit, points: &[allan::Point], noise: f64| {
        let line = |value: &dyn Fn(&allan::Point) -> f64| -> Vec<Point> {
            points.iter().map(|p| (p.tau_s, value(p))).collect()
        };
        let deviations = points.iter().flat_map(|p| p.deviation);
        let chart = Chart::new(title, "cluster time, s", unit)
            .logarithmic_x(points.iter().map(|p| p.tau_s))
            .logarithmic_y(deviations.map(|sigma| sigma.value));
        let curves = [0, 1, 2].map(|axis| line(&|p| p.deviation[axis].value));
        let white = line(&|p| noise / p.tau_s.sqrt());
        three_lines(chart, ["right", "forward", "up"], &curves)
            .reference("white noise found", RED, &white)
            .figure()
    };
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

fn three_lines(mut chart: Chart, names: [&str; 3], curves: &[Vec<Point>; 3]) -> Chart {
    for ((name, colour), curve) in names.into_iter().zip(COLOURS).zip(curves) {
        chart = chart.line(name, colour, curve);
    }
    chart
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
    // East and north rotated to along and across a direction; their correlation is not known.
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

/// The curve of an angle, broken where it wraps at north or at 180 deg.
fn wrapped(points: &[SigmaPoint]) -> Vec<SigmaPoint> {
    let mut broken = Vec::with_capacity(points.len());
    for (index, point) in points.iter().enumerate() {
        if index > 0 && (point.1 - points[index - 1].1).abs() > 180.0 {
            broken.push((point.0, f64::NAN, f64::NAN));
        }
        broken.push(*point);
    }
    broken
}

/// Range of the axis without outliers, such as those of the start.
fn inner_range(mut values: Vec<f64>) -> Point {
    values.sort_by(f64::total_cmp);
    let part = values.len() / 200;
    let (low, high) = padded(values[part..values.len() - part].iter().copied(), 1e-3);
    (low.min(-high), high.max(-low))
}

/// Longitude and latitude, deg.
fn lon_lat(position: &Geodetic) -> Point {
    (
        position.longitude_rad.to_degrees(),
        position.latitude_rad.to_degrees(),
    )
}

/// The track pieces of one manoeuvre, each up to the start of the next, with breaks between.
fn pieces(rows: &[(Manoeuvre, Point)], which: Manoeuvre) -> Vec<Point> {
    let mut points = Vec::new();
    for pair in rows.windows(2) {
        if pair[0].0 == which {
            points.push(pair[0].1);
            if pair[1].0 != which {
                points.extend([pair[1].1, BREAK]);
            }
        }
    }
    points
}
