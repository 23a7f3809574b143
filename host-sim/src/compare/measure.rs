//! Accuracy and settling time of a method.

use ins_core::Solution;
use ins_core::earth::wrap_pi;
use serde::Serialize;

use super::tracks::{Input, Point, Track};
use crate::identify::against_truth::truth_at;
use crate::identify::quantities::{Quantities, Quantity, latency_of_log};
use crate::log::{Grade, Log, Meta};
use crate::statistics::root_mean;

/// Compared quantities: key, title and unit; the heading, and all estimates except the azimuth error.
pub const COMPARED: [(&str, &str, &str); 8] = [
    ("heading_deg", "Heading", "deg"),
    ("accel_bias_x_mg", "Accelerometer x", "mg"),
    ("accel_bias_y_mg", "Accelerometer y", "mg"),
    ("accel_bias_z_mg", "Accelerometer z", "mg"),
    ("gyro_bias_x_deg_h", "Gyro x", "deg/h"),
    ("gyro_bias_y_deg_h", "Gyro y", "deg/h"),
    ("gyro_bias_z_deg_h", "Gyro z", "deg/h"),
    ("gnss_latency_ms", "GNSS latency", "ms"),
];
/// Errors below which a quantity counts as settled, in its unit: two to three times the specification of
/// ring lasers, and the residuals of a good calibration of consumer sensors.
const SETTLED_HG1700: [f64; 8] = [0.06, 0.08, 0.08, 0.08, 0.5, 0.5, 0.5, 2.0];
const SETTLED_MEMS: [f64; 8] = [0.5, 2.0, 2.0, 2.0, 30.0, 30.0, 30.0, 10.0];

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MethodResult {
    pub method: String,
    pub quantities: Vec<QuantityResult>,
    /// Its navigation against the reference of the log, over the second half.
    pub trajectory: Option<TrajectoryError>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct QuantityResult {
    pub name: &'static str,
    /// Value and stated sigma; empty where it was not observed.
    #[serde(flatten)]
    pub quantity: Quantity,
    /// Value minus truth, where that is known.
    pub error: Option<f64>,
    /// Settling time from the first sample: from then on near the truth, or, where that is unknown, near the
    /// last value. None for methods whose estimates come only at the end of the log.
    pub settled_s: Option<f64>,
}

/// RMS errors; of the position horizontal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TrajectoryError {
    pub position_m: f64,
    pub velocity_mps: f64,
    pub heading_deg: f64,
}

pub fn results(input: &Input, grade: Grade, tracks: &[Track]) -> Vec<MethodResult> {
    tracks
        .iter()
        .map(|track| MethodResult {
            method: track.method.clone(),
            quantities: quantities(input, grade, track),
            trajectory: trajectory(input.log, track),
        })
        .collect()
}

/// Values in the log's axes and in engineering units, heading first.
pub fn columns(input_axes: crate::log::BodyAxes, point: &Point) -> [Quantity; 8] {
    let mut columns = Quantities::new(&point.estimates, input_axes)
        .columns()
        .map(|(_, quantity)| quantity);
    let heading_deg = point.solution.euler().heading_rad.to_degrees();
    columns[0].value = heading_deg.rem_euclid(360.0);
    columns
}

/// The same of a log, with the latency that was removed from the stamps of its fixes before.
pub(crate) fn columns_of_log(meta: &Meta, point: &Point) -> [Quantity; 8] {
    let mut columns = columns(meta.body_axes, point);
    columns[7] = latency_of_log(&point.estimates.gnss_latency_s, meta);
    columns
}

fn quantities(input: &Input, grade: Grade, track: &Track) -> Vec<QuantityResult> {
    let Some(end) = track.points.last() else {
        return Vec::new();
    };
    let tolerances = match grade {
        Grade::Hg1700 => SETTLED_HG1700,
        Grade::Mems => SETTLED_MEMS,
    };
    let ends = columns_of_log(&input.log.meta, end);
    (0..COMPARED.len())
        .map(|which| {
            let error = |point: &Point| error(input, point, which);
            QuantityResult {
                name: COMPARED[which].0,
                quantity: ends[which],
                error: error(end).filter(|_| ends[which].observable()),
                settled_s: settled(input, track, which, tolerances[which]),
            }
        })
        .collect()
}

/// Value minus truth in the unit of the quantity.
fn error(input: &Input, point: &Point, which: usize) -> Option<f64> {
    let truth = input.truth?;
    if which == 0 {
        let truth = truth_at(&input.log.truth, point.time)?;
        return Some(heading_error_deg(&point.solution, &truth));
    }
    let value = columns_of_log(&input.log.meta, point)[which].value;
    Some(value - truth.columns()[which]?)
}

fn settled(input: &Input, track: &Track, which: usize, tolerance: f64) -> Option<f64> {
    let axes = input.log.meta.body_axes;
    let end = columns(axes, track.points.last()?)[which];
    // The heading moves all the time: without truth it cannot settle.
    if !track.online || !end.observable() || (which == 0 && input.truth.is_none()) {
        return None;
    }
    let error_of = |point: &Point| match input.truth {
        Some(_) => error(input, point, which),
        None => Some(columns(axes, point)[which].value - end.value),
    };
    let is_settled = |point: &&Point| error_of(point).is_none_or(|error| error.abs() < tolerance);
    let since = track.points.iter().rev().take_while(is_settled).last()?;
    let first = input.log.imu.first()?;
    Some(since.time.seconds_since(first.time))
}

fn trajectory(log: &Log, track: &Track) -> Option<TrajectoryError> {
    let half = log.imu.first()?.time.plus_seconds(0.5 * log.duration_s());
    let squares = |point: &Point| {
        let (solution, truth) = (&point.solution, truth_at(&log.truth, point.time)?);
        let position = solution.position.enu_from(&truth.position).xy();
        let velocity = solution.velocity_enu_mps - truth.velocity_enu_mps;
        let heading_deg = heading_error_deg(solution, &truth);
        Some([
            position.norm_squared(),
            velocity.norm_squared(),
            heading_deg.powi(2),
        ])
    };
    let second_half = track.points.iter().filter(|point| point.time >= half);
    let all: Vec<[f64; 3]> = second_half.filter_map(squares).collect();
    let rms = |which: usize| root_mean(all.iter().map(|squares| squares[which]));
    (!all.is_empty()).then(|| TrajectoryError {
        position_m: rms(0),
        velocity_mps: rms(1),
        heading_deg: rms(2),
    })
}

fn heading_error_deg(solution: &Solution, truth: &Solution) -> f64 {
    wrap_pi(solution.euler().heading_rad - truth.euler().heading_rad).to_degrees()
}
