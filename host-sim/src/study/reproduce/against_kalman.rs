//! Figures 3 and 4, 6 and 7: estimates over a drive by compensation and by a Kalman filter.

use std::fmt::Write as _;

use indicatif::ProgressBar;
use ins_core::config::Config;
use ins_core::earth::wrap_pi;
use ins_core::{ConfigError, Solution, Time};
use miette::{Result, miette};
use nalgebra::Vector3;
use plotters::style::RGBColor;
use rayon::prelude::*;

use super::drive::{Drive, log_of, open};
use super::part::{GRADE, Number, Part, Settings, here};
use crate::compare::kalman::Noise;
use crate::compare::tracks::{Input, Point, kalman, noise, points};
use crate::identify::against_truth::truth_at;
use crate::identify::configure;
use crate::identify::quantities::DEG_H_RADPS;
use crate::identify::run::record;
use crate::log::Log;
use crate::page::chart::sampled;
use crate::page::plot::{BLUE, Mark, ORANGE, RED, padded};
use crate::page::sheet::{self, Key, Panel};
use crate::sim::errors::BiasModel;
use crate::sim::{DriveConfig, simulate};
use crate::statistics::rms;

/// Points of a curve in a drawing.
const MOST_POINTS: usize = 400;
const METHODS: [&str; 2] = ["compensation", "Kalman filter"];
/// Bias drift of the gyros of Figures 6 and 7, (3): possible for a ring laser of 1 deg/h in an hour, and large
/// compared with its random walk.
const WAVE: BiasModel = BiasModel::Wave {
    initial_sigma: 1.0,
    interval_s: 1200.0,
    jump_mean: 0.0,
    jump_sigma: 1.0,
};

#[derive(Clone, Debug)]
pub struct Recorded {
    pub name: String,
    pub log: Log,
}

/// An estimate at a time since the first sample, in the unit of its figure.
#[derive(Clone)]
struct TrackPoint {
    time_s: f64,
    value: f64,
    sigma: f64,
    truth: Option<f64>,
}

/// A quantity over a drive as estimated by each of [`METHODS`].
type Tracks = [Vec<TrackPoint>; 2];

/// Both methods over a drive.
struct Run<'a> {
    log: &'a Log,
    /// Heading of the damped INS without feedback after each sample, compensated for a constant bias of the up
    /// gyro: with consumer gyros it would rotate.
    open_heading_rad: Vec<(Time, f64)>,
    tracks: [Vec<Point>; 2],
}

impl<'a> Run<'a> {
    fn new(log: &'a Log, config: Config, noise: Noise) -> Result<Self, ConfigError> {
        let (core, end) = record(log, config, &ProgressBar::hidden(), |_, _| {})?;
        let drift_radps = end.estimates.gyro_bias_radps[2].value;
        let first = log.start();
        let mut open_heading_rad = Vec::new();
        record(log, open(config), &ProgressBar::hidden(), |ins, time| {
            let drift_rad = drift_radps * time.seconds_since(first);
            let open_heading =
                |solution: Solution| (time, solution.euler().heading_rad + drift_rad);
            open_heading_rad.extend(ins.solution().map(open_heading));
        })?;
        let input = Input {
            log,
            config,
            noise,
            truth: None,
        };
        let filter = kalman(METHODS[1], noise, &input)?;
        Ok(Self {
            log,
            open_heading_rad,
            tracks: [points(&core.history, &end), filter.points],
        })
    }

    fn tracks_of(&self, value: impl Fn(&Point, f64) -> Option<TrackPoint>) -> Tracks {
        let first = self.log.start();
        self.tracks.each_ref().map(|track| {
            let value = |point| value(point, point.time.seconds_since(first));
            track.iter().filter_map(value).collect()
        })
    }

    /// Error of the heading without feedback, deg.
    fn azimuth(&self) -> Tracks {
        self.tracks_of(|point, time_s| {
            let time_of = |open_heading: &(Time, f64)| open_heading.0;
            let at = self
                .open_heading_rad
                .binary_search_by_key(&point.time, time_of)
                .ok()?;
            let error_deg = |true_: &Solution| {
                wrap_pi(self.open_heading_rad[at].1 - true_.euler().heading_rad).to_degrees()
            };
            Some(TrackPoint {
                time_s,
                value: error_deg(&point.solution),
                sigma: point.estimates.azimuth_error_rad.sigma.to_degrees(),
                truth: truth_at(&self.log.truth, point.time).map(|truth| error_deg(&truth)),
            })
        })
    }

    /// Bias of a level gyro, deg/h; the truth, if known, is that of the sample before: a jump at the last sample
    /// of a drive is not observable.
    fn gyro(&self, axis: usize, truth: &[Vector3<f64>]) -> Tracks {
        self.tracks_of(|point, time_s| {
            let bias = &point.estimates.gyro_bias_radps[axis];
            let samples = self.log.imu.all();
            let at = samples.partition_point(|sample| sample.time < point.time);
            Some(TrackPoint {
                time_s,
                value: bias.value / DEG_H_RADPS,
                sigma: bias.sigma / DEG_H_RADPS,
                truth: truth
                    .get(at.saturating_sub(1))
                    .map(|truth| truth[axis] / DEG_H_RADPS),
            })
        })
    }
}

/// Two figures of the thesis side by side.
struct Pair {
    name: &'static str,
    numbers: [u8; 2],
    title: String,
    unit: &'static str,
    /// Colours of the curves, and what these are.
    lines: Vec<Key>,
}

pub(super) fn figures_3_and_4(drives: &[Drive]) -> Result<Part, ConfigError> {
    let noise = Noise::of_model(&GRADE.errors());
    let courses = drives.par_iter().map(|drive| {
        let run = Run::new(&drive.log, drive.config, noise)?;
        Ok(vec![run.azimuth()])
    });
    let courses = courses.collect::<Result<Vec<_>, ConfigError>>()?;
    let how = format!(
        "Azimuth error of the damped INS, to which nothing is fed back, its up gyro compensated by \
         a constant; on {} drives, the first is drawn. {SETUP} Figure 5 is the check: what the \
         azimuth does to an INS that is let go, before and after.",
        drives.len()
    );
    Ok(azimuth_pair("figures-3-4", "").part(how, &courses))
}

pub(super) fn figures_6_and_7(settings: &Settings) -> Result<Part, ConfigError> {
    let courses = (settings.seeds(settings.drives).into_par_iter())
        .map(|seed| {
            let mut plan = DriveConfig::new(seed, GRADE, settings.minutes);
            plan.recording.errors.gyro_deg_h.bias = WAVE;
            plan.recording.truth_every = 1;
            let noise = Noise::of_model(&plan.recording.errors);
            let drive = simulate(&plan);
            // The bias of each increment is that at its end.
            let truth: Vec<_> = drive.biases.iter().skip(1).map(|[gyro, _]| *gyro).collect();
            let (log, mut config) = log_of(drive);
            config.sensors.gyro_bias_walk = noise.sensors.gyro_bias_walk;
            let run = Run::new(&log, config, noise)?;
            Ok([0, 1].map(|axis| run.gyro(axis, &truth)).into())
        })
        .collect::<Result<Vec<Vec<Tracks>>, ConfigError>>()?;
    let how = format!(
        "Biases of the level gyros on {} drives, jumping by 1 deg/h every 20 min: the wave model \
         (3); the first is drawn. {SETUP} Jumps are told as a walk of the same rate.",
        courses.len()
    );
    Ok(gyro_pair("figures-6-7", "").part(how, &courses))
}

/// Both pairs of figures on a recorded drive.
pub(super) fn recorded(drive: &Recorded) -> Result<[Part; 2]> {
    let grade = configure::grade(&drive.log, None);
    let config = configure::config(&drive.log, grade);
    let run = Run::new(&drive.log, config, noise(grade, &config, false))
        .map_err(|error| miette!("{} cannot be used: {}", drive.name, error))?;
    if run.tracks.iter().any(Vec::is_empty) {
        return Err(miette!(
            help = "see what `identify` says of it",
            "{}: navigation never begins, nothing to draw",
            drive.name
        ));
    }
    let how = "A recorded drive; both methods are told what is typical of the class of its sensors \
               and begin from the same alignment. Shaded: one sigma.";
    let on = format!(" on {}", drive.name);
    let azimuth = azimuth_pair("figures-3-4-recorded", &on);
    let gyros = gyro_pair("figures-6-7-recorded", &on);
    Ok([
        azimuth.part(how.to_owned(), &[vec![run.azimuth()]]),
        gyros.part(
            how.to_owned(),
            &[[0, 1].map(|axis| run.gyro(axis, &[])).into()],
        ),
    ])
}

const SETUP: &str = "Both methods are told the true noises and begin from the same alignment. \
                    Shaded: one sigma. RMS errors are those of the second half.";

fn azimuth_pair(name: &'static str, on: &str) -> Pair {
    Pair {
        name,
        numbers: [3, 4],
        title: format!("Figures 3 and 4{on}: azimuth error, as each method finds it"),
        unit: "deg",
        lines: vec![(BLUE, "azimuth")],
    }
}

fn gyro_pair(name: &'static str, on: &str) -> Pair {
    Pair {
        name,
        numbers: [6, 7],
        title: format!("Figures 6 and 7{on}: biases of the level gyros, as each method finds them"),
        unit: "deg/h",
        lines: vec![(BLUE, "gyro right"), (ORANGE, "gyro forward")],
    }
}

impl Pair {
    /// Of one or several drives, each with tracks of every line.
    fn part(self, how: String, drives: &[Vec<Tracks>]) -> Part {
        let first = drives.first().map_or(&[][..], Vec::as_slice);
        let known = first.iter().flatten().flatten();
        let mut known = known.map(|point| point.truth.is_some());
        Part {
            name: self.name,
            numbers: if known.any(|known| known) {
                self.errors(drives)
            } else {
                self.differences(first)
            },
            svg: Some(self.picture(first)),
            csv: self.csv(first),
            title: self.title,
            how,
        }
    }

    /// Against the truth.
    fn errors(&self, drives: &[Vec<Tracks>]) -> Vec<Number> {
        let (mut numbers, mut worst) = (Vec::new(), [0.0; 2]);
        for (which, (_, line)) in self.lines.iter().enumerate() {
            let courses = || drives.iter().map(|courses| &courses[which]);
            let error = |point: &TrackPoint| Some(point.value - point.truth?);
            let rms = [0, 1].map(|method| {
                let settled = courses().flat_map(|tracks| second_half(&tracks[method]));
                rms(settled.filter_map(error))
            });
            for (method, worst) in worst.iter_mut().enumerate() {
                let end = courses().filter_map(|tracks| tracks[method].last());
                let sigmas = end.filter_map(|point| Some(error(point)?.abs() / point.sigma));
                *worst = sigmas.fold(*worst, f64::max);
            }
            let what = |method: &str| format!("{line}, {method}, {} RMS", self.unit);
            numbers.push(here(what(METHODS[0]), rms[0]));
            numbers.push(here(what(METHODS[1]), rms[1]));
            let what = format!("{line}, compensation / Kalman filter");
            numbers.push(here(what, rms[0] / rms[1]));
        }
        for (method, worst) in METHODS.into_iter().zip(worst) {
            numbers.push(here(
                format!("{method}, largest error at an end, sigmas"),
                worst,
            ));
        }
        numbers
    }

    /// Of the two methods, without the truth.
    fn differences(&self, courses: &[Tracks]) -> Vec<Number> {
        let mut numbers = Vec::new();
        for ((_, line), [core, filter]) in self.lines.iter().zip(courses) {
            for (method, track) in METHODS.into_iter().zip([core, filter]) {
                if let Some(end) = track.last() {
                    let what = format!("{line} at the end, {method}, {}", self.unit);
                    numbers.push(here(what, end.value));
                    numbers.push(here(format!("its sigma, {}", self.unit), end.sigma));
                }
            }
            let difference = second_half(core).filter_map(|core| {
                let next = filter.partition_point(|filter| filter.time_s < core.time_s);
                Some(core.value - filter.get(next)?.value)
            });
            let what = format!("{line}, difference over the second half, {} RMS", self.unit);
            numbers.push(here(what, rms(difference)));
        }
        numbers
    }

    fn picture(&self, courses: &[Tracks]) -> String {
        let all = || courses.iter().flatten();
        let end_s = all()
            .flatten()
            .fold(1.0, |end, point| f64::max(end, point.time_s));
        let settled = all().flat_map(|track| track.iter().skip(track.len() / 20));
        let y = settled.flat_map(|point| {
            let band = [point.value - point.sigma, point.value + point.sigma];
            band.into_iter().chain(point.truth)
        });
        let y = padded(y, 1e-2);
        let mut keys = self.lines.clone();
        if all().flatten().any(|point| point.truth.is_some()) {
            keys.push((RED, "truth"));
        }
        let panel = |method: usize| {
            let marks = self.lines.iter().zip(courses);
            let marks = marks.flat_map(|((colour, _), tracks)| marks_of(&tracks[method], *colour));
            let labels = ["time, s", self.unit];
            let plot = sheet::plot(labels, (0.0, end_s), y, marks.collect());
            Panel {
                title: format!("Figure {}: {}", self.numbers[method], METHODS[method]),
                svg: plot.svg(),
                keys: Vec::new(),
            }
        };
        let mut panels = [panel(0), panel(1)];
        panels[0].keys = keys;
        sheet::svg(&panels)
    }

    fn csv(&self, courses: &[Tracks]) -> String {
        let mut text = "quantity,method,time_s,value,sigma,truth\n".to_owned();
        for ((_, line), tracks) in self.lines.iter().zip(courses) {
            for (method, track) in METHODS.into_iter().zip(tracks) {
                for point in track {
                    let truth = point
                        .truth
                        .map_or(String::new(), |truth| format!("{truth:.6}"));
                    // Writing into a string cannot fail.
                    let _ = writeln!(
                        text,
                        "{line},{method},{:.3},{:.6},{:.6},{truth}",
                        point.time_s, point.value, point.sigma
                    );
                }
            }
        }
        text
    }
}

fn second_half(track: &[TrackPoint]) -> impl Iterator<Item = &TrackPoint> {
    track.iter().skip(track.len() / 2)
}

/// Band, line and truth, from back to front.
fn marks_of(track: &[TrackPoint], colour: RGBColor) -> [Mark; 3] {
    let track = sampled(track, MOST_POINTS);
    let points = || track.iter();
    let band = points().map(|at| (at.time_s, at.value - at.sigma, at.value + at.sigma));
    let line = points().map(|at| (at.time_s, at.value));
    let truth = points().filter_map(|at| Some((at.time_s, at.truth?)));
    [
        Mark::Band(band.collect(), colour),
        Mark::Line(line.collect(), colour),
        Mark::Reference(truth.collect(), RED),
    ]
}
