//! The likelihood of a drive under an error model of its gyros: a Kalman filter over
//! thesis equation (1) with the biases of (3) or (4).
//!
//! Constants and trends of the biases start without knowledge, so that the likelihood is the
//! restricted one (REML): it says nothing of their spread and does not bias the other variances.

use nalgebra::{SMatrix, SVector, Vector3};

use super::interval::Measured;
use super::record::{Difference, Epoch, Record};
use crate::sim::errors::Law;

/// Velocity error, tilt, constant, trend and random part of the biases.
const VELOCITY: usize = 0;
const TILT: usize = 2;
const CONSTANT: usize = 5;
const TREND: usize = 8;
const RANDOM: usize = 11;
const SIZE: usize = 14;

type Vector = SVector<f64, SIZE>;
type Matrix = SMatrix<f64, SIZE, SIZE>;

/// What is believed at the start: m/s, rad, and rad/s for a constant and for what a trend
/// does over a drive (100 deg/h: nothing, beside what a drive tells).
const VELOCITY_SIGMA: f64 = 1.0;
const LEVEL_SIGMA: f64 = 0.01;
const AZIMUTH_SIGMA: f64 = 0.05;
const BIAS_SIGMA: f64 = 5e-4;

/// How the random part of a gyro bias moves. SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dynamics {
    /// Jumps at whole multiples of an interval since the start of the log, or exponentially
    /// correlated.
    pub law: Law,
    /// Spread of a jump, or standard deviation, rad/s.
    pub size: f64,
    /// Interval, or correlation time, s.
    pub time_s: f64,
}

impl Dynamics {
    /// What the trend of a bias is multiplied by: jumps so far, or time.
    fn trend_at(&self, time_s: f64) -> f64 {
        match self.law {
            Law::Wave => (time_s / self.time_s).floor(),
            Law::Continuous => time_s,
        }
    }

    /// Part of an epoch that lies before a jump; none without one.
    fn jump_in(&self, epoch: &Epoch) -> Option<f64> {
        if self.law == Law::Continuous {
            return None;
        }
        let jump_s = self.time_s * self.trend_at(epoch.start_s + epoch.seconds);
        let part = (jump_s - epoch.start_s) / epoch.seconds;
        (part > 0.0 && epoch.rest_rate_radps.is_none()).then_some(part)
    }

    /// Variance at the time 0.
    fn initial_variance(&self) -> f64 {
        match self.law {
            Law::Wave => 0.0,
            Law::Continuous => self.size * self.size,
        }
    }

    /// From one time to a later one: what part is kept, and the variance that is added.
    fn step(&self, from_s: f64, to_s: f64) -> (f64, f64) {
        match self.law {
            Law::Wave => {
                let jumps = self.trend_at(to_s) - self.trend_at(from_s);
                (1.0, jumps * self.size * self.size)
            }
            Law::Continuous => {
                let keep = libm::exp((from_s - to_s) / self.time_s);
                (keep, self.size * self.size * (1.0 - keep * keep))
            }
        }
    }
}

/// A candidate error model of the gyros. SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Root of the noise density of a gyro, rad/sqrt(s).
    pub gyro_noise: f64,
    /// Root of the noise density of an accelerometer, m/s/sqrt(s).
    pub accel_noise: f64,
    /// Noise of one GNSS velocity component, m/s.
    pub gnss_sigma_mps: f64,
    /// Random part of the gyro biases.
    pub dynamics: Dynamics,
}

/// What a drive says under a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// Logarithm of the restricted likelihood, up to a constant.
    pub log_likelihood: f64,
    /// Constants of the biases, body axes, rad/s.
    pub constants: [Measured; 3],
    /// Trends, rad/s per second or per jump.
    pub trends: [Measured; 3],
    /// Covariance of the two.
    covariances: [f64; 3],
    /// What a trend was believed to be before, one sigma.
    trend_sigma: f64,
}

impl Answer {
    /// Log-likelihood with constants and trends drawn as a model says, instead of unknown.
    pub fn marginal(&self, constant_sigma: f64, trend_mean: f64, trend_sigma: f64) -> f64 {
        let axis = |axis: usize| {
            let (constant, trend) = (self.constants[axis], self.trends[axis]);
            let (x, y) = (constant.value, trend.value - trend_mean);
            let xx = constant.variance + constant_sigma * constant_sigma;
            let yy = trend.variance + trend_sigma * trend_sigma;
            let xy = self.covariances[axis];
            let determinant = xx * yy - xy * xy;
            let square = (yy * x * x - 2.0 * xy * x * y + xx * y * y) / determinant;
            // The density of what was believed before, which is flat.
            let before = libm::log(BIAS_SIGMA * self.trend_sigma);
            before - 0.5 * (libm::log(determinant) + square)
        };
        self.log_likelihood + (0..3).map(axis).sum::<f64>()
    }
}

/// Filters a drive.
pub fn filter(record: &Record, candidate: &Candidate) -> Answer {
    let mut state = State::new(record, candidate);
    for epoch in &record.epochs {
        match candidate.dynamics.jump_in(epoch) {
            Some(part) => {
                let (before, after) = epoch.split(part);
                state.take(&before, candidate);
                state.take(&after, candidate);
            }
            None => state.take(epoch, candidate),
        }
    }
    let measured = |first: usize, offset: Vector3<f64>| {
        [0, 1, 2].map(|axis| Measured {
            value: offset[axis] + state.mean[first + axis],
            variance: state.covariance[(first + axis, first + axis)],
        })
    };
    Answer {
        log_likelihood: state.log_likelihood,
        constants: measured(CONSTANT, record.gyro_reference_radps),
        trends: measured(TREND, Vector3::zeros()),
        covariances: [0, 1, 2].map(|axis| state.covariance[(CONSTANT + axis, TREND + axis)]),
        trend_sigma: trend_sigma(record, &candidate.dynamics),
    }
}

/// Not by whole jumps: one more at the very end must not make the model likelier.
fn trend_sigma(record: &Record, dynamics: &Dynamics) -> f64 {
    let unit_s = match dynamics.law {
        Law::Wave => dynamics.time_s,
        Law::Continuous => 1.0,
    };
    BIAS_SIGMA * unit_s / record.duration_s.max(1.0)
}

struct State {
    time_s: f64,
    mean: Vector,
    covariance: Matrix,
    log_likelihood: f64,
}

impl State {
    fn new(record: &Record, candidate: &Candidate) -> Self {
        let mut sigma = Vector::zeros();
        sigma.fixed_rows_mut::<2>(VELOCITY).fill(VELOCITY_SIGMA);
        sigma.fixed_rows_mut::<2>(TILT).fill(LEVEL_SIGMA);
        sigma[TILT + 2] = AZIMUTH_SIGMA;
        sigma.fixed_rows_mut::<3>(CONSTANT).fill(BIAS_SIGMA);
        sigma
            .fixed_rows_mut::<3>(TREND)
            .fill(trend_sigma(record, &candidate.dynamics));
        let mut covariance = Matrix::from_diagonal(&sigma.component_mul(&sigma));
        for axis in RANDOM..SIZE {
            covariance[(axis, axis)] = candidate.dynamics.initial_variance();
        }
        Self {
            time_s: 0.0,
            mean: Vector::zeros(),
            covariance,
            log_likelihood: 0.0,
        }
    }

    fn take(&mut self, epoch: &Epoch, candidate: &Candidate) {
        let middle_s = epoch.start_s + 0.5 * epoch.seconds;
        self.move_biases(middle_s, &candidate.dynamics);
        if epoch.broken {
            self.lose_attitude();
            return;
        }
        if let Some(difference) = &epoch.difference {
            self.measure_velocity(difference, candidate.gnss_sigma_mps);
        }
        let trend = candidate.dynamics.trend_at(middle_s);
        let noise = candidate.gyro_noise * candidate.gyro_noise;
        if let Some(rate) = &epoch.rest_rate_radps {
            self.measure_biases(rate, trend, noise / epoch.seconds);
        }
        self.propagate(epoch, trend);
        self.diffuse(epoch, noise * epoch.seconds, candidate.accel_noise);
    }

    /// Noise of the sensors over an epoch: what the tilt has walked, and velocity with it. At rest
    /// the turning of the platform is known, noise and all.
    fn diffuse(&mut self, epoch: &Epoch, walked: f64, accel_noise: f64) {
        for axis in VELOCITY..VELOCITY + 2 {
            self.covariance[(axis, axis)] += accel_noise * accel_noise * epoch.seconds;
        }
        if epoch.rest_rate_radps.is_some() {
            return;
        }
        let by_tilt = [0, 1].map(|axis| force_by_tilt(&epoch.force_mps, axis));
        for axis in 0..3 {
            self.covariance[(TILT + axis, TILT + axis)] += walked;
        }
        for (axis, by) in by_tilt.iter().enumerate() {
            for tilt in 0..3 {
                self.covariance[(VELOCITY + axis, TILT + tilt)] += 0.5 * walked * by[tilt];
                self.covariance[(TILT + tilt, VELOCITY + axis)] += 0.5 * walked * by[tilt];
            }
            for (other, by_other) in by_tilt.iter().enumerate() {
                self.covariance[(VELOCITY + axis, VELOCITY + other)] +=
                    walked / 3.0 * by.dot(by_other);
            }
        }
    }

    /// Carries the random part of the biases on; by `(1 - keep)` of it forgotten.
    fn move_biases(&mut self, to_s: f64, dynamics: &Dynamics) {
        let (keep, variance) = dynamics.step(self.time_s, to_s);
        self.time_s = to_s;
        if keep < 1.0 {
            for axis in RANDOM..SIZE {
                self.mean[axis] *= keep;
                self.covariance.row_mut(axis).scale_mut(keep);
                self.covariance.column_mut(axis).scale_mut(keep);
            }
        }
        for axis in RANDOM..SIZE {
            self.covariance[(axis, axis)] += variance;
        }
    }

    /// After a hole velocity and attitude begin anew; the biases go on.
    fn lose_attitude(&mut self) {
        for axis in VELOCITY..CONSTANT {
            self.mean[axis] = 0.0;
            self.covariance.row_mut(axis).fill(0.0);
            self.covariance.column_mut(axis).fill(0.0);
            let sigma = match axis {
                TILT.. if axis == TILT + 2 => AZIMUTH_SIGMA,
                TILT.. => LEVEL_SIGMA,
                _ => VELOCITY_SIGMA,
            };
            self.covariance[(axis, axis)] = sigma * sigma;
        }
    }

    /// `dV` at the fixes: that of the start and what the tilt has made of the force since.
    fn measure_velocity(&mut self, difference: &Difference, sigma_mps: f64) {
        let force = &difference.force_mps;
        let variance = sigma_mps * sigma_mps / difference.fixes;
        for axis in 0..2 {
            let mut row = Vector::zeros();
            row[VELOCITY + axis] = 1.0;
            row.fixed_rows_mut::<3>(TILT)
                .copy_from(&force_by_tilt(force, axis));
            self.measure(&row, difference.velocity_mps[axis], variance);
        }
    }

    /// Gyros of a vehicle at rest read their biases.
    fn measure_biases(&mut self, rate_radps: &Vector3<f64>, trend: f64, variance: f64) {
        for axis in 0..3 {
            let mut row = Vector::zeros();
            row[CONSTANT + axis] = 1.0;
            row[TREND + axis] = trend;
            row[RANDOM + axis] = 1.0;
            self.measure(&row, rate_radps[axis], variance);
        }
    }

    fn measure(&mut self, row: &Vector, measured: f64, noise: f64) {
        let mut gain = Vector::zeros();
        for (column, factor) in row.iter().enumerate().filter(|(_, factor)| **factor != 0.0) {
            gain.axpy(*factor, &self.covariance.column(column), 1.0);
        }
        let variance = row.dot(&gain) + noise;
        let innovation = measured - row.dot(&self.mean);
        self.mean += gain * (innovation / variance);
        self.covariance.ger(-1.0 / variance, &gain, &gain, 1.0);
        self.log_likelihood -= 0.5 * (libm::log(variance) + innovation * innovation / variance);
    }

    /// `dV' = f x Phi`, `Phi' = -w x Phi - C dw`, and the known controls.
    fn propagate(&mut self, epoch: &Epoch, trend: f64) {
        let at_rest = epoch.rest_rate_radps.is_some();
        let turn = -epoch.seconds * epoch.frame_rate_radps.cross_matrix();
        let apply = |columns: &Matrix| {
            let mut out = *columns;
            for axis in 0..2 {
                add_columns(
                    &mut out,
                    VELOCITY + axis,
                    columns,
                    &force_by_tilt(&epoch.force_mps, axis),
                );
            }
            for axis in 0..3 {
                let by_tilt = turn.row(axis).transpose();
                add_columns(&mut out, TILT + axis, columns, &by_tilt);
            }
            if !at_rest {
                for other in 0..3 {
                    let bias = columns.column(CONSTANT + other)
                        + trend * columns.column(TREND + other)
                        + columns.column(RANDOM + other);
                    for axis in 0..3 {
                        let by_bias = -epoch.attitude_s[(axis, other)];
                        out.column_mut(TILT + axis).axpy(by_bias, &bias, 1.0);
                    }
                    // Half of the tilt that the epoch adds is felt in it.
                    let grown = -0.5 * epoch.attitude_s.column(other);
                    for axis in 0..2 {
                        let by_bias = force_by_tilt(&epoch.force_mps, axis).dot(&grown);
                        out.column_mut(VELOCITY + axis).axpy(by_bias, &bias, 1.0);
                    }
                }
            }
            out
        };
        // `P F'`, then the same on its transpose: `F P F'`.
        self.covariance = apply(&apply(&self.covariance).transpose());

        let tilt: Vector3<f64> = self.mean.fixed_rows::<3>(TILT).into();
        let part = |first: usize| -> Vector3<f64> { self.mean.fixed_rows::<3>(first).into() };
        let bias = part(CONSTANT) + trend * part(TREND) + part(RANDOM);
        // What the gyros read at rest is what turns the platform until it is set back.
        let grown = -epoch.attitude_s * epoch.rest_rate_radps.unwrap_or(bias);
        let gained =
            (epoch.force_mps.cross(&(tilt + 0.5 * grown))).xy() + epoch.velocity_control_mps;
        let mut turned = turn * tilt + epoch.tilt_control_rad;
        if !at_rest {
            turned += grown;
        }
        let mut velocity = self.mean.fixed_rows_mut::<2>(VELOCITY);
        velocity += gained;
        let mut tilt = self.mean.fixed_rows_mut::<3>(TILT);
        tilt += turned;
    }
}

/// East (0) or north (1) component of `f x Phi` by Phi.
fn force_by_tilt(force: &Vector3<f64>, axis: usize) -> Vector3<f64> {
    match axis {
        0 => Vector3::new(0.0, -force.z, force.y),
        _ => Vector3::new(force.z, 0.0, -force.x),
    }
}

/// Adds to a column what the tilt columns make it gain.
fn add_columns(out: &mut Matrix, to: usize, columns: &Matrix, by_tilt: &Vector3<f64>) {
    for (tilt, by) in by_tilt.iter().enumerate().filter(|(_, by)| **by != 0.0) {
        out.column_mut(to)
            .axpy(*by, &columns.column(TILT + tilt), 1.0);
    }
}
