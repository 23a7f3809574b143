//! Gains of the observer: Riccati recursion of one channel.
//!
//! Five states of one axis: errors of position, velocity and tilt, and the correlated noises of GNSS
//! velocity and position, first-order Gauss-Markov processes. Both level axes share one recursion; the
//! vertical has no tilt.

use nalgebra::{SMatrix, SVector};

use crate::config::Noise;
use crate::math;

/// Measured quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Measured {
    /// Velocity, with its correlated noise.
    Velocity,
    /// Position, with its correlated noise.
    Position,
}

/// Position, velocity, tilt, correlated noise of velocity, correlated noise of position.
const STATES: usize = 5;
const POSITION: usize = 0;
const VELOCITY: usize = 1;
const TILT: usize = 2;
const VELOCITY_NOISE: usize = 3;
const POSITION_NOISE: usize = 4;

/// One number for each state.
pub type Gains = SVector<f64, STATES>;

/// Sigma of the initial position: any latency and any position noise.
const START_M: f64 = 100.0;
const START_MPS: f64 = 1.0;

/// Transition and process noise of a channel over a span.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChannelStep {
    /// Duration, s.
    pub seconds: f64,
    /// Integral of specific force up, m/s, and its integral, m.
    pub force_up_mps: f64,
    pub force_up_position_m: f64,
    /// Velocity by a unit of position: gravity, 1/s.
    pub gravity_per_s: f64,
    /// Power density of accelerometer noise, (m/s)^2/s.
    pub accel_noise: f64,
    /// Power density of gyro noise, rad^2/s.
    pub gyro_noise: f64,
}

/// Step of a first-order Gauss-Markov process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Markov {
    /// Transition factor.
    pub decay: f64,
    /// Variance of the driving noise.
    pub variance: f64,
}

impl Markov {
    /// With `factor` times the configured variance.
    pub fn over(seconds: f64, noise: &Noise, factor: f64) -> Self {
        let decay = math::decayed(seconds / noise.correlation_s);
        let variance = noise.correlated * noise.correlated * factor * (1.0 - decay * decay);
        Self { decay, variance }
    }
}

/// Covariance of one channel.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Channel {
    p: SMatrix<f64, STATES, STATES>,
}

impl Channel {
    /// Starts with a variance of the tilt, rad^2, and the configured noise of GNSS.
    pub fn new(tilt: f64, velocity: &Noise, position: &Noise) -> Self {
        let diagonal = SVector::from([
            START_M * START_M,
            START_MPS * START_MPS,
            tilt,
            velocity.correlated * velocity.correlated,
            position.correlated * position.correlated,
        ]);
        Self {
            p: SMatrix::from_diagonal(&diagonal),
        }
    }

    /// Variance of position, m^2.
    pub fn position(&self) -> f64 {
        self.p.m11
    }

    /// Variance of velocity, (m/s)^2.
    pub fn velocity(&self) -> f64 {
        self.p.m22
    }

    /// Variance of tilt, rad^2.
    pub fn tilt(&self) -> f64 {
        self.p.m33
    }

    /// Variance of the correlated noise of a quantity.
    pub fn noise(&self, measured: Measured) -> f64 {
        match measured {
            Measured::Velocity => self.p.m44,
            Measured::Position => self.p.m55,
        }
    }

    /// Time update.
    pub fn propagate(&mut self, step: &ChannelStep, gnss_noise: [Markov; 2]) {
        let ChannelStep {
            seconds: dt,
            force_up_mps: f,
            force_up_position_m,
            gravity_per_s,
            accel_noise,
            gyro_noise,
        } = *step;
        self.add_coupling::<POSITION, VELOCITY>(dt);
        self.add_coupling::<POSITION, TILT>(force_up_position_m);
        self.add_coupling::<VELOCITY, TILT>(f);
        self.add_coupling::<VELOCITY, POSITION>(gravity_per_s);
        for (which, noise) in [VELOCITY_NOISE, POSITION_NOISE].into_iter().zip(gnss_noise) {
            self.p.column_mut(which).scale_mut(noise.decay);
            self.p.row_mut(which).scale_mut(noise.decay);
        }
        let [velocity, position] = gnss_noise;
        // Integrals of white noise over the span, their covariances included.
        let tilt_velocity = 0.5 * gyro_noise * dt * f;
        let velocity_position = 0.5 * accel_noise * dt * dt;
        self.p.m33 += gyro_noise * dt;
        self.p.m23 += tilt_velocity;
        self.p.m32 += tilt_velocity;
        self.p.m22 += accel_noise * dt + gyro_noise * dt * f * f / 3.0;
        self.p.m12 += velocity_position;
        self.p.m21 += velocity_position;
        self.p.m11 += accel_noise * dt * dt * dt / 3.0;
        self.p.m44 += velocity.variance;
        self.p.m55 += position.variance;
    }

    /// State `TO` gets `factor` times state `FROM`.
    #[inline(never)]
    fn add_coupling<const TO: usize, const FROM: usize>(&mut self, factor: f64) {
        let column = self.p.column(FROM).into_owned();
        self.p.column_mut(TO).axpy(factor, &column, 1.0);
        let row = self.p.row(FROM).into_owned();
        for (to, from) in self.p.row_mut(TO).iter_mut().zip(&row) {
            *to += factor * from;
        }
    }

    /// Refers the position to another time.
    pub fn advance_position(&mut self, seconds: f64) {
        self.add_coupling::<POSITION, VELOCITY>(seconds);
    }

    /// Adds variance to velocity and tilt.
    pub fn add_variance(&mut self, velocity: f64, tilt: f64) {
        self.p.m22 += velocity;
        self.p.m33 += tilt;
    }

    /// Adds `variance` times `error error'`.
    pub fn add_along(&mut self, error: &Gains, variance: f64) {
        self.p += error * error.transpose() * variance;
    }

    /// Adds variance to the position, m^2.
    pub fn add_position_variance(&mut self, variance: f64) {
        self.p.m11 += variance;
    }

    /// Adds variance to the correlated noise of positions.
    pub fn add_noise_variance(&mut self, variance: f64) {
        self.p.m55 += variance;
    }

    /// Replaces the correlated noise of positions by an independent one of this variance.
    pub fn reset_position_noise(&mut self, variance: f64) {
        self.p.column_mut(POSITION_NOISE).fill(0.0);
        self.p.row_mut(POSITION_NOISE).fill(0.0);
        self.p.m55 = variance;
    }

    /// `P H'`.
    fn cross_covariance(&self, measured: Measured) -> Gains {
        match measured {
            Measured::Velocity => self.p.column(VELOCITY) + self.p.column(VELOCITY_NOISE),
            Measured::Position => self.p.column(POSITION) + self.p.column(POSITION_NOISE),
        }
    }

    /// `H P H'`, without white noise.
    pub fn predicted_variance(&self, measured: Measured) -> f64 {
        let c = self.cross_covariance(measured);
        match measured {
            Measured::Velocity => c.y + c.w,
            Measured::Position => c.x + c.a,
        }
    }

    /// Measurement update with white noise of variance `white`; returns the gains.
    pub fn update(&mut self, measured: Measured, white: f64) -> Gains {
        let c = self.cross_covariance(measured);
        let gains = c / (self.predicted_variance(measured) + white);
        self.p -= gains * c.transpose();
        // Rounding must not make it negative.
        let diagonal = self.p.diagonal().map(|variance| math::max(variance, 0.0));
        self.p.set_diagonal(&diagonal);
        gains
    }
}

#[cfg(test)]
#[path = "../tests/unit/channel.rs"]
mod tests;
