//! What the estimates are worth: velocity error of a free INS, without and with them.

use ins_core::increments::{Increments, Interval};
use ins_core::mechanization::{Controls, Mechanization};
use ins_core::{Estimate, Estimates, GnssFix, Observability, Solution, Time};
use nalgebra::{Vector2, Vector3};

use crate::identify::Row;
use crate::log::Log;

/// Length of a window, and from start to start, s.
pub const WINDOW_S: f64 = 60.0;
const STRIDE_S: f64 = 30.0;
/// A hole between samples that spoils a window, s.
const HOLE_S: f64 = 0.5;

/// Horizontal velocity error against GNSS over free-inertial windows.
#[derive(Clone, Debug, PartialEq)]
pub struct VelocityError {
    /// Root mean square, sensors as logged and the first heading's error left in, m/s.
    pub before_mps: f64,
    /// Root mean square, the estimates applied, m/s.
    pub after_mps: f64,
    /// Windows run.
    pub windows: usize,
    /// How both grow within a window.
    pub growth: Vec<Growth>,
}

/// Root mean square over all windows at one time since their start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    /// Time since the start of the window, s.
    pub since_s: f64,
    /// Sensors as logged, m/s.
    pub before_mps: f64,
    /// Estimates applied, m/s.
    pub after_mps: f64,
}

/// Velocity difference at a time since the window's start, s and m/s.
type Error = (f64, Vector2<f64>);

fn known(estimate: &Estimate) -> bool {
    estimate.observability == Observability::Observable
}

/// An estimate as far as it stands on data.
fn value(estimate: &Estimate) -> f64 {
    if known(estimate) { estimate.value } else { 0.0 }
}

fn vector(v: &[Estimate; 3]) -> Vector3<f64> {
    Vector3::from_iterator(v.iter().map(value))
}

/// Runs every window twice; `None` if the log has no minute of navigation.
///
/// A window starts from the navigator's solution of its moment. The sensors are taken as logged,
/// with the azimuth error that was found put back; and with the history of the estimates taken
/// out, each reading less the biases that the navigator knew at its stamp.
pub fn check(log: &Log, history: &[Row], found: &Estimates) -> Option<VelocityError> {
    let azimuth_rad = value(&found.azimuth_error_rad);
    let latency_s = value(&found.gnss_latency_now_s) - value(&found.clock_drift) * end_s(log);
    let clock = Clock {
        latency_s,
        drift: value(&found.clock_drift),
    };
    let (mut before, mut after, mut windows) = (Vec::new(), Vec::new(), 0);
    for row in window_starts(history, known(&found.azimuth_error_rad)) {
        let Some(start) = row.solution else { continue };
        let logged = fly(log, &start, azimuth_rad, &[], clock);
        if let (Some(logged), Some(with)) = (logged, fly(log, &start, 0.0, history, clock)) {
            before.extend(logged);
            after.extend(with);
            windows += 1;
        }
    }
    (windows > 0).then(|| VelocityError {
        before_mps: rms(before.iter()),
        after_mps: rms(after.iter()),
        windows,
        growth: growth(&before, &after),
    })
}

/// Time of the last fix, s.
fn end_s(log: &Log) -> f64 {
    log.gnss.last().map_or(0.0, |fix| fix.time.as_seconds())
}

/// Latency of GNSS as the estimates have it: at the origin of the stamps, and its growth.
#[derive(Clone, Copy)]
struct Clock {
    latency_s: f64,
    drift: f64,
}

/// An interval less the errors that the navigator knew at a time; as it is before the history.
fn corrected(interval: &Interval, history: &[Row], time: Time) -> Interval {
    let after = history.partition_point(|row| row.time <= time);
    let Some(row) = history[..after].last() else {
        return *interval;
    };
    let known = &row.estimates;
    let mut interval = interval.without_bias(
        &vector(&known.gyro_bias_radps),
        &vector(&known.accel_bias_mps2),
    );
    interval.angle_rad -= vector(&known.gyro_turn) * interval.angle_rad.z;
    interval.force_mps.x *= 1.0 - value(&known.accel_scale[0]);
    interval.force_mps.y *= 1.0 - value(&known.accel_scale[1]);
    interval
}

/// Rows that a window starts at: from where the azimuth is known, if it ever is.
fn window_starts(history: &[Row], azimuth_known: bool) -> Vec<&Row> {
    let ready = |row: &&Row| {
        row.solution.is_some() && (known(&row.estimates.azimuth_error_rad) || !azimuth_known)
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

/// A free INS over one window; `None` if samples or fixes do not last.
fn fly(
    log: &Log,
    start: &Solution,
    heading_rad: f64,
    history: &[Row],
    clock: Clock,
) -> Option<Vec<Error>> {
    let first = log.imu.partition_point(|sample| sample.time < start.time);
    let mut samples = log.imu[first..].iter();
    let mut last = samples.next()?;
    let mut ins = Mechanization::new(start.position, start.velocity_enu_mps, start.attitude);
    ins.turn_heading(heading_rad);
    let mut increments = Increments::new(log.meta.imu, last);
    let mut fixes = moments(log, start.time, clock).peekable();
    let mut errors = Vec::new();
    while last.time.seconds_since(start.time) < WINDOW_S {
        let sample = samples.next()?;
        let seconds = sample.time.seconds_since(last.time);
        if seconds > HOLE_S {
            return None;
        }
        let before = ins.velocity_enu_mps.xy();
        let interval = corrected(&increments.interval(sample, seconds), history, sample.time);
        ins.step(&interval, &Controls::default());
        while let Some((moment, fix)) = fixes.next_if(|(moment, _)| *moment <= sample.time) {
            let share = moment.seconds_since(last.time) / seconds;
            let velocity = before.lerp(&ins.velocity_enu_mps.xy(), share);
            errors.push((moment.seconds_since(start.time), velocity - fix));
        }
        last = sample;
    }
    // Half a window without fixes judges nothing.
    errors
        .last()
        .is_some_and(|(since, _)| *since > 0.5 * WINDOW_S)
        .then_some(errors)
}

/// GNSS velocities and the moments they belong to, from a start on.
fn moments(
    log: &Log,
    start: Time,
    clock: Clock,
) -> impl Iterator<Item = (Time, Vector2<f64>)> + '_ {
    let moment = move |fix: &GnssFix| {
        fix.time
            .plus_seconds(-clock.latency_s - clock.drift * fix.time.as_seconds())
    };
    let first = log.gnss.partition_point(|fix| moment(fix) <= start);
    log.gnss[first..]
        .iter()
        .filter_map(move |fix| Some((moment(fix), fix.velocity_en_mps?)))
}

fn rms<'a>(errors: impl Iterator<Item = &'a Error>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (_, error) in errors {
        sum += error.norm_squared();
        count += 1.0;
    }
    if count > 0.0 {
        (sum / count).sqrt()
    } else {
        0.0
    }
}

/// Both by whole steps of two seconds since the start.
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
