//! Figures 3 and 4, 6 and 7: what compensation finds over a drive beside what a Kalman filter finds.

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
/// Drift of the gyros of Figures 6 and 7, (3): what a ring laser of 1 deg/h may do in an hour, and
/// large enough to stand out of its random walk.
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
struct Seen {
    time_s: f64,
    value: f64,
    sigma: f64,
    truth: Option<f64>,
}

/// A quantity over a drive as each of [`METHODS`] finds it.
type Course = [Vec<Seen>; 2];

/// Both methods over a drive.
struct Run<'a> {
    log: &'a Log,
    /// Heading of the damped INS after each sample, to which nothing is fed back, less what a
    /// constant bias of its up gyro makes of it: consumer gyros would turn it round and round.
    kept_rad: Vec<(Time, f64)>,
    tracks: [Vec<Point>; 2],
}

impl<'a> Run<'a> {
    fn new(log: &'a Log, config: Config, noise: Noise) -> Result<Self, ConfigError> {
        let (core, end) = record(log, config, &ProgressBar::hidden(), |_, _| {})?;
        let drift_radps = end.estimates.gyro_bias_radps[2].value;
        let first = log.start();
        let mut kept_rad = Vec::new();
        record(log, open(config), &ProgressBar::hidden(), |ins, time| {
            let turned_rad = drift_radps * time.seconds_since(first);
            let kept = |solution: Solution| (time, solution.euler().heading_rad + turned_rad);
            kept_rad.extend(ins.solution().map(kept));
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
            kept_rad,
            tracks: [points(&core.history, &end), filter.points],
        })
    }

    fn course(&self, seen: impl Fn(&Point, f64) -> Option<Seen>) -> Course {
        let first = self.log.start();
        self.tracks.each_ref().map(|track| {
            let seen = |point| seen(point, point.time.seconds_since(first));
            track.iter().filter_map(seen).collect()
        })
    }

    /// Error of the kept heading, deg.
    fn azimuth(&self) -> Course {
        self.course(|point, time_s| {
            let find = |kept: &(Time, f64)| kept.0;
            let at = self.kept_rad.binary_search_by_key(&point.time, find).ok()?;
            let off = |true_: &Solution| {
                wrap_pi(self.kept_rad[at].1 - true_.euler().heading_rad).to_degrees()
            };
            Some(Seen {
                time_s,
                value: off(&point.solution),
                sigma: point.estimates.azimuth_error_rad.sigma.to_degrees(),
                truth: truth_at(&self.log.truth, point.time).map(|truth| off(&truth)),
            })
        })
    }

    /// Bias of a level gyro, deg/h; the truth is that of the sample before, if it is known: a jump with the
    /// last one of a drive nobody has seen.
    fn gyro(&self, axis: usize, truth: &[Vector3<f64>]) -> Course {
        self.course(|point, time_s| {
            let bias = &point.estimates.gyro_bias_radps[axis];
            let samples = self.log.imu.all();
            let at = samples.partition_point(|sample| sample.time < point.time);
            Some(Seen {
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
         a constant; on {} drives, the first is drawn. {TOLD} Figure 5 is the check: what the \
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
            // Of each increment that at its end.
            let truth: Vec<_> = drive.biases.iter().skip(1).map(|[gyro, _]| *gyro).collect();
            let (log, mut config) = log_of(drive);
            config.sensors.gyro_bias_walk = noise.sensors.gyro_bias_walk;
            let run = Run::new(&log, config, noise)?;
            Ok([0, 1].map(|axis| run.gyro(axis, &truth)).into())
        })
        .collect::<Result<Vec<Vec<Course>>, ConfigError>>()?;
    let how = format!(
        "Biases of the level gyros on {} drives, jumping by 1 deg/h every 20 min: the wave model \
         (3); the first is drawn. {TOLD} Jumps are told as a walk of the same rate.",
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

const TOLD: &str = "Both methods are told the true noises and begin from the same alignment. \
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
    /// Of one or several drives, each with a course of every line.
    fn part(self, how: String, drives: &[Vec<Course>]) -> Part {
        let first = drives.first().map_or(&[][..], Vec::as_slice);
        let known = first.iter().flatten().flatten();
        let mut known = known.map(|seen| seen.truth.is_some());
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
    fn errors(&self, drives: &[Vec<Course>]) -> Vec<Number> {
        let (mut numbers, mut worst) = (Vec::new(), [0.0; 2]);
        for (which, (_, line)) in self.lines.iter().enumerate() {
            let courses = || drives.iter().map(|courses| &courses[which]);
            let error = |seen: &Seen| Some(seen.value - seen.truth?);
            let rms = [0, 1].map(|method| {
                let settled = courses().flat_map(|course| second_half(&course[method]));
                rms(settled.filter_map(error))
            });
            for (method, worst) in worst.iter_mut().enumerate() {
                let end = courses().filter_map(|course| course[method].last());
                let sigmas = end.filter_map(|seen| Some(error(seen)?.abs() / seen.sigma));
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

    /// Of the two methods, where nobody knows the truth.
    fn differences(&self, courses: &[Course]) -> Vec<Number> {
        let mut numbers = Vec::new();
        for ((_, line), [ours, theirs]) in self.lines.iter().zip(courses) {
            for (method, track) in METHODS.into_iter().zip([ours, theirs]) {
                if let Some(end) = track.last() {
                    let what = format!("{line} at the end, {method}, {}", self.unit);
                    numbers.push(here(what, end.value));
                    numbers.push(here(format!("its sigma, {}", self.unit), end.sigma));
                }
            }
            let apart = second_half(ours).filter_map(|ours| {
                let next = theirs.partition_point(|theirs| theirs.time_s < ours.time_s);
                Some(ours.value - theirs.get(next)?.value)
            });
            let what = format!("{line}, difference over the second half, {} RMS", self.unit);
            numbers.push(here(what, rms(apart)));
        }
        numbers
    }

    fn picture(&self, courses: &[Course]) -> String {
        let all = || courses.iter().flatten();
        let end_s = all()
            .flatten()
            .fold(1.0, |end, seen| f64::max(end, seen.time_s));
        let settled = all().flat_map(|track| track.iter().skip(track.len() / 20));
        let y = settled.flat_map(|seen| {
            let band = [seen.value - seen.sigma, seen.value + seen.sigma];
            band.into_iter().chain(seen.truth)
        });
        let y = padded(y, 1e-2);
        let mut keys = self.lines.clone();
        if all().flatten().any(|seen| seen.truth.is_some()) {
            keys.push((RED, "truth"));
        }
        let panel = |method: usize| {
            let marks = self.lines.iter().zip(courses);
            let marks = marks.flat_map(|((colour, _), course)| marks_of(&course[method], *colour));
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

    fn csv(&self, courses: &[Course]) -> String {
        let mut text = "quantity,method,time_s,value,sigma,truth\n".to_owned();
        for ((_, line), course) in self.lines.iter().zip(courses) {
            for (method, track) in METHODS.into_iter().zip(course) {
                for seen in track {
                    let truth = seen
                        .truth
                        .map_or(String::new(), |truth| format!("{truth:.6}"));
                    // Writing into a string cannot fail.
                    let _ = writeln!(
                        text,
                        "{line},{method},{:.3},{:.6},{:.6},{truth}",
                        seen.time_s, seen.value, seen.sigma
                    );
                }
            }
        }
        text
    }
}

fn second_half(track: &[Seen]) -> impl Iterator<Item = &Seen> {
    track.iter().skip(track.len() / 2)
}

/// Band, line and truth, from back to front.
fn marks_of(track: &[Seen], colour: RGBColor) -> [Mark; 3] {
    let track = sampled(track, MOST_POINTS);
    let seen = || track.iter();
    let band = seen().map(|at| (at.time_s, at.value - at.sigma, at.value + at.sigma));
    let line = seen().map(|at| (at.time_s, at.value));
    let truth = seen().filter_map(|at| Some((at.time_s, at.truth?)));
    [
        Mark::Band(band.collect(), colour),
        Mark::Line(line.collect(), colour),
        Mark::Reference(truth.collect(), RED),
    ]
}
