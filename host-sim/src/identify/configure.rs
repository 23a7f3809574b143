//! The navigator's configuration for a log, from its metadata and its samples.

use ins_core::config::HeadingSource;
use ins_core::earth::ROTATION_RATE_RADPS;
use ins_core::{Config, GnssFix, ImuOutput, Time};
use nalgebra::{Vector2, Vector3};

use crate::log::{Grade, Log};

/// Shortest rest from which the class of the gyros is determined, s.
const REST_S: f64 = 10.0;
const REST_SPEED_MPS: f64 = 0.3;
/// Limits of gyros that resolve Earth rate: mean at rest, and standard deviation of one-second means,
/// rad/s. Ring lasers stay below by five times, consumer gyros above by as much.
const MOST_AT_REST_RADPS: f64 = ROTATION_RATE_RADPS + 1e-4;
const SPREAD_RADPS: f64 = 2e-4;

/// The class of the sensors: as given, from the log's metadata, or from the gyros at rest.
pub fn grade(log: &Log, told: Option<Grade>) -> Grade {
    told.or(log.meta.grade)
        .unwrap_or_else(|| grade_at_rest(log))
}

pub fn config(log: &Log, grade: Grade) -> Config {
    let heading_rad = log.meta.initial_heading_deg.map(f64::to_radians);
    config_of(grade, log.meta.imu, heading_rad)
}

/// The preset of a class, for samples of a kind, and a heading if one is given.
pub(crate) fn config_of(class: Grade, output: ImuOutput, heading_rad: Option<f64>) -> Config {
    let preset = match class {
        Grade::Hg1700 => Config::hg1700(),
        Grade::Mems => Config::mems(),
    };
    Config {
        imu_output: output,
        heading: heading_rad.map_or(preset.heading, HeadingSource::Given),
        ..preset
    }
}

/// Whether gyros at rest, if there is one, have the biases of the class. Their scatter is not tested:
/// it may be the vehicle's.
pub fn fits(log: &Log, grade: Grade) -> bool {
    grade == Grade::Mems || at_rest(log).is_none_or(|[mean, _]| mean < MOST_AT_REST_RADPS)
}

fn grade_at_rest(log: &Log) -> Grade {
    match at_rest(log) {
        Some([mean, spread]) if mean < MOST_AT_REST_RADPS && spread < SPREAD_RADPS => Grade::Hg1700,
        _ => Grade::Mems,
    }
}

/// Mean angular rate at rest, and standard deviation of its one-second means, rad/s.
fn at_rest(log: &Log) -> Option<[f64; 2]> {
    // The unit may not have been on while the receiver stood.
    let means = Some(second_means(log, longest_rest(log)?)).filter(|means| !means.is_empty())?;
    let count = means.len() as f64;
    let mean = means.iter().sum::<Vector3<f64>>() / count;
    let spread = (means.iter().map(|m| (m - mean).norm_squared()).sum::<f64>() / count).sqrt();
    Some([mean.norm(), spread])
}

/// The longest stretch of fixes at rest, if long enough.
fn longest_rest(log: &Log) -> Option<(Time, Time)> {
    let slow = |v: Vector2<f64>| v.norm() < REST_SPEED_MPS;
    let rests = |fix: &GnssFix| fix.velocity_en_mps.is_some_and(slow);
    let seconds = |(from, to): &(Time, Time)| to.seconds_since(*from);
    let stretches = log.gnss.chunk_by(|a, b| rests(a) && rests(b));
    let spans = stretches
        .filter(|fixes| rests(&fixes[0]))
        .map(|fixes| (fixes[0].time, fixes[fixes.len() - 1].time));
    // The first of equals.
    let longest = spans.rev().max_by(|a, b| seconds(a).total_cmp(&seconds(b)));
    longest.filter(|span| seconds(span) >= REST_S)
}

/// Means of the angular rate over whole seconds, a second away from both ends, rad/s.
fn second_means(log: &Log, (from, to): (Time, Time)) -> Vec<Vector3<f64>> {
    let (mut start, end) = (from.plus_seconds(1.0), to.plus_seconds(-1.0));
    let mut means = Vec::new();
    let (mut sum, mut weight) = (Vector3::zeros(), 0.0);
    let rest = log.imu.between(from, to);
    for [last, sample] in rest.pairs() {
        let time = sample.time;
        if time < start || time > end {
            continue;
        }
        sum += sample.gyro;
        weight += (log.meta.imu).per_rate(time.seconds_since(last.time));
        if time.seconds_since(start) >= 1.0 {
            means.push(sum / weight);
            (sum, weight, start) = (Vector3::zeros(), 0.0, time);
        }
    }
    means
}
