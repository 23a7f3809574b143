//! Validation of the estimates: velocity error of a free INS, without and with them.

use ins_core::increments::{Increments, Interval};
use ins_core::mechanization::{Controls, Mechanization};
use ins_core::{Estimate, Estimates, Observability, Phase, Solution, Time};
use nalgebra::Vector2;
use serde::Serialize;

use crate::identify::row::Row;
use crate::log::Log;
use crate::statistics::root_mean;

/// Length of a window, and from start to start, s.
pub const WINDOW_S: f64 = 60.0;
const STRIDE_S: f64 = 30.0;
/// Most windows: in a log of more than two hours only every second, third and so on is run.
const MOST_WINDOWS: usize = 240;
/// Longest gap between samples in a window, s.
const HOLE_S: f64 = 0.5;

/// Horizontal velocity error of a free INS against the aided one, RMS, m/s; none where no window
/// fits.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VelocityErrors {
    /// Sensors as logged, with the error of the initial heading.
    pub before: Option<f64>,
    /// The estimates applied.
    pub after: Option<f64>,
    /// Windows of a minute that it was measured on.
    pub windows: usize,
    /// Growth of both within a window.
    #[serde(skip)]
    pub growth: Vec<Growth>,
}

/// Root mean square over all windows at one time since their start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    pub since_s: f64,
    /// Sensors as logged, m/s.
    pub before_mps: f64,
    /// Estimates applied, m/s.
    pub after_mps: f64,
}

/// Velocity difference at a time since the window's start, s and m/s.
type Error = (f64, Vector2<f64>);

/// Whether an estimate is observable.
pub(crate) fn known(estimate: &Estimate) -> bool {
    estimate.observability == Observability::Observable
}

/// The value of an estimate if observable, else zero.
pub(crate) fn value(estimate: &Estimate) -> f64 {
    if known(estimate) { estimate.value } else { 0.0 }
}

/// Runs every window twice.
///
/// A window starts from the navigator's solution, and is compared with the solutions that follow: the
/// noise of GNSS itself is larger than these errors. The readings are taken as logged, the estimated
/// azimuth error put back into the heading; and compensated, each by the estimates that the navigator
/// had at its stamp.
pub fn check(
    log: &Log,
    solutions: &[Solution],
    history: &[Row],
    found: &Estimates,
) -> VelocityErrors {
    let azimuth_rad = value(&found.azimuth_error_rad);
    let (mut before, mut after, mut windows) = (Vec::new(), Vec::new(), 0);
    let starts = window_starts(history, known(&found.azimuth_error_rad));
    let every = starts.len().div_ceil(MOST_WINDOWS).max(1);
    for row in starts.into_iter().step_by(every) {
        let first = solutions.partition_point(|solution| solution.time < row.time);
        let solutions = &solutions[first..];
        let logged = run_window(log, solutions, azimuth_rad, &[]);
        if let (Some(logged), Some(with)) = (logged, run_window(log, solutions, 0.0, history)) {
            before.extend(logged);
            after.extend(with);
            windows += 1;
        }
    }
    let rms_of = |errors: &[Error]| (windows > 0).then(|| rms(errors.iter()));
    VelocityErrors {
        before: rms_of(&before),
        after: rms_of(&after),
        windows,
        growth: growth(&before, &after),
    }
}

/// An interval compensated by the estimates of a time; as it is before the history.
fn corrected(interval: &Interval, history: &[Row], time: Time) -> Interval {
    let after = history.partition_point(|row| row.time <= time);
    let row = history[..after].last();
    row.map_or(*interval, |row| row.estimates.corrected(interval))
}

/// Rows at which windows start: once the azimuth is known, if it ever is.
fn window_starts(history: &[Row], azimuth_known: bool) -> Vec<&Row> {
    let ready = |row: &&Row| {
        row.phase == Phase::Navigating
            && (known(&row.estimates.azimuth_error_rad) || !azimuth_known)
    };
    let mut starts: Vec<&Row> = Vec::new();
    for row in history.iter().filter(ready) {
        if starts
            .last()
            .is_none_or(|last| row.time.seconds_since(last.time) >= STRIDE_S)
        {
            starts.push(row);
        }
    }
    starts
}

/// A free INS over one window, from the first solution on; `None` if the samples end in it.
fn run_window(
    log: &Log,
    solutions: &[Solution],
    heading_rad: f64,
    history: &[Row],
) -> Option<Vec<Error>> {
    let (start, solutions) = solutions.split_first()?;
    let mut ins = Mechanization::new(start.position, start.velocity_enu_mps, start.attitude);
    ins.turn_heading(heading_rad);
    let mut solutions = solutions.iter().peekable();
    let mut errors = Vec::new();
    feed_intervals(log, start.time, history, |interval, time| {
        let since_s = time.seconds_since(start.time);
        ins.step(interval, &Controls::default());
        if let Some(truth) = solutions.next_if(|solution| solution.time <= time) {
            let error = (ins.velocity_enu_mps - truth.velocity_enu_mps).xy();
            errors.push((since_s, error));
        }
        since_s < WINDOW_S
    })?;
    Some(errors)
}

/// Gives the intervals after a start, compensated by the history, each with the time of its end, until
/// `wants_more` returns false; `None` if the samples end before or have a gap.
pub(crate) fn feed_intervals(
    log: &Log,
    start: Time,
    history: &[Row],
    mut wants_more: impl FnMut(&Interval, Time) -> bool,
) -> Option<()> {
    let mut samples = log.imu.since(start);
    let mut last = samples.next()?;
    let mut increments = Increments::new(log.meta.imu, &last);
    loop {
        let sample = samples.next()?;
        let seconds = sample.time.seconds_since(last.time);
        if seconds > HOLE_S {
            return None;
        }
        let interval = corrected(&increments.interval(&sample, seconds), history, sample.time);
        if !wants_more(&interval, sample.time) {
            return Some(());
        }
        last = sample;
    }
}

fn rms<'a>(errors: impl Iterator<Item = &'a Error>) -> f64 {
    root_mean(errors.map(|(_, error)| error.norm_squared()))
}

/// RMS of both in steps of two seconds since the start.
fn growth(before: &[Error], after: &[Error]) -> Vec<Growth> {
    const STEPS: u32 = 30;
    const STEP_S: f64 = WINDOW_S / STEPS as f64;
    (0..STEPS)
        .filter_map(|step| {
            let from = f64::from(step) * STEP_S;
            let in_step = |error: &&Error| (from..from + STEP_S).contains(&error.0);
            let within = |errors: &[Error]| rms(errors.iter().filter(in_step));
            before.iter().any(|error| in_step(&error)).then(|| Growth {
                since_s: from + 0.5 * STEP_S,
                before_mps: within(before),
                after_mps: within(after),
            })
        })
        .collect()
}
