//! Channels of the inertial sensors that spike, stick or run into their stops.

use std::io;

use ins_core::{GnssFix, ImuSample, Time};
use nalgebra::Vector3;

use super::Log;
use super::error::{Findings, LogError};
use super::typical::turned;

/// There and back between three samples: 10 g and 20 rad/s, beyond any vehicle.
const SPIKE_MPS2: f64 = 100.0;
const SPIKE_RADPS: f64 = 20.0;
/// All six channels equal to the last digit for so long, s, is no measurement in motion.
const FROZEN_S: f64 = 1.0;
/// One channel alone may rest as long as the last digit allows, s.
const STUCK_S: f64 = 10.0;
/// Longest hole that goes without a word, s: in a longer one a car rounds a corner, and a multirotor
/// is somewhere else.
const HOLE_S: f64 = 3.0;
/// A peak has one highest sample, or two; a stop has many.
const STOP_RUN: usize = 5;

/// Leaves out samples that are none, warns of clipped ones. Whether any was left out.
pub(super) fn mend_sensors(
    log: &mut Log,
    per_second: f64,
    findings: &mut Findings,
) -> Result<bool, LogError> {
    warn_of_holes(log, findings);
    let before = log.imu.len();
    leave_out_spikes(log, per_second, findings).map_err(|e| LogError::no_room(&e))?;
    leave_out_frozen(log, per_second, findings)?;
    warn_of_channels(log, per_second, findings);
    Ok(log.imu.len() < before)
}

/// Whatever came before, the navigator finds its way anew after them.
fn warn_of_holes(log: &Log, findings: &mut Findings) {
    let start = log.imu.first().map(|sample| sample.time);
    let mut holes = log.imu.pairs().filter_map(|[last, next]| {
        let seconds = next.time.seconds_since(last.time);
        let at_s = last.time.seconds_since(start?);
        (seconds > HOLE_S).then_some((at_s, seconds))
    });
    let Some((at_s, seconds)) = holes.next() else {
        return;
    };
    let others = match holes.count() {
        0 => String::new(),
        more => format!(", and {more} more"),
    };
    let found = format!("a hole of {seconds:.1} s after {at_s:.1} s{others}");
    let cause = "recording paused or broke off; the solution is found anew after each";
    findings.warn(findings.imu("", "samples without holes", found, cause));
}

fn leave_out_spikes(log: &mut Log, per_second: f64, findings: &mut Findings) -> io::Result<()> {
    let jumps = |a: Vector3<f64>, b: Vector3<f64>, c: Vector3<f64>, limit: f64| {
        let (up, down) = ((b - a) * per_second, (b - c) * per_second);
        (0..3)
            .any(|axis| up[axis].abs().min(down[axis].abs()) > limit && up[axis] * down[axis] > 0.0)
    };
    let mut last = None;
    let spikes: Vec<_> = (log.imu.pairs())
        .filter_map(|[b, c]| {
            let a = last.replace(b)?;
            let spike = jumps(a.gyro, b.gyro, c.gyro, SPIKE_RADPS)
                || jumps(a.accel, b.accel, c.accel, SPIKE_MPS2);
            spike.then_some(b.time)
        })
        // Where they are the rule it is another unit, or vibration.
        .take(log.imu.len() / 100 + 1)
        .collect();
    if spikes.is_empty() || spikes.len() * 100 > log.imu.len() {
        return Ok(());
    }
    let mut next = spikes.iter().peekable();
    log.imu = (log.imu).filtered(|sample| next.next_if(|time| **time == sample.time).is_none())?;
    let found = format!(
        "{} that jump there and back by 10 g or 20 rad/s",
        spikes.len()
    );
    let cause = "damaged samples; left out";
    findings.warn(findings.imu("", "samples that follow the motion", found, cause));
    Ok(())
}

/// From when until when sensors are stuck, where GNSS shows motion meanwhile.
fn frozen(log: &Log, per_second: f64) -> Vec<(Time, Time)> {
    let mut frozen = Vec::new();
    let mut samples = log.imu.iter().peekable();
    while let Some(start) = samples.next() {
        let same = |next: &ImuSample| next.gyro == start.gyro && next.accel == start.accel;
        let mut to = start.time;
        while let Some(next) = samples.next_if(same) {
            to = next.time;
        }
        let seconds = to.seconds_since(start.time);
        if seconds > FROZEN_S && contradicted(log, to, &start, per_second) {
            frozen.push((start.time, to));
        }
    }
    frozen
}

fn leave_out_frozen(
    log: &mut Log,
    per_second: f64,
    findings: &mut Findings,
) -> Result<(), LogError> {
    let frozen = frozen(log, per_second);
    let Some((first, _)) = frozen.first() else {
        return Ok(());
    };
    let first_s = first.seconds_since(log.start());
    let total_s: f64 = frozen
        .iter()
        .map(|(from, to)| to.seconds_since(*from))
        .sum();
    let mut holes = frozen.iter().peekable();
    let moving = log.imu.filtered(|sample| {
        while holes.next_if(|(_, to)| *to < sample.time).is_some() {}
        holes.peek().is_none_or(|(from, _)| sample.time <= *from)
    });
    let moving = moving.map_err(|e| LogError::no_room(&e))?;
    let found = format!(
        "the same in all six channels for {total_s:.0} s, the first time {first_s:.0} s after the \
         start, while GNSS shows motion"
    );
    let expected = "readings that change";
    if moving.len() < 2 {
        let cause = "sensors or their driver were stuck";
        return Err(findings.imu("", expected, found, cause));
    }
    log.imu = moving;
    let cause = "sensors or their driver were stuck; left out";
    findings.warn(findings.imu("", expected, found, cause));
    Ok(())
}

/// Whether GNSS turns or speeds up, from a reading to a time, as that reading does not.
fn contradicted(log: &Log, to: Time, reading: &ImuSample, per_second: f64) -> bool {
    let from = reading.time;
    let first = log.gnss.partition_point(|fix| fix.time < from);
    let last = log.gnss.partition_point(|fix| fix.time <= to).max(first);
    let fixes = &log.gnss[first..last];
    let moving = |fix: &GnssFix| fix.velocity_en_mps.filter(|v| v.norm() > 2.0);
    let velocities: Vec<_> = fixes.iter().filter_map(moving).collect();
    let (Some(start), Some(end)) = (velocities.first(), velocities.last()) else {
        return false;
    };
    let seconds = to.seconds_since(from);
    let turns = velocities.windows(2).map(|pair| turned(pair[0], pair[1]));
    let turned_rad: f64 = turns.sum();
    let faster_mps = (end.norm() - start.norm()).abs();
    let forced_mps = reading.accel.xy().norm() * per_second * seconds;
    // Half a rad and 2 m/s: beyond what a course and a speed are off by.
    (turned_rad - reading.gyro.z * per_second * seconds).abs() > 0.5
        || (faster_mps > 2.0 && forced_mps < 0.5 * faster_mps)
}

type Channels = [f64; 6];

const CHANNELS: [&str; 6] = [
    "gyro right",
    "gyro forward",
    "gyro up",
    "accelerometer right",
    "accelerometer forward",
    "accelerometer up",
];
/// Below some of a rad/s, or 1 g, nothing has its stop: a coarse digit is equal.
const LEAST_STOP: Channels = [0.15, 0.15, 0.15, 10.2, 10.2, 10.2];

fn channels(sample: &ImuSample) -> Channels {
    let (gyro, accel) = (sample.gyro, sample.accel);
    [gyro.x, gyro.y, gyro.z, accel.x, accel.y, accel.z]
}

/// Warns of channels that stick, or run into their stops.
fn warn_of_channels(log: &Log, per_second: f64, findings: &mut Findings) {
    let mut runs: [Runs; 6] = Default::default();
    let mut stops: [[Stop; 2]; 6] = Default::default();
    for sample in log.imu.iter() {
        let values = channels(&sample);
        for (channel, (runs, stops)) in runs.iter_mut().zip(&mut stops).enumerate() {
            runs.push(channel, sample.time, &values);
            stops[0].push(values[channel]);
            stops[1].push(-values[channel]);
        }
    }
    let count = log.imu.len();
    for (name, runs) in CHANNELS.into_iter().zip(runs) {
        if let Some((found, cause)) = runs.longest().verdict(log.start(), count) {
            let expected = "readings that change";
            findings.warn(findings.imu(name, expected, found, cause));
        }
    }
    for ((name, stops), least) in CHANNELS.into_iter().zip(stops).zip(LEAST_STOP) {
        for (stop, sign) in stops.into_iter().zip([1.0, -1.0]) {
            if !stop.is_one(least / per_second, count) {
                continue;
            }
            let found = format!("{} at exactly {:.4}", stop.count, sign * stop.highest);
            let cause = "the range of the sensor is too small for the motion: what was beyond it \
                         is lost, and estimates suffer";
            let expected = "readings within the range of the sensor";
            findings.warn(findings.imu(name, expected, found, cause));
        }
    }
}

/// A channel at one value.
#[derive(Clone, Copy, Default)]
struct Run {
    from: Time,
    to: Time,
    samples: usize,
    values: Channels,
    /// Which channels change meanwhile.
    go_on: [bool; 6],
}

impl Run {
    fn seconds(&self) -> f64 {
        self.to.seconds_since(self.from)
    }

    /// What there is to say of the longest one of a channel, and the likely cause.
    fn verdict(&self, origin: Time, samples: usize) -> Option<(String, &'static str)> {
        let going_on = self.go_on.iter().filter(|goes_on| **goes_on).count();
        // Several that never move are no sensors, but made up.
        let throughout = self.samples == samples;
        let made_up = throughout && going_on < 5;
        if made_up || self.seconds() < STUCK_S || going_on == 0 {
            return None;
        }
        if throughout {
            let found = "the same throughout, while others change".to_owned();
            return Some((found, "the channel is dead: estimates suffer"));
        }
        let found = format!(
            "the same for {:.0} s, from {:.0} s after the start, while others change",
            self.seconds(),
            self.from.seconds_since(origin)
        );
        let cause = "the channel or its driver was stuck: estimates from then on suffer";
        Some((found, cause))
    }
}

/// The runs of a channel: the longest so far, and the one that goes on.
#[derive(Default)]
struct Runs {
    longest: Run,
    now: Run,
}

impl Runs {
    fn push(&mut self, channel: usize, time: Time, values: &Channels) {
        let now = &mut self.now;
        if now.samples > 0 && values[channel].total_cmp(&now.values[channel]).is_eq() {
            now.to = time;
            now.samples += 1;
            for (other, goes_on) in now.go_on.iter_mut().enumerate() {
                *goes_on |= values[other].total_cmp(&now.values[other]).is_ne();
            }
            return;
        }
        *self = Self {
            longest: std::mem::take(self).longest(),
            now: Run {
                from: time,
                to: time,
                samples: 1,
                values: *values,
                go_on: [false; 6],
            },
        };
    }

    fn longest(self) -> Run {
        if self.now.seconds() >= self.longest.seconds() {
            self.now
        } else {
            self.longest
        }
    }
}

/// The highest value of a channel above zero, and how it is met.
#[derive(Default)]
struct Stop {
    highest: f64,
    count: usize,
    run: usize,
    longest_run: usize,
}

impl Stop {
    fn push(&mut self, value: f64) {
        if value < self.highest {
            self.run = 0;
            return;
        }
        if value > self.highest {
            *self = Self {
                highest: value,
                ..Self::default()
            };
        }
        self.count += 1;
        self.run += 1;
        self.longest_run = self.longest_run.max(self.run);
    }

    /// Whether a sensor with so many samples ends there.
    fn is_one(&self, least: f64, samples: usize) -> bool {
        let constant = 2 * self.count > samples;
        self.longest_run >= STOP_RUN && !constant && self.highest >= least
    }
}
