//! Channels of the inertial sensors that spike, stick or run into their stops.

use ins_core::{GnssFix, ImuSample, Time};
use nalgebra::{Vector2, Vector3};

use super::Log;
use super::error::LogError;
use super::files::Files;

/// There and back between three samples: 10 g and 20 rad/s, beyond any vehicle.
const SPIKE_MPS2: f64 = 100.0;
const SPIKE_RADPS: f64 = 20.0;
/// All six channels equal to the last digit for so long, s, is no measurement in motion.
const FROZEN_S: f64 = 1.0;
/// One channel alone may rest as long as the last digit allows, s.
const STUCK_S: f64 = 10.0;
/// Longest hole that goes without a word, s: what holds for the time before may not hold after a longer.
const HOLE_S: f64 = 10.0;
/// A peak has one highest sample, or two; a stop has many.
const STOP_RUN: usize = 5;

/// Leaves out samples that are none, warns of clipped ones.
pub(super) fn mend_sensors(
    log: &mut Log,
    per_second: f64,
    files: &Files,
    warnings: &mut Vec<LogError>,
) {
    warn_of_holes(log, files, warnings);
    leave_out_spikes(log, per_second, files, warnings);
    leave_out_frozen(log, per_second, files, warnings);
    warn_of_frozen_channels(log, files, warnings);
    warn_of_stops(log, per_second, files, warnings);
}

/// Whatever came before, the navigator finds its way anew after them.
fn warn_of_holes(log: &Log, files: &Files, warnings: &mut Vec<LogError>) {
    let start = log.imu.first().map(|sample| sample.time);
    let holes = log.imu.windows(2).filter_map(|pair| {
        let seconds = pair[1].time.seconds_since(pair[0].time);
        let at_s = pair[0].time.seconds_since(start?);
        (seconds > HOLE_S).then_some((at_s, seconds))
    });
    let holes: Vec<(f64, f64)> = holes.collect();
    let Some((at_s, seconds)) = holes.first() else {
        return;
    };
    let others = match holes.len() - 1 {
        0 => String::new(),
        more => format!(", and {more} more"),
    };
    let found = format!("a hole of {seconds:.1} s after {at_s:.1} s{others}");
    let cause = "recording paused or broke off; the solution is found anew after each";
    warnings.push(LogError::file(
        &files.imu,
        "samples without holes",
        found,
        cause,
    ));
}

fn leave_out_spikes(log: &mut Log, per_second: f64, files: &Files, warnings: &mut Vec<LogError>) {
    let jumps = |a: Vector3<f64>, b: Vector3<f64>, c: Vector3<f64>, limit: f64| {
        let (up, down) = ((b - a) * per_second, (b - c) * per_second);
        (0..3)
            .any(|axis| up[axis].abs().min(down[axis].abs()) > limit && up[axis] * down[axis] > 0.0)
    };
    let spikes: Vec<_> = log
        .imu
        .windows(3)
        .filter(|w| {
            jumps(w[0].gyro, w[1].gyro, w[2].gyro, SPIKE_RADPS)
                || jumps(w[0].accel, w[1].accel, w[2].accel, SPIKE_MPS2)
        })
        .map(|w| w[1].time)
        .collect();
    // Where they are the rule it is another unit, or vibration.
    if spikes.is_empty() || spikes.len() * 100 > log.imu.len() {
        return;
    }
    let mut next = spikes.iter().peekable();
    log.imu
        .retain(|sample| next.next_if(|time| **time == sample.time).is_none());
    let found = format!(
        "{} that jump there and back by 10 g or 20 rad/s",
        spikes.len()
    );
    let cause = "damaged samples; left out";
    warnings.push(LogError::file(
        &files.imu,
        "samples that follow the motion",
        found,
        cause,
    ));
}

/// Stuck sensors, where GNSS shows motion meanwhile.
fn leave_out_frozen(log: &mut Log, per_second: f64, files: &Files, warnings: &mut Vec<LogError>) {
    let same = |a: usize, b: usize| {
        log.imu[a].gyro == log.imu[b].gyro && log.imu[a].accel == log.imu[b].accel
    };
    let mut frozen = Vec::new();
    let mut start = 0;
    for index in 1..=log.imu.len() {
        if index < log.imu.len() && same(start, index) {
            continue;
        }
        let (from, to) = (log.imu[start].time, log.imu[index - 1].time);
        let seconds = to.seconds_since(from);
        if seconds > FROZEN_S && contradicted(log, from, to, &log.imu[start], per_second) {
            frozen.push((from, to));
        }
        start = index;
    }
    if frozen.is_empty() {
        return;
    }
    let total_s: f64 = frozen
        .iter()
        .map(|(from, to)| to.seconds_since(*from))
        .sum();
    let origin = log.imu[0].time;
    let first_s = frozen[0].0.seconds_since(origin);
    let mut holes = frozen.iter().peekable();
    log.imu.retain(|sample| {
        while holes.next_if(|(_, to)| *to < sample.time).is_some() {}
        holes.peek().is_none_or(|(from, _)| sample.time <= *from)
    });
    let found = format!(
        "the same in all six channels for {total_s:.0} s, the first time {first_s:.0} s after the \
         start, while GNSS shows motion"
    );
    let cause = "sensors or their driver were stuck; left out";
    warnings.push(LogError::file(
        &files.imu,
        "readings that change",
        found,
        cause,
    ));
}

/// Whether GNSS turns or speeds up within a time as a constant reading does not.
fn contradicted(log: &Log, from: Time, to: Time, reading: &ImuSample, per_second: f64) -> bool {
    let first = log.gnss.partition_point(|fix| fix.time < from);
    let last = log.gnss.partition_point(|fix| fix.time <= to).max(first);
    let fixes = &log.gnss[first..last];
    let moving = |fix: &GnssFix| fix.velocity_en_mps.filter(|v| v.norm() > 2.0);
    let velocities: Vec<_> = fixes.iter().filter_map(moving).collect();
    let (Some(start), Some(end)) = (velocities.first(), velocities.last()) else {
        return false;
    };
    let seconds = to.seconds_since(from);
    let turn = |pair: &[Vector2<f64>]| pair[0].perp(&pair[1]).atan2(pair[0].dot(&pair[1]));
    let turned_rad: f64 = velocities.windows(2).map(turn).sum();
    let faster_mps = (end.norm() - start.norm()).abs();
    let forced_mps = reading.accel.xy().norm() * per_second * seconds;
    // Half a rad and 2 m/s: beyond what a course and a speed are off by.
    (turned_rad - reading.gyro.z * per_second * seconds).abs() > 0.5
        || (faster_mps > 2.0 && forced_mps < 0.5 * faster_mps)
}

type Channel = fn(&ImuSample) -> f64;

const CHANNELS: [(&str, Channel); 6] = [
    ("gyro right", |s| s.gyro.x),
    ("gyro forward", |s| s.gyro.y),
    ("gyro up", |s| s.gyro.z),
    ("accelerometer right", |s| s.accel.x),
    ("accelerometer forward", |s| s.accel.y),
    ("accelerometer up", |s| s.accel.z),
];

/// A channel that stops where others go on.
fn warn_of_frozen_channels(log: &Log, files: &Files, warnings: &mut Vec<LogError>) {
    for (name, channel) in CHANNELS {
        let same =
            |read: Channel, a: &ImuSample, b: &ImuSample| read(a).total_cmp(&read(b)).is_eq();
        let runs = log.imu.chunk_by(|a, b| same(channel, a, b));
        let span_s = |run: &[ImuSample]| run[run.len() - 1].time.seconds_since(run[0].time);
        let Some(longest) = runs.max_by(|a, b| span_s(a).total_cmp(&span_s(b))) else {
            continue;
        };
        let goes_on = |other: Channel| longest.iter().any(|s| !same(other, s, &longest[0]));
        // Several that never move are no sensors, but made up.
        let throughout = longest.len() == log.imu.len();
        let made_up = throughout && CHANNELS.iter().filter(|other| goes_on(other.1)).count() < 5;
        if made_up || span_s(longest) < STUCK_S || !CHANNELS.iter().any(|o| goes_on(o.1)) {
            continue;
        }
        let since_s = longest[0].time.seconds_since(log.imu[0].time);
        let (found, cause) = if throughout {
            (
                "the same throughout, while others change".to_owned(),
                "the channel is dead: estimates suffer",
            )
        } else {
            (
                format!(
                    "the same for {:.0} s, from {since_s:.0} s after the start, while others change",
                    span_s(longest)
                ),
                "the channel or its driver was stuck: estimates from then on suffer",
            )
        };
        let expected = "readings that change";
        warnings.push(LogError::file(&files.imu, expected, found, cause).in_column(name));
    }
}

fn warn_of_stops(log: &Log, per_second: f64, files: &Files, warnings: &mut Vec<LogError>) {
    for (name, channel) in CHANNELS {
        for sign in [1.0, -1.0] {
            let highest = log
                .imu
                .iter()
                .map(|s| sign * channel(s))
                .fold(f64::MIN, f64::max);
            let at_stop: Vec<bool> = log
                .imu
                .iter()
                .map(|s| sign * channel(s) >= highest)
                .collect();
            let longest = at_stop
                .chunk_by(|a, b| a == b)
                .filter(|run| run[0])
                .map(<[bool]>::len);
            // Below some of a rad/s, or 1 g, nothing has its stop: a coarse digit is equal.
            let limit = if name.starts_with("gyro") { 0.15 } else { 10.2 };
            let long = longest.max().unwrap_or(0) >= STOP_RUN;
            let constant = 2 * at_stop.iter().filter(|at| **at).count() > at_stop.len();
            if !long || constant || highest * per_second < limit {
                continue;
            }
            let count = at_stop.iter().filter(|at| **at).count();
            let found = format!("{count} at exactly {:.4}", sign * highest);
            let cause = "the range of the sensor is too small for the motion: what was beyond it \
                         is lost, and estimates suffer";
            let expected = "readings within the range of the sensor";
            warnings.push(LogError::file(&files.imu, expected, found, cause).in_column(name));
        }
    }
}
