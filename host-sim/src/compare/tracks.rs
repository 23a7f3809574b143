//! Every method over the log, sampled once a second and at the last sample.

use indicatif::ProgressBar;
use ins_core::config::Form;
use ins_core::{Config, ConfigError, Estimates, Solution, Time};

use crate::compare::five_stage;
use crate::compare::kalman::{Filter, Noise, Record, Run, smooth};
use crate::identify::row::{self, Row};
use crate::identify::run::identify;
use crate::identify::true_errors::Truth;
use crate::log::{Grade, Log};

/// Interval between points, s.
const INTERVAL_S: f64 = 1.0;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Input<'a> {
    pub(crate) log: &'a Log,
    pub(crate) config: Config,
    pub(crate) noise: Noise,
    pub(crate) truth: Option<&'a Truth>,
}

/// Noise model of the filter: for a simulated log that of its sensor class.
pub(crate) fn noise(grade: Grade, config: &Config, simulated: bool) -> Noise {
    if simulated {
        Noise::of_model(&grade.errors())
    } else {
        Noise::of_config(config)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    pub time: Time,
    /// Biases and latency; of the azimuth only the sigma, which is that of the heading.
    pub estimates: Estimates,
    pub solution: Solution,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    pub method: String,
    /// Whether the estimates are available in real time, not only at the end of the log.
    pub online: bool,
    pub points: Vec<Point>,
}

impl Track {
    fn new(method: &str, online: bool, points: Vec<Point>) -> Self {
        Self {
            method: method.to_owned(),
            online,
            points,
        }
    }
}

pub fn all(input: &Input) -> Result<Vec<Track>, ConfigError> {
    let label = if input.truth.is_some() {
        "noise of the class"
    } else {
        "noise as configured"
    };
    let mut tracks = vec![
        compensation("compensation, exact", Form::Exact, input)?,
        compensation("compensation, literal", Form::Literal, input)?,
        five_stage("five stages", five_stage::PUBLISHED, input)?,
        five_stage("five stages, repeated", five_stage::REPEATED, input)?,
    ];
    tracks.extend(kalman_and_smoother(label, input)?);
    for (method, factor) in [("Kalman, noise / 3", 1.0 / 3.0), ("Kalman, noise x 3", 3.0)] {
        tracks.push(kalman(method, input.noise.scaled(factor), input)?);
    }
    Ok(tracks)
}

fn compensation(method: &str, form: Form, input: &Input) -> Result<Track, ConfigError> {
    let config = Config {
        form,
        ..input.config
    };
    let found = identify(input.log, config, &ProgressBar::hidden())?;
    Ok(Track::new(method, true, points(&found.history, &found.end)))
}

/// The core's rows, from the start of navigation to the last sample.
pub(crate) fn points(history: &[Row], end: &Row) -> Vec<Point> {
    let point = |row: &Row| {
        Some(Point {
            time: row.time,
            estimates: row.estimates,
            solution: row.solution?,
        })
    };
    let mut points = history.iter().filter_map(point).collect();
    add_end(&mut points, point(end));
    points
}

/// Adds the last sample: all methods are compared at one time, though their seconds start differently.
fn add_end(points: &mut Vec<Point>, end: Option<Point>) {
    let last = points.last().map(|last| last.time);
    points.extend(end.filter(|end| last.is_none_or(|last| last < end.time)));
}

/// Navigation with all errors corrected that the stages have found.
pub(crate) fn five_stage(method: &str, rounds: usize, input: &Input) -> Result<Track, ConfigError> {
    let found = five_stage::run(input.log, input.config, rounds)?;
    let mut points = points(&found.history, &found.end);
    for point in &mut points {
        point.estimates = Estimates {
            azimuth_error_rad: point.estimates.azimuth_error_rad,
            ..found.estimates
        };
    }
    Ok(Track::new(method, false, points))
}

pub(crate) fn kalman(method: &str, noise: Noise, input: &Input) -> Result<Track, ConfigError> {
    let imu = input.log.imu.all();
    let mut run = Run::new(&imu, &input.log.gnss, input.config, noise)?;
    let mut points = Vec::new();
    while let Some(time) = run.step(&mut |_, _| {}) {
        if let Some(filter) = run.filter().filter(|_| due(&points, time)) {
            points.push(filtered(filter));
        }
    }
    add_end(&mut points, run.filter().map(filtered));
    Ok(Track::new(method, true, points))
}

/// Both from one run; the smoother follows the last alignment.
fn kalman_and_smoother(label: &str, input: &Input) -> Result<[Track; 2], ConfigError> {
    let noise = input.noise;
    let imu = input.log.imu.all();
    let mut run = Run::new(&imu, &input.log.gnss, input.config, noise)?;
    let (mut points, mut records) = (Vec::new(), Vec::new());
    loop {
        let aligned = run.filter().is_some();
        let step = run.step(&mut |filter, correction| {
            records.push(Record::new(filter, correction));
        });
        let Some(time) = step else { break };
        match run.filter() {
            Some(filter) if due(&points, time) => points.push(filtered(filter)),
            None if aligned => records.clear(),
            _ => {}
        }
    }
    let mut smoothed: Vec<Point> = Vec::new();
    for at in smooth(&records, &noise) {
        if due(&smoothed, at.time) {
            smoothed.push(Point {
                time: at.time,
                estimates: at.estimates,
                solution: at.nominal.solution(at.time),
            });
        }
    }
    // At the last sample filter and smoother are the same.
    for track in [&mut points, &mut smoothed] {
        add_end(track, run.filter().map(filtered));
    }
    Ok([
        Track::new(&format!("Kalman, {label}"), true, points),
        Track::new("its smoother", false, smoothed),
    ])
}

fn due(points: &[Point], time: Time) -> bool {
    row::due(points.last().map(|last| last.time), time, INTERVAL_S)
}

fn filtered(filter: &Filter) -> Point {
    Point {
        time: filter.time,
        estimates: filter.estimates(),
        solution: filter.solution(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::configure;
    use crate::log::BodyAxes;
    use crate::sim::{DriveConfig, simulate};

    #[test]
    fn all_methods_end_at_the_last_sample() {
        let drive = DriveConfig::new(3, Grade::Hg1700, 6.0);
        let output = drive.recording.errors.imu.output;
        let mut log = simulate(&drive).into_log(BodyAxes::Rfu, output);
        // A log seldom ends with a fix, nor after whole seconds.
        let end = log.imu.last().map(|sample| sample.time).unwrap_or_default();
        log.gnss.retain(|fix| end.seconds_since(fix.time) > 0.7);
        let grade = configure::grade(&log, None);
        let config = configure::config(&log, grade);
        let input = Input {
            log: &log,
            config,
            noise: noise(grade, &config, false),
            truth: None,
        };
        for track in all(&input).unwrap() {
            let last = track.points.last().unwrap();
            let late_s = end.seconds_since(last.time);
            assert!(
                late_s.abs() < 0.02,
                "{}: {late_s} s before the end",
                track.method
            );
            assert_eq!(last.time, last.solution.time, "{}", track.method);
        }
    }
}
