//! Inertial samples as rates, whatever the log holds.

use ins_core::ImuOutput;
use nalgebra::Vector3;

use super::Log;
use super::curve::Curve;
use super::typical::{median, median_interval_s};

/// An inertial sample as rates, whatever the log holds.
#[derive(Clone, Copy)]
pub(super) struct Rate {
    pub(super) time_s: f64,
    pub(super) interval_s: f64,
    pub(super) gyro_radps: Vector3<f64>,
    pub(super) accel_mps2: Vector3<f64>,
}

/// Start of a log's own clock: differences from it are exact enough in f64.
pub(super) fn origin(log: &Log) -> ins_core::Time {
    log.imu[0].time
}

/// Samples as rates, seconds from the first one.
pub(super) fn rates(log: &Log) -> Vec<Rate> {
    let typical = median_interval_s(log.imu.iter().map(|sample| sample.time));
    let mut last = None;
    log.imu
        .iter()
        .map(|sample| {
            let since = last
                .replace(sample.time)
                .map(|last| sample.time.seconds_since(last));
            let interval_s = since.unwrap_or(typical);
            let scale = match log.meta.imu {
                ImuOutput::Rates => 1.0,
                ImuOutput::Increments => 1.0 / interval_s,
            };
            Rate {
                time_s: sample.time.seconds_since(origin(log)),
                interval_s,
                gyro_radps: sample.gyro * scale,
                accel_mps2: sample.accel * scale,
            }
        })
        .collect()
}

/// Median specific force, axis by axis: the few seconds of spikes and manoeuvres do not count.
pub(super) fn typical_force(rates: &[Rate]) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| median(rates.iter().map(|rate| rate.accel_mps2[axis])))
}

/// Time and angle turned so far about the typical direction of the specific force.
pub(super) fn vertical_angles(rates: &[Rate]) -> Curve {
    let up = typical_force(rates).normalize();
    let mut angle = 0.0;
    let points = rates.iter().map(|rate| {
        angle += rate.gyro_radps.dot(&up) * rate.interval_s;
        (rate.time_s, angle)
    });
    Curve::new(&points.collect::<Vec<_>>())
}
