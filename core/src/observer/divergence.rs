//! Gaps in the inertial data, jumps, and divergence of the INS.

use nalgebra::{Vector2, Vector3};

use super::error_state::ErrorState;
use super::{Observer, estimated};
use crate::channel::{Channel, Measured};
use crate::config::Config;
use crate::earth::GRAVITY_EQUATOR_MPS2;
use crate::error_model::level_and_up;
use crate::history::SPACING_S;
use crate::innovations::{AGREEING_S, NisTest};
use crate::math;
use crate::measurement::Kind;
use crate::parameters::{COUNT, index};
use crate::solution::SolutionSigma;
use crate::time::Time;

/// Sigmas after a reset. Velocity, m/s: a second of braking, or ten with a tilt of 0.1 rad; tilt and
/// azimuth, rad.
pub const RESET_MPS: f64 = 10.0;
const RESET_TILT_RAD: f64 = 0.05;
const RESET_AZIMUTH_RAD: f64 = 0.3;
/// Time for which a diverged INS has had its velocity error, s.
const DIVERGING_S: f64 = 0.5 * AGREEING_S;
/// Time for which the innovations must be too large until the INS is reset, s; for the vertical longer than
/// a bump, and no manoeuvre disturbs the vertical velocity.
const EXCEEDED_S: f64 = 10.0;
const VERTICAL_EXCEEDED_S: f64 = 5.0;
/// Prior sigmas that no parameter is off by; least sigma of the latency for that, s: 3 s is more than the
/// ring holds; and a tilt that no levelled INS has, rad.
const CREDIBLE_SIGMAS: f64 = 30.0;
const LEAST_LATENCY_SIGMA_S: f64 = 0.1;
const CREDIBLE_TILT_RAD: f64 = 1.0;
/// More than multipath makes a receiver err by, m.
const MULTIPATH_M: f64 = 1e3;
/// Rates about the vertical and about the level axes, and acceleration, of an ordinary manoeuvre hidden by a
/// gap of a second, rad/s and m/s^2: proportionally less by a shorter one, and no more by a longer one.
const HIDDEN_RADPS: f64 = 0.1;
const HIDDEN_LEVEL_RADPS: f64 = 0.01;
const HIDDEN_MPS2: f64 = 1.0;
const HIDDEN_S: f64 = 1.0;
/// Sigmas of a latency that was searched for, s, and of the arm that goes with it, m, and as a part of its
/// shift.
const RELOCATED_S: f64 = 0.05;
const RELOCATED_ARM_M: f64 = 0.2;
const RELOCATED_PART: f64 = 0.3;
/// Longest credible arm, sigmas: one that fits noise is longer.
const RELOCATED_SIGMAS: f64 = 2.0;

/// Variances that an interval adds to the INS error beyond those of its sensors' noise: of a component of the
/// position; of a level component and of the vertical one of the velocity; of tilt and azimuth.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Disturbance {
    position: f64,
    velocity: [f64; 2],
    tilt: f64,
    azimuth: f64,
}

impl Disturbance {
    /// Noise of these variances of the angle and of the velocity gained, per body axis, where the vertical is
    /// `up`.
    pub fn by_noise([angle, velocity]: &[Vector3<f64>; 2], up: &Vector3<f64>) -> Self {
        let (tilt, azimuth) = level_and_up(up, angle);
        Self {
            position: 0.0,
            velocity: level_and_up(up, velocity).into(),
            tilt,
            azimuth,
        }
    }

    /// Both, of different intervals.
    pub fn plus(&self, other: &Self) -> Self {
        let [level, up] = self.velocity;
        let [other_level, other_up] = other.velocity;
        Self {
            position: self.position + other.position,
            velocity: [level + other_level, up + other_up],
            tilt: self.tilt + other.tilt,
            azimuth: self.azimuth + other.azimuth,
        }
    }

    /// Sigmas of an INS that has passed it.
    pub fn widen(&self, sigma: &SolutionSigma) -> SolutionSigma {
        let wider = |sigma: f64, variance: f64| math::sqrt(sigma * sigma + variance);
        let [level, up] = self.velocity;
        let velocity = Vector3::new(level, level, up);
        let attitude = Vector3::new(self.tilt, self.tilt, self.azimuth);
        SolutionSigma {
            position_m: sigma.position_m.map(|own| wider(own, self.position)),
            velocity_mps: sigma.velocity_mps.zip_map(&velocity, wider),
            attitude_rad: sigma.attitude_rad.zip_map(&attitude, wider),
        }
    }
}

/// Missing inertial samples, and what interpolating them adds: it may be wrong by half of the difference of
/// the readings at both ends, and by an ordinary manoeuvre.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DataGap {
    start: Time,
    /// First sample after it.
    pub end: Time,
    pub disturbance: Disturbance,
}

impl DataGap {
    /// Begins at a sample and lasts for `seconds`; `missed_m` of the way are not interpolated, and the
    /// readings differ by rad/s and m/s^2, in body axes, where the vertical is `up`.
    pub fn after(
        start: Time,
        seconds: f64,
        missed_m: f64,
        [rate, accel]: &[Vector3<f64>; 2],
        up: &Vector3<f64>,
    ) -> Self {
        let part = math::min(seconds / HIDDEN_S, 1.0);
        let square = |x: f64| x * x;
        let about_up = rate.dot(up);
        let level_square = 0.5 * (rate.norm_squared() - about_up * about_up);
        let azimuth = (HIDDEN_RADPS * part + 0.5 * math::abs(about_up)) * seconds;
        let tilt = HIDDEN_LEVEL_RADPS * part * seconds;
        let accel = math::largest(accel);
        // A hidden turn, which grows with the square of time, changes the direction of gravity in the body.
        let tipped = 0.5 * part * part * accel / GRAVITY_EQUATOR_MPS2;
        let velocity = (HIDDEN_MPS2 * part + 0.5 * accel) * seconds;
        Self {
            start,
            end: start.plus_seconds(seconds),
            disturbance: Disturbance {
                position: square(0.5 * velocity * seconds) + square(missed_m),
                velocity: [square(velocity); 2],
                tilt: square(tilt) + square(0.5 * seconds) * level_square + square(tipped),
                azimuth: square(azimuth),
            },
        }
    }

    /// Whether the INS at this time is interpolated over the gap.
    pub fn holds(&self, moment: Time) -> bool {
        let before_s = self.start.seconds_since(moment);
        before_s < 2.0 * SPACING_S && moment.seconds_since(self.end) < SPACING_S
    }
}

impl Observer {
    /// The horizon has reached what disturbs the INS.
    #[inline(never)]
    pub fn on_disturbance(&mut self, by: &Disturbance) {
        let [level, up] = by.velocity;
        self.level.add_variance(level, by.tilt);
        self.vertical.add_variance(up, 0.0);
        self.azimuth_walk += by.azimuth;
        self.level.add_position_variance(by.position);
        self.vertical.add_position_variance(by.position);
    }

    /// Another latency than the estimated one was found to be right, and an arm that goes with it, if that can be.
    #[inline(never)]
    pub fn relocate(&mut self, latency_s: f64, arm_m: &Vector3<f64>, config: &Config) {
        let beyond_m = (arm_m - config.prior().lever_arm()).norm();
        if beyond_m > RELOCATED_SIGMAS * (config.gnss.lever_arm_sigma_m + RELOCATED_ARM_M) {
            return;
        }
        let found = [latency_s, arm_m.x, arm_m.y, arm_m.z];
        let latency = core::iter::once((index::LATENCY, [RELOCATED_S, 0.0]));
        let arm = (index::LEVER_ARM..).map(|which| (which, [RELOCATED_ARM_M, RELOCATED_PART]));
        for ((which, [sigma, part]), found) in latency.chain(arm).zip(found) {
            if config.is_given(which) {
                continue;
            }
            let shift = found - self.parameters.value(which);
            self.parameters.shift(which, shift);
            self.on_jump(which, sigma * sigma + part * part * shift * shift);
        }
    }

    /// A parameter has jumped by a size of this variance, some time before detection: part of the INS error
    /// was caused by its old value.
    #[inline(never)]
    pub(super) fn on_jump(&mut self, which: usize, variance: f64) {
        self.corrections.diffuse(which, math::single(variance));
        if let Some(consistency) = self.consistency.get_mut(which) {
            consistency.on_walk(math::single(variance));
        }
        if let Some(caused) = self.sensitivities.get(which).map(ErrorState::double) {
            self.add_along(&caused, variance);
        }
        self.widen(which, variance);
        self.resets.note(self.horizon);
        if which == index::LATENCY {
            self.doubt_position_noise();
        }
    }

    /// Positions were compared with an INS of a wrong time: what they are off by passes for their noise, and
    /// would hold for minutes an INS that has followed them.
    fn doubt_position_noise(&mut self) {
        let off_m = self.state.noise(Kind::Position);
        let noise = self.level.noise(Measured::Position);
        self.level.reset_position_noise(noise);
        self.level.add_position_variance(0.5 * off_m.norm_squared());
        self.scale_gnss_noise([1.0, 0.0], [1.0; 2]);
    }

    /// Resets the covariance of a diverged INS, with this variance of the velocity error, to that after
    /// alignment; the biases, estimated meanwhile, get their prior variance more.
    #[inline(never)]
    fn reset_covariance(&mut self, variance: f64, config: &Config) {
        let gnss = &config.gnss;
        // The tilt goes with the velocity error that it has caused.
        let variance = math::max(variance, RESET_MPS * RESET_MPS);
        let tilt = variance * (RESET_TILT_RAD / RESET_MPS) * (RESET_TILT_RAD / RESET_MPS);
        let position = self.level.position() + variance * DIVERGING_S * DIVERGING_S;
        self.level = Channel::new(tilt, &gnss.velocity_mps, &gnss.position_m);
        self.level.add_variance(variance, 0.0);
        self.level.add_position_variance(position);
        self.scale_gnss_noise([0.0; 2], [1.0; 2]);
        self.reset_vertical(RESET_MPS * RESET_MPS, config);
        self.azimuth_walk += RESET_AZIMUTH_RAD * RESET_AZIMUTH_RAD;
        let s = &config.sensors;
        for (first, sigma) in [
            (index::GYRO, s.gyro_bias_radps),
            (index::ACCEL, s.accel_bias_mps2),
        ] {
            let sigma = math::single(sigma);
            for axis in 0..3 {
                self.add_walk(first + axis, sigma * sigma);
                // If the INS is realigned at once, their turn does not come.
                self.widen(first + axis, f64::from(sigma * sigma));
            }
        }
        self.nis = NisTest::default();
        self.resets.add(self.horizon);
        self.jumps = Default::default();
        self.gyro_noise.restart();
    }

    /// The same of the vertical alone.
    #[inline(never)]
    fn reset_vertical(&mut self, variance: f64, config: &Config) {
        let gnss = &config.gnss;
        let height = self.vertical.position();
        self.vertical = Channel::new(0.0, &gnss.velocity_up_mps, &gnss.height_m);
        self.vertical.add_variance(variance, 0.0);
        self.vertical.add_position_variance(height);
        self.vertical_nis = NisTest::default();
        self.scale_gnss_noise([1.0; 2], [0.0; 2]);
    }

    /// Vertical velocities had the wrong sign: discards what they have shown.
    pub fn forget_vertical(&mut self, config: &Config) {
        self.reset_vertical(RESET_MPS * RESET_MPS, config);
        let prior = config.prior_sigma();
        let up = self.level_force_mps2 / GRAVITY_EQUATOR_MPS2;
        for first in [index::ACCEL, index::ACCEL_SCALE, index::LEVER_ARM] {
            for ((which, sigma), up) in prior.iter().enumerate().skip(first).zip(&up) {
                let sigma = up * f64::from(*sigma);
                self.add_walk(which, math::single(sigma * sigma));
            }
        }
    }

    /// Scales the GNSS noise states of velocity and position: they hold part of the INS's own error.
    fn scale_gnss_noise(&mut self, level: [f32; 2], up: [f32; 2]) {
        self.state.decay(level.map(f64::from), up.map(f64::from));
        for sensitivity in estimated(&mut self.sensitivities, &self.corrections) {
            sensitivity.decay(level, up);
        }
    }

    /// Time of the last reset.
    pub fn last_reset(&self) -> Option<Time> {
        self.resets.last.max(self.vertical_resets.last)
    }

    /// Whether resets have not helped.
    pub fn needs_realignment(&self) -> bool {
        self.resets.is_exceeded()
    }

    /// Whether parameters and errors are credible; else realignment begins with the configured prior. Only
    /// a grossly wrong attitude makes the vertical diverge again and again.
    pub fn is_credible(&self, config: &Config) -> bool {
        let prior = config.prior();
        let credible = |which: usize| {
            let sigma = prior.sigma(which);
            let sigma = match which {
                // Clocks drift, and the search for the heading finds the latency by itself.
                index::LATENCY => math::max(sigma, LEAST_LATENCY_SIGMA_S),
                // The square of a time.
                index::SMOOTHING => CREDIBLE_SIGMAS * sigma,
                _ => sigma,
            };
            math::abs(self.parameters.value(which) - prior.value(which)) <= CREDIBLE_SIGMAS * sigma
        };
        let error = &self.state.error;
        (0..COUNT).all(credible)
            && !self.vertical_resets.is_exceeded()
            && math::all_finite(&error.position_m)
            && math::all_finite(&error.velocity_mps)
            && error.tilt_rad.norm() < CREDIBLE_TILT_RAD
            && self.level.tilt().is_finite()
    }

    /// Fixes of a kind were refused for so long that the INS is wrong, by this per axis.
    pub(super) fn on_diverged(&mut self, kind: Kind, error: &Vector2<f64>, config: &Config) {
        let components = if kind.is_up() { 1.0 } else { 2.0 };
        let variance = error.norm_squared() / components;
        match kind {
            Kind::Position if self.aided_by(Kind::Velocity) => {
                self.on_position_jump(kind, error, variance, config);
            }
            Kind::Height if self.aided_by(Kind::Climb) => {
                self.on_position_jump(kind, error, variance, config);
            }
            // Velocity from the position error: nothing else tells it.
            Kind::Position => self.reset_covariance(variance / (DIVERGING_S * DIVERGING_S), config),
            Kind::Height => {
                self.reset_vertical(variance / (DIVERGING_S * DIVERGING_S), config);
                self.vertical.add_position_variance(variance);
            }
            Kind::Climb => self.reset_vertical(variance, config),
            Kind::Velocity => self.reset_covariance(variance, config),
        }
    }

    /// Positions jump while velocities agree: multipath or other satellites, or a wrong position of the
    /// INS. The variance is shared until the next minutes tell; beyond any multipath it is the INS, which
    /// is corrected at once.
    fn on_position_jump(
        &mut self,
        kind: Kind,
        error: &Vector2<f64>,
        variance: f64,
        config: &Config,
    ) {
        let (noise, range) = (kind.noise(config), config.gnss.noise_range);
        let far = error.norm_squared() > MULTIPATH_M * MULTIPATH_M;
        let [_, most] = range;
        let offset_variance = if far {
            most * most * noise.variance()
        } else {
            variance
        };
        let (channel, components, kept, off_m) = if kind.is_up() {
            let off_m = Vector3::new(0.0, 0.0, error.x);
            (&mut self.vertical, 1.0, [1.0, 0.0], off_m)
        } else {
            (&mut self.level, 2.0, [0.0, 1.0], error.push(0.0))
        };
        if far {
            self.state.error.position_m += off_m;
        }
        channel.reset_position_noise(offset_variance);
        channel.add_position_variance(offset_variance);
        if let Some(coloured) = self.coloured_noise.get_mut(kind as usize) {
            coloured.on_jump(variance, components, noise, range);
        }
        let [level, up] = kept;
        self.scale_gnss_noise([1.0, level], [1.0, up]);
    }

    /// Whether a measurement of this kind was accepted of late.
    pub fn aided_by(&self, kind: Kind) -> bool {
        let innovations = self.innovations.get(kind as usize);
        innovations.is_some_and(|kind| kind.is_recent(self.horizon))
    }

    /// Resets an INS, or its vertical, whose innovations stay too large.
    pub fn check_divergence(&mut self, config: &Config) {
        if self.nis.exceeded_s >= EXCEEDED_S {
            self.reset_covariance(0.0, config);
        }
        if self.vertical_nis.exceeded_s > VERTICAL_EXCEEDED_S {
            self.reset_vertical(RESET_MPS * RESET_MPS, config);
            self.vertical_resets.add(self.horizon);
        }
    }
}

#[cfg(test)]
#[path = "../../tests/unit/data_gap.rs"]
mod tests;
