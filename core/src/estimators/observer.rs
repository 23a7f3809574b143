//! The exact form of the compensation estimators: every control undone, all parameters jointly.
//!
//! Equation (6) of the thesis drops `K1 dV` and `dV'`, so (7) and (8) depend on the loop. Nothing
//! need be dropped, since every control is known. An observer follows the error `[dV, Phi]` of
//! the damped INS by the exact (1)-(2), `dV' = f x Phi + C df`, `Phi' = -w_in x Phi - C dw`, with
//! the controls as known inputs: its innovations do not depend on the loops. They are linear in
//! the unknown parameters, through sensitivities that the observer propagates beside its state.
//! With gains at the noise optimum the innovations are white, so plain least squares over them
//! is what a Kalman filter with all parameters in its state would find (Friedland's separate-bias
//! estimation, IEEE TAC 14, 1969).

use nalgebra::{Const, Matrix, RawStorage, RawStorageMut, SMatrix, SVector, U1, Vector2, Vector3};

use super::information::{Information, Solved};
use super::parameters::{COUNT, PAIRS, Parameters, index};
use crate::config::Config;
use crate::history::{Moment, Past, Span};
use crate::math;

/// Longest memory of the measured noise, in fixes.
const NOISE_MEMORY: f64 = 400.0;
/// Fixes over which the likeness of neighbouring innovations is averaged: white ones then show
/// 0 +- 0.07.
const LIKENESS_MEMORY: f64 = 100.0;
/// Average likeness that is put up with.
const LIKENESS_TOLERATED: f64 = 0.1;
/// Steps of the logarithm of the roughness per fix and unit of likeness: fast up, slowly down.
const ROUGHNESS_RISE: f64 = 0.03;
const ROUGHNESS_FALL: f64 = 0.005;
const MAX_ROUGHNESS: f64 = 1e4;
/// Innovations beyond this many sigma weigh less (Huber).
const ROBUST_SIGMAS: f64 = 3.0;
/// Innovations beyond this many sigma, plus `GATE_MPS`, are refused.
const GATE_SIGMAS: f64 = 8.0;
const GATE_MPS: f64 = 3.0;

/// Error of the INS, ENU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InsError {
    /// dV, m/s.
    pub velocity_mps: Vector3<f64>,
    /// Phi, rad.
    pub tilt_rad: Vector3<f64>,
}

/// The measured difference at one fix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Velocity of the INS minus that of the fix, ENU, m/s.
    pub velocity_mps: Vector3<f64>,
    /// Whether the up component was measured.
    pub has_up: bool,
    /// Latency already taken out by the choice of the moment, s.
    pub latency_applied_s: f64,
}

/// Variances of one channel `dV' = g phi`, `phi' = white`: its Riccati recursion gives the gains.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Channel {
    velocity: f64,
    cross: f64,
    tilt: f64,
}

impl Channel {
    fn propagate(&mut self, force_up: f64, dt: f64, velocity_noise: f64, tilt_noise: f64) {
        self.velocity += force_up * (2.0 * self.cross + force_up * self.tilt)
            + velocity_noise * dt
            + tilt_noise * dt * force_up * force_up / 3.0;
        self.cross += force_up * (self.tilt + 0.5 * tilt_noise * dt);
        self.tilt += tilt_noise * dt;
    }

    /// Takes in one fix; returns the gains on velocity and tilt.
    fn update(&mut self, noise: f64) -> (f64, f64) {
        let total = self.velocity + noise;
        let (gain_velocity, gain_tilt) = (self.velocity / total, self.cross / total);
        self.tilt -= gain_tilt * self.cross;
        self.velocity *= 1.0 - gain_velocity;
        self.cross *= 1.0 - gain_velocity;
        (gain_velocity, gain_tilt)
    }
}

/// Running measurement of the innovations of one kind: variance and likeness of neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Noise {
    variance: f64,
    /// Correlation of neighbouring innovations.
    correlation: f64,
    count: f64,
    last: Vector2<f64>,
}

impl Noise {
    fn new(sigma: f64) -> Self {
        Self {
            variance: sigma * sigma,
            correlation: 0.0,
            count: 30.0,
            last: Vector2::zeros(),
        }
    }

    /// Takes one innovation of `components` (1 or 2) components.
    /// Returns how alike it and the one before are: on average 0 for white ones.
    fn measure(&mut self, innovation: &Vector2<f64>, components: f64) -> f64 {
        self.count = math::min(self.count + 1.0, NOISE_MEMORY);
        let power = innovation.norm_squared() / components;
        // A single wild innovation must not open the gate for the next.
        let bounded = math::min(power, 9.0 * self.variance);
        self.variance += (bounded - self.variance) / self.count;
        let likeness = innovation.dot(&self.last) / (components * self.variance);
        let likeness = math::max(math::min(likeness, 3.0), -3.0);
        self.correlation += (likeness - self.correlation) / self.count;
        self.last = *innovation;
        likeness
    }

    /// Factor by which colour makes rows less informative than white ones.
    fn inflation(&self) -> f64 {
        let rho = math::max(math::min(self.correlation, 0.9), 0.0);
        (1.0 + rho) / (1.0 - rho)
    }
}

/// What a unit of each parameter adds to `R` quantities.
type ByParameter<const R: usize> = SMatrix<f64, R, COUNT>;

/// Observer of the INS error and running least squares of the parameters behind it.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Observer {
    /// Known part of dV, m/s, and of the level components of Phi, rad.
    velocity: Vector3<f64>,
    tilt: Vector2<f64>,
    /// What a unit of each parameter adds to them.
    velocity_by: ByParameter<3>,
    tilt_by: ByParameter<2>,
    level: Channel,
    vertical: Channel,
    level_noise: Noise,
    vertical_noise: Noise,
    information: Information<COUNT, PAIRS>,
    /// Factor by which the tilt walks more than the noise of the gyros makes it, in variance.
    roughness: f64,
    /// Average likeness of neighbouring innovations.
    likeness: f64,
    /// Last solution.
    pub parameters: Parameters,
    /// The horizon: the moment of the last fix taken.
    last: Moment,
}

/// What became of a difference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Taken in, all of it.
    Used,
    /// Taken in but for the vertical velocity, which is missing or not credible.
    LevelUsed,
    /// Not credible.
    Outlier,
}

impl Observer {
    /// Starts at a moment, with what is believed of the parameters and of the level tilt.
    pub fn new(start: Moment, config: &Config, prior: &Parameters, tilt_sigma_rad: f64) -> Self {
        let sigma = config.gnss.velocity_sigma_mps;
        let mut observer = Self {
            velocity: Vector3::zeros(),
            tilt: Vector2::zeros(),
            velocity_by: SMatrix::zeros(),
            tilt_by: SMatrix::zeros(),
            level: Channel {
                velocity: 0.0,
                cross: 0.0,
                tilt: 0.0,
            },
            vertical: Channel {
                velocity: 0.0,
                cross: 0.0,
                tilt: 0.0,
            },
            level_noise: Noise::new(sigma),
            vertical_noise: Noise::new(sigma),
            information: Information::from_prior(&prior.value, &prior.sigma),
            roughness: 1.0,
            likeness: 0.0,
            parameters: *prior,
            last: start,
        };
        observer.restart(start, tilt_sigma_rad);
        observer
    }

    /// Forgets the state of the INS error, not the parameters: after its velocity was set anew.
    pub fn restart(&mut self, start: Moment, tilt_sigma_rad: f64) {
        self.velocity = Vector3::zeros();
        self.tilt = Vector2::zeros();
        self.velocity_by = SMatrix::zeros();
        self.tilt_by = SMatrix::zeros();
        let tilt = tilt_sigma_rad * tilt_sigma_rad;
        // A metre per second: what a first fix may be wrong by, latency included.
        self.level = Channel {
            velocity: 1.0,
            cross: 0.0,
            tilt,
        };
        self.vertical = Channel {
            velocity: 1.0,
            cross: 0.0,
            tilt: 0.0,
        };
        self.last = start;
    }

    /// Inertial samples were missing for `seconds`: what was filled in may be wrong by the rate
    /// and acceleration of an ordinary manoeuvre.
    pub fn on_hole(&mut self, seconds: f64) {
        let (rate, accel) = (0.1 * seconds, 1.0 * seconds);
        self.level.velocity += accel * accel;
        self.level.tilt += 0.01 * rate * rate;
        self.vertical.velocity += accel * accel;
        self.information.diffuse(index::AZIMUTH, rate * rate);
    }

    /// The error `[dV, Phi]` of the INS at a moment after the horizon, as estimated.
    pub fn error_at(&self, moment: &Moment) -> InsError {
        let p = &self.parameters;
        let span = Span::between(&self.last, moment);
        let level = self.whole_tilt();
        let tilt = Vector3::new(level.x, level.y, p.value(index::AZIMUTH));
        let drift = span.attitude_s * p.vector(index::GYRO);
        InsError {
            velocity_mps: self.velocity
                + self.velocity_by * p.value
                + span.control_velocity_mps
                + span.force_mps.cross(&(tilt - 0.5 * drift))
                + span.attitude_s * p.vector(index::ACCEL),
            tilt_rad: tilt + span.control_tilt_rad - drift,
        }
    }

    /// Level tilt at the horizon, known part and estimated, rad.
    fn whole_tilt(&self) -> Vector2<f64> {
        self.tilt + self.tilt_by * self.parameters.value
    }

    /// Compares the INS at a past moment with a fix. An outlier moves the horizon alone.
    pub fn take(
        &mut self,
        past: &Past,
        frame_rate_radps: &Vector3<f64>,
        difference: &Difference,
        config: &Config,
    ) -> Verdict {
        self.propagate(&past.moment, frame_rate_radps, config);
        self.update(past, difference, config)
    }

    /// Carries the observer to a later moment in a frame that turns at `frame_rate`.
    pub fn propagate(&mut self, to: &Moment, frame_rate: &Vector3<f64>, config: &Config) {
        let span = Span::between(&self.last, to);
        let (grown, grown_by) = self.tilt_growth(&span, frame_rate);
        self.propagate_velocity(&span, &grown_by);
        self.tilt += grown.xy();
        self.tilt_by += grown_by.fixed_rows::<2>(0);
        self.carry_forward(index::AZIMUTH, &grown_by.row(2).transpose(), grown.z);
        let mut drift = SVector::<f64, COUNT>::zeros();
        if let Some(by_drift) = drift.get_mut(index::CLOCK_DRIFT) {
            *by_drift = span.seconds;
        }
        self.carry_forward(index::LATENCY, &drift, 0.0);
        self.diffuse(span.force_mps.z, span.seconds, config);
        self.last = *to;
    }

    /// Growth of `Phi` over a span, `Phi' = -w_in x Phi - C dw` and the controls: known part, and
    /// by each parameter.
    fn tilt_growth(&self, span: &Span, w: &Vector3<f64>) -> (Vector3<f64>, ByParameter<3>) {
        let dt = span.seconds;
        let mut grown = span.control_tilt_rad;
        // Rotations do not commute: levelling controls on a tilted platform turn it in azimuth.
        grown.z += 0.5 * self.whole_tilt().perp(&grown.xy());
        grown.x += dt * w.z * self.tilt.y;
        grown.y -= dt * w.z * self.tilt.x;
        grown.z += dt * (w.y * self.tilt.x - w.x * self.tilt.y);

        let mut by = ByParameter::<3>::zeros();
        let (drift, turn) = (-span.attitude_s, span.attitude_s * (-span.turn_rad / dt));
        by.fixed_columns_mut::<3>(index::GYRO).copy_from(&drift);
        by.fixed_columns_mut::<3>(index::GYRO_TURN).copy_from(&turn);
        let (east, north) = (self.tilt_by.row(0), self.tilt_by.row(1));
        add_row(&mut by.row_mut(0), &north, dt * w.z);
        add_row(&mut by.row_mut(1), &east, -dt * w.z);
        add_row(&mut by.row_mut(2), &east, dt * w.y);
        add_row(&mut by.row_mut(2), &north, -dt * w.x);
        let mut azimuth = by.column_mut(index::AZIMUTH);
        azimuth += Vector3::new(-dt * w.y, dt * w.x, 0.0);
        (grown, by)
    }

    /// Growth of dV over a span, `dV' = f x Phi + C df` with `Phi` of its middle.
    fn propagate_velocity(&mut self, span: &Span, grown_by: &ByParameter<3>) {
        let force = span.force_mps;
        let tilt = Vector3::new(self.tilt.x, self.tilt.y, 0.0);
        self.velocity += force.cross(&tilt) + span.control_velocity_mps;
        // Second order, felt on the up axis alone; plus, for the force is in the tilted frame.
        self.velocity.z += 0.5 * force.z * self.whole_tilt().norm_squared();

        let mut phi_by = grown_by * 0.5;
        let mut level = phi_by.fixed_rows_mut::<2>(0);
        level += self.tilt_by;
        let mut azimuth = phi_by.column_mut(index::AZIMUTH);
        azimuth.z += 1.0;
        self.velocity_by += force.cross_matrix() * phi_by;
        let mut bias = self.velocity_by.fixed_columns_mut::<3>(index::ACCEL);
        bias += span.attitude_s;
        let attitude = span.attitude_s / span.seconds;
        let force_body = attitude.tr_mul(&force);
        let mut scale = self.velocity_by.column_mut(index::ACCEL_SCALE_X);
        scale += attitude.column(0) * force_body.x;
        let mut scale = self.velocity_by.column_mut(index::ACCEL_SCALE_Y);
        scale += attitude.column(1) * force_body.y;
    }

    /// Makes parameter `which` that of the new horizon, where it is greater by `by` times the
    /// parameters and by `known`.
    fn carry_forward(&mut self, which: usize, by: &SVector<f64, COUNT>, known: f64) {
        let mut by = *by;
        if let Some(own) = by.get_mut(which) {
            *own = 0.0;
        }
        self.information.redefine(which, &by, known);
        let change = by.dot(&self.parameters.value) + known;
        self.parameters.shift(which, change);
        let through = column(&self.velocity_by, which);
        let through_tilt = column(&self.tilt_by, which);
        self.velocity -= known * through;
        self.tilt -= known * through_tilt;
        self.velocity_by -= through * by.transpose();
        self.tilt_by -= through_tilt * by.transpose();
    }

    /// Lets everything random have walked for `dt`.
    fn diffuse(&mut self, force_up: f64, dt: f64, config: &Config) {
        let s = &config.sensors;
        let gyro = self.roughness * s.gyro_noise * s.gyro_noise;
        let accel = s.accel_noise * s.accel_noise;
        self.level.propagate(force_up, dt, accel, gyro);
        self.vertical.propagate(0.0, dt, accel, 0.0);
        self.information.diffuse(index::AZIMUTH, gyro * dt);
        let walk = self.roughness * s.gyro_bias_walk * s.gyro_bias_walk * dt;
        let accel_walk = s.accel_bias_walk * s.accel_bias_walk * dt;
        for axis in 0..3 {
            self.information.diffuse(index::GYRO + axis, walk);
            self.information.diffuse(index::ACCEL + axis, accel_walk);
        }
    }

    /// Likeness of neighbouring innovations means that the INS errs by more than the noise of
    /// its gyros (vibration, misalignment, sensitivity to g): the observer has to follow faster.
    fn learn_roughness(&mut self, likeness: f64) {
        self.likeness += (likeness - self.likeness) / LIKENESS_MEMORY;
        let excess = self.likeness - LIKENESS_TOLERATED;
        let gain = if excess > 0.0 {
            ROUGHNESS_RISE
        } else {
            ROUGHNESS_FALL
        };
        let roughness = self.roughness * (1.0 + gain * excess);
        self.roughness = math::max(math::min(roughness, MAX_ROUGHNESS), 1.0);
    }

    fn update(&mut self, past: &Past, difference: &Difference, config: &Config) -> Verdict {
        let innovation = difference.velocity_mps + difference.latency_applied_s * past.accel_mps2
            - self.velocity;
        let mut by = self.velocity_by;
        let mut latency = by.column_mut(index::LATENCY);
        latency += past.accel_mps2;
        // INS minus GNSS: the antenna moves by C' l more than the sensors.
        let mut lever = by.fixed_columns_mut::<2>(index::LEVER_ARM);
        lever -= past.attitude_rate.fixed_columns::<2>(0);

        let residual = innovation - by * self.parameters.value;
        let sigma = math::sqrt(self.level_noise.variance + self.level.velocity);
        let level_residual = residual.xy().norm();
        if level_residual > GATE_SIGMAS * sigma + GATE_MPS {
            return Verdict::Outlier;
        }
        let weight = math::min(1.0, ROBUST_SIGMAS * sigma / level_residual);
        self.correct_level(&innovation, &by, weight, config);
        let likeness = self.level_noise.measure(&residual.xy(), 2.0);
        self.learn_roughness(likeness);
        if difference.has_up && self.correct_vertical(&innovation, &by, residual.z, config) {
            Verdict::Used
        } else {
            Verdict::LevelUsed
        }
    }

    fn correct_level(
        &mut self,
        innovation: &Vector3<f64>,
        by: &ByParameter<3>,
        weight: f64,
        config: &Config,
    ) {
        let floor = 0.01 * config.gnss.velocity_sigma_mps * config.gnss.velocity_sigma_mps;
        let predicted = self.level.velocity;
        let noise = math::max(
            self.level_noise.variance - predicted,
            0.5 * self.level_noise.variance,
        );
        let noise = math::max(noise, floor) / weight;
        let row_weight = 1.0 / (predicted + noise);
        for axis in 0..2 {
            let row = by.row(axis).transpose();
            self.information.add(
                &row,
                innovation.get(axis).copied().unwrap_or(0.0),
                row_weight,
            );
        }
        let (gain, tilt_gain) = self.level.update(noise);
        let level = by.fixed_rows::<2>(0);
        self.velocity.x += gain * innovation.x;
        self.velocity.y += gain * innovation.y;
        add_row(&mut self.velocity_by.row_mut(0), &level.row(0), -gain);
        add_row(&mut self.velocity_by.row_mut(1), &level.row(1), -gain);
        // dV_N' = g Phi_E and dV_E' = -g Phi_N.
        self.tilt.x += tilt_gain * innovation.y;
        self.tilt.y -= tilt_gain * innovation.x;
        add_row(&mut self.tilt_by.row_mut(0), &level.row(1), -tilt_gain);
        add_row(&mut self.tilt_by.row_mut(1), &level.row(0), tilt_gain);
    }

    /// Returns whether the vertical velocity was credible.
    fn correct_vertical(
        &mut self,
        innovation: &Vector3<f64>,
        by: &ByParameter<3>,
        residual: f64,
        config: &Config,
    ) -> bool {
        let sigma = math::sqrt(self.vertical_noise.variance + self.vertical.velocity);
        if math::max(residual, -residual) > GATE_SIGMAS * sigma + GATE_MPS {
            // Refused again and again, it is the INS that errs: the gate opens.
            self.vertical.velocity *= 2.0;
            return false;
        }
        let weight = math::min(1.0, ROBUST_SIGMAS * sigma / math::max(residual, -residual));
        let floor = 0.01 * config.gnss.velocity_sigma_mps * config.gnss.velocity_sigma_mps;
        let predicted = self.vertical.velocity;
        let noise = math::max(
            self.vertical_noise.variance - predicted,
            0.5 * self.vertical_noise.variance,
        );
        let noise = math::max(noise, floor) / weight;
        let row = by.row(2).transpose();
        self.information
            .add(&row, innovation.z, 1.0 / (predicted + noise));
        let (gain, _) = self.vertical.update(noise);
        self.velocity.z += gain * innovation.z;
        add_row(&mut self.velocity_by.row_mut(2), &by.row(2), -gain);
        let _ = self
            .vertical_noise
            .measure(&Vector2::new(residual, 0.0), 1.0);
        true
    }

    /// Solves for the parameters; keeps the last solution if the equations are singular.
    pub fn solve(&mut self) {
        if let Some(Solved { value, variance }) = self.information.solve() {
            let inflation = self.level_noise.inflation();
            self.parameters.value = value;
            self.parameters.sigma = variance.map(|v| math::sqrt(v * inflation));
        }
    }

    /// Latency `seconds` before the horizon, s.
    pub fn latency_before(&self, seconds: f64) -> Option<(f64, f64)> {
        let mut coefficients = SVector::<f64, COUNT>::zeros();
        if let Some(now) = coefficients.get_mut(index::LATENCY) {
            *now = 1.0;
        }
        if let Some(drift) = coefficients.get_mut(index::CLOCK_DRIFT) {
            *drift = -seconds;
        }
        let (value, variance) = self.information.combination(&coefficients)?;
        Some((value, math::sqrt(variance * self.level_noise.inflation())))
    }

    /// Adds a direct measurement of one parameter.
    pub fn measure(&mut self, parameter: usize, value: f64, variance: f64) {
        self.information.add_direct(parameter, value, variance);
    }

    /// Makes the present solution, with `sigma`, all that is known: the equations were linear
    /// about values that have since moved far.
    pub fn relinearize(&mut self, sigma: &SVector<f64, COUNT>) {
        self.information = Information::from_prior(&self.parameters.value, sigma);
    }
}

/// Adds `factor` times one row to another.
fn add_row<A, B>(
    to: &mut Matrix<f64, U1, Const<COUNT>, A>,
    from: &Matrix<f64, U1, Const<COUNT>, B>,
    factor: f64,
) where
    A: RawStorageMut<f64, U1, Const<COUNT>>,
    B: RawStorage<f64, U1, Const<COUNT>>,
{
    for (to, from) in to.iter_mut().zip(from.iter()) {
        *to += factor * from;
    }
}

/// One column; zeros if there is none.
fn column<const R: usize, const C: usize>(
    matrix: &SMatrix<f64, R, C>,
    which: usize,
) -> SVector<f64, R> {
    SVector::from_fn(|row, _| matrix.get((row, which)).copied().unwrap_or(0.0))
}
