//! The Schuler oscillation: a long free flight with constant biases against (1)-(2).

use nalgebra::{Matrix4, Vector2, Vector3, Vector4};
use serde::Serialize;

use super::linear::{Agreement, LinearModel};
use super::route::Route;
use super::run::RunError;
use super::sensors::{Intervals, STEP_S, Sensors};
use crate::identify::baro_aided_ins::BaroAidedIns;
use crate::sim::ErrorModel;
use crate::sim::drive::IMU_HZ;
use ins_core::config::Config;
use ins_core::earth::LocalEarth;

/// Duration: two periods, min.
const MINUTES: u32 = 170;
/// Samples between points of the curves.
const EVERY: u32 = 1000;
/// Range of the period search, min.
const PERIODS_MIN: [f64; 2] = [60.0, 120.0];

/// Fit of constant, trend and one sine in each channel, with one period for both; amplitudes of the sines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Oscillation {
    pub period_min: f64,
    pub east_mps: f64,
    pub north_mps: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Schuler {
    pub minutes: u32,
    /// Gyro biases, right, forward, up.
    pub gyro_bias_deg_h: [f64; 3],
    pub accel_bias_mps2: [f64; 3],
    /// `2 pi sqrt(R/g)`, min.
    pub period_min: f64,
    /// Of the INS.
    pub ins: Oscillation,
    /// Of (1)-(2).
    pub model: Oscillation,
    /// Of (1)-(2) with the rotation of the frame.
    pub rotating_model: Oscillation,
    /// RMS difference of (1)-(2) from the INS over RMS error of the INS.
    pub model_difference: f64,
    /// The same with the rotation of the frame.
    pub rotating_model_difference: f64,
    #[serde(skip)]
    pub curves: Vec<Point>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Since the start, s.
    pub time_s: f64,
    /// Velocity errors of the INS, of (1)-(2), and of these with the rotation of the frame.
    pub errors_mps: [Vector2<f64>; 3],
}

/// Straight flight with the biases of a seed and no noise, levelled at the start with the biased
/// accelerometers.
pub fn schuler(seed: u64, route: &Route, errors: &ErrorModel) -> Result<Schuler, RunError> {
    let flight_error = |error| RunError::Flight { seed, error };
    let flight = route
        .straight(seed, 60.0 * f64::from(MINUTES))
        .map_err(flight_error)?;
    let origin = route.plan().start.position;
    let mut sensors = Sensors::new(flight, origin, errors, seed);
    let [gyro, accel] = sensors.biases();
    let mut start = *sensors.truth();
    let earth = LocalEarth::at(origin.latitude_rad, origin.height_m);
    let accel_enu = start.attitude * accel;
    let tilt_rad = Vector3::new(-accel_enu.y, accel_enu.x, 0.0) / earth.gravity_mps2;
    start.attitude = nalgebra::UnitQuaternion::from_scaled_axis(-tilt_rad) * start.attitude;

    let mut ins = BaroAidedIns::new(&start);
    let mut models = LinearModel::both(&start, sensors.truth());
    let (mut intervals, damping) = (Intervals::default(), Config::hg1700().damping);
    let mut curves = Vec::new();
    for count in 1..=MINUTES * 6000 {
        let step = sensors.step();
        let interval = intervals.of(&step.ideal).without_bias(&-gyro, &-accel);
        ins.step(&interval, step.before.solution.position.height_m, &damping);
        for model in &mut models {
            model.step(&step, sensors.truth(), &(STEP_S * gyro), &(STEP_S * accel));
        }
        if count.is_multiple_of(EVERY) {
            let error = ins.velocity_error_mps(sensors.truth());
            for model in &mut models {
                model.compare(&error);
            }
            let [printed, rotating] = models.map(|model| model.velocity_mps.xy());
            curves.push(Point {
                time_s: f64::from(count) / IMU_HZ,
                errors_mps: [error, printed, rotating],
            });
        }
    }
    let [ins, model, rotating_model] = [0, 1, 2].map(|which| {
        let errors = curves.iter().map(|p| (p.time_s, p.errors_mps[which]));
        oscillation(&errors.collect::<Vec<_>>())
    });
    let [model_difference, rotating_model_difference] =
        models.map(|model| Agreement::relative([model.agreement].iter()));
    Ok(Schuler {
        minutes: MINUTES,
        gyro_bias_deg_h: gyro.map(|rate| rate.to_degrees() * 3600.0).into(),
        accel_bias_mps2: accel.into(),
        period_min: std::f64::consts::TAU * f64::sqrt(earth.north_radius_m / earth.gravity_mps2)
            / 60.0,
        ins,
        model,
        rotating_model,
        model_difference,
        rotating_model_difference,
        curves,
    })
}

/// Fits velocity errors, m/s over s, by least squares with a fine scan of the period: there are local minima.
pub(crate) fn oscillation(errors: &[(f64, Vector2<f64>)]) -> Oscillation {
    let [low, high] = PERIODS_MIN;
    let steps = 1200;
    (0..=steps)
        .filter_map(|i| {
            let period_min = low + (high - low) * f64::from(i) / f64::from(steps);
            let (east_mps, east_square) = sine(errors, period_min, 0)?;
            let (north_mps, north_square) = sine(errors, period_min, 1)?;
            let oscillation = Oscillation {
                period_min,
                east_mps,
                north_mps,
            };
            Some((oscillation, east_square + north_square))
        })
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map_or_else(Oscillation::default, |(oscillation, _)| oscillation)
}

/// Amplitude of a sine of this period, fitted with a constant and a trend, and the sum of squared
/// residuals.
fn sine(errors: &[(f64, Vector2<f64>)], period_min: f64, axis: usize) -> Option<(f64, f64)> {
    let (mut normal, mut right, mut square) = (Matrix4::zeros(), Vector4::zeros(), 0.0);
    for (time_s, error) in errors {
        let turns = time_s / (60.0 * period_min);
        let (sin, cos) = libm::sincos(std::f64::consts::TAU * turns);
        let (row, y) = (Vector4::new(1.0, turns, sin, cos), error[axis]);
        normal += row * row.transpose();
        right += y * row;
        square += y * y;
    }
    let fit = normal.cholesky()?.solve(&right);
    Some((libm::hypot(fit.z, fit.w), square - fit.dot(&right)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_period_and_amplitudes() {
        let errors: Vec<(f64, Vector2<f64>)> = (0..1020)
            .map(|i| {
                let time_s = 10.0 * f64::from(i);
                let phase = std::f64::consts::TAU * time_s / (60.0 * 84.4);
                let error = Vector2::new(
                    3.0 + 5.0 * libm::sin(phase + 0.3),
                    1e-3 * time_s - 7.0 * libm::cos(phase),
                );
                (time_s, error)
            })
            .collect();
        let found = oscillation(&errors);
        // The step of the scan is 0.05 min.
        assert!((found.period_min - 84.4).abs() < 0.03, "{found:?}");
        assert!((found.east_mps - 5.0).abs() < 0.01, "{found:?}");
        assert!((found.north_mps - 7.0).abs() < 0.01, "{found:?}");
    }
}
