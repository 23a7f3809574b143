//! Readings held by the logger, spikes, stuck channels and saturation of the inertial sensors, and gaps.

use std::collections::BTreeMap;
use std::io;

use ins_core::{GnssFix, ImuOutput, ImuSample, Time};
use nalgebra::Vector3;

use super::Log;
use super::error::{Findings, LogError};
use super::series::signed_angle;

/// Spike within three samples, of 10 g or 20 rad/s: beyond any vehicle.
const SPIKE_MPS2: f64 = 100.0;
const SPIKE_RADPS: f64 = 20.0;
/// Least duration of six identical channels in motion that are stuck, s.
const FROZEN_S: f64 = 1.0;
/// Least duration of a single stuck channel, s: a coarse resolution may repeat values.
const STUCK_S: f64 = 10.0;
/// Longest gap without a warning, s: a longer one may hide a whole turn.
const GAP_S: f64 = 3.0;
/// Least run of samples at the highest value that is saturation: a true peak has one or two.
const SATURATED_RUN: usize = 5;

/// Leaves out held readings, spikes and stuck samples, warns of saturation. Returns whether any was left out.
pub(super) fn repair_sensors(
    log: &mut Log,
    per_second: f64,
    findings: &mut Findings,
) -> Result<bool, LogError> {
    warn_of_gaps(log, findings);
    let before = log.imu.len();
    leave_out_held(log, findings).map_err(|e| LogError::no_room(&e))?;
    leave_out_spikes(log, per_second, findings).map_err(|e| LogError::no_room(&e))?;
    leave_out_frozen(log, per_second, findings)?;
    warn_of_stuck_and_saturated(log, per_second, findings);
    Ok(log.imu.len() < before)
}

/// The navigator starts anew after a gap.
fn warn_of_gaps(log: &Log, findings: &mut Findings) {
    let start = log.imu.first().map(|sample| sample.time);
    let mut gaps = log.imu.pairs().filter_map(|[last, next]| {
        let seconds = next.time.seconds_since(last.time);
        let at_s = last.time.seconds_since(start?);
        (seconds > GAP_S).then_some((at_s, seconds))
    });
    let Some((at_s, seconds)) = gaps.next() else {
        return;
    };
    let more_gaps = match gaps.count() {
        0 => String::new(),
        more => format!(", and {more} more"),
    };
    let found = format!("a gap of {seconds:.1} s after {at_s:.1} s{more_gaps}");
    let cause = "recording paused or broke off; the solution starts anew after each";
    findings.warn(findings.imu("", "samples without gaps", found, cause));
}

/// A logger faster than the sensors writes each reading several times. Few are held much longer: that is rest, in
/// a simulation.
fn leave_out_held(log: &mut Log, findings: &mut Findings) -> io::Result<()> {
    let same = |a: &ImuSample, b: &ImuSample| a.gyro == b.gyro && a.accel == b.accel;
    let mut runs: BTreeMap<usize, usize> = BTreeMap::new();
    let mut run = 1;
    for [last, next] in log.imu.pairs() {
        if same(&last, &next) {
            run += 1;
        } else {
            *runs.entry(run).or_default() += 1;
            run = 1;
        }
    }
    let all: usize = runs.values().sum();
    // The shortest as long as most are, and as long as almost all are.
    let [most, held] = [0.5, 0.95].map(|part| {
        let mut covered = 0;
        let length = runs.iter().find(|(_, count)| {
            covered += **count;
            covered as f64 > part * all as f64
        });
        length.map_or(1, |(length, _)| *length)
    });
    let count = log.imu.len();
    if log.meta.imu == ImuOutput::Increments || most < 2 || 2 * held * all < count {
        return Ok(());
    }
    let mut last: Option<(ImuSample, usize)> = None;
    log.imu = log.imu.filtered(|sample| {
        let held_before = last.filter(|(kept, times)| same(kept, sample) && *times < held);
        last = held_before.map_or(Some((*sample, 1)), |(kept, times)| Some((kept, times + 1)));
        held_before.is_none()
    })?;
    let found = format!("{} of {count} like the one before", count - log.imu.len());
    let cause = "the logger writes each reading several times: only the first is used";
    findings.warn(findings.imu("", "a new reading in every row", found, cause));
    Ok(())
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
        // More than one in a hundred is another unit, or vibration.
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

/// Intervals with all channels stuck while GNSS shows motion.
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
        if seconds > FROZEN_S && gnss_contradicts(log, to, &start, per_second) {
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
    let mut gaps = frozen.iter().peekable();
    let moving = log.imu.filtered(|sample| {
        while gaps.next_if(|(_, to)| *to < sample.time).is_some() {}
        gaps.peek().is_none_or(|(from, _)| sample.time <= *from)
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

/// Whether turn or speed change by GNSS, from a reading to a time, contradict that constant reading.
fn gnss_contradicts(log: &Log, to: Time, reading: &ImuSample, per_second: f64) -> bool {
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
    let turns = velocities.windows(2).map(|w| signed_angle(w[0], w[1]));
    let turned_rad: f64 = turns.sum();
    let speed_change_mps = (end.norm() - start.norm()).abs();
    let sensed_mps = reading.accel.xy().norm() * per_second * seconds;
    // 0.5 rad and 2 m/s: beyond the errors of course and speed.
    (turned_rad - reading.gyro.z * per_second * seconds).abs() > 0.5
        || (speed_change_mps > 2.0 && sensed_mps < 0.5 * speed_change_mps)
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
/// Least full scale, rad/s and m/s^2: lower equal peaks are of coarse resolution.
const MIN_FULL_SCALE: Channels = [0.15, 0.15, 0.15, 10.2, 10.2, 10.2];

fn channels(sample: &ImuSample) -> Channels {
    let (gyro, accel) = (sample.gyro, sample.accel);
    [gyro.x, gyro.y, gyro.z, accel.x, accel.y, accel.z]
}

/// Warns of stuck and saturated channels.
fn warn_of_stuck_and_saturated(log: &Log, per_second: f64, findings: &mut Findings) {
    let mut runs: [Runs; 6] = Default::default();
    let mut peaks: [[Peak; 2]; 6] = Default::default();
    for sample in log.imu.iter() {
        let values = channels(&sample);
        for (channel, (runs, peaks)) in runs.iter_mut().zip(&mut peaks).enumerate() {
            runs.push(channel, sample.time, &values);
            peaks[0].push(values[channel]);
            peaks[1].push(-values[channel]);
        }
    }
    let count = log.imu.len();
    for (name, runs) in CHANNELS.into_iter().zip(runs) {
        if let Some((found, cause)) = runs.longest().defect(log.start(), count) {
            let expected = "readings that change";
            findings.warn(findings.imu(name, expected, found, cause));
        }
    }
    for ((name, peaks), least) in CHANNELS.into_iter().zip(peaks).zip(MIN_FULL_SCALE) {
        for (peak, sign) in peaks.into_iter().zip([1.0, -1.0]) {
            if !peak.is_saturation(least / per_second, count) {
                continue;
            }
            let found = format!("{} at exactly {:.4}", peak.count, sign * peak.highest);
            let cause = "the range of the sensor is too small for the motion: what was beyond it \
                         is lost, and estimates suffer";
            let expected = "readings within the range of the sensor";
            findings.warn(findings.imu(name, expected, found, cause));
        }
    }
}

/// A run of one value of a channel.
#[derive(Clone, Copy, Default)]
struct Run {
    from: Time,
    to: Time,
    samples: usize,
    values: Channels,
    /// Which channels vary meanwhile.
    varies: [bool; 6],
}

impl Run {
    fn seconds(&self) -> f64 {
        self.to.seconds_since(self.from)
    }

    /// Whether the longest run of a channel is a defect, and its likely cause.
    fn defect(&self, origin: Time, samples: usize) -> Option<(String, &'static str)> {
        let varying = self.varies.iter().filter(|varies| **varies).count();
        // Several constant channels are synthetic data.
        let throughout = self.samples == samples;
        let synthetic = throughout && varying < 5;
        if synthetic || self.seconds() < STUCK_S || varying == 0 {
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

/// Runs of a channel: the longest so far, and the current one.
#[derive(Default)]
struct Runs {
    longest: Run,
    current: Run,
}

impl Runs {
    fn push(&mut self, channel: usize, time: Time, values: &Channels) {
        let current = &mut self.current;
        if current.samples > 0 && values[channel].total_cmp(&current.values[channel]).is_eq() {
            current.to = time;
            current.samples += 1;
            for (other, varies) in current.varies.iter_mut().enumerate() {
                *varies |= values[other].total_cmp(&current.values[other]).is_ne();
            }
            return;
        }
        *self = Self {
            longest: std::mem::take(self).longest(),
            current: Run {
                from: time,
                to: time,
                samples: 1,
                values: *values,
                varies: [false; 6],
            },
        };
    }

    fn longest(self) -> Run {
        if self.current.seconds() >= self.longest.seconds() {
            self.current
        } else {
            self.longest
        }
    }
}

/// The highest value of a channel above zero, and its repetitions.
#[derive(Default)]
struct Peak {
    highest: f64,
    count: usize,
    run: usize,
    longest_run: usize,
}

impl Peak {
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

    /// Whether the peak of so many samples is saturation.
    fn is_saturation(&self, least: f64, samples: usize) -> bool {
        let constant = 2 * self.count > samples;
        self.longest_run >= SATURATED_RUN && !constant && self.highest >= least
    }
}
