//! The exact form of the compensation estimators: every control undone, all parameters jointly.
//!
//! Equation (6) of the thesis drops `K1 dV` and `dV'`, so (7) and (8) depend on the loop. Nothing
//! need be dropped, since every control is known. An observer follows the error `[dV, Phi]` of
//! the damped INS by the exact (1)-(2), `dV' = f x Phi + C df`, `Phi' = -w_in x Phi - C dw`, with
//! the controls as known inputs: its innovations do not depend on the loops. They are linear in
//! corrections to the parameters, through the error that a unit of each would cause, which the
//! observer follows in the same way.
//! With gains at the noise optimum the innovations are white, so plain least squares over them
//! is what a Kalman filter with all parameters in its state would find (Friedland's separate-bias
//! estimation, IEEE TAC 14, 1969).

use nalgebra::{SVector, Vector2, Vector3};

use super::Verdict;
use super::gains::Channel;
use super::innovations::{Innovations, Roughness, StatedNoise};
use super::ins_error::{Forcing, InsError, Passage, for_each_input, single};
use super::least_squares::LeastSquares;
use super::parameters::{COUNT, PAIRS, Parameters, index};
use crate::config::Config;
use crate::history::{Moment, Past, Span};
use crate::math;
use crate::time::Time;

/// One number for each parameter.
type Row = SVector<f32, COUNT>;

/// The measured difference at one fix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Velocity of the INS minus that of the fix, ENU, m/s.
    pub velocity_mps: Vector3<f64>,
    /// Whether the up component was measured.
    pub has_up: bool,
    /// Noise of a component as the receiver states it, m/s.
    pub stated_sigma_mps: Option<f64>,
    /// Latency already taken out by the choice of the moment, s.
    pub latency_applied_s: f64,
}

/// Observer of the INS error and running least squares of the parameters behind it.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Observer {
    /// Error of the INS at the horizon with the parameters as they are known. Its azimuth is
    /// the first parameter.
    error: InsError,
    /// What a unit of each parameter more would make of it.
    responses: [InsError<f32>; COUNT],
    level: Channel,
    vertical: Channel,
    level_innovations: Innovations,
    vertical_innovations: Innovations,
    stated_noise: StatedNoise,
    roughness: Roughness,
    /// Corrections to the parameters.
    corrections: LeastSquares<COUNT, PAIRS>,
    /// Last solution; the latency is that of its moment.
    parameters: Parameters,
    /// Whose spread is due next.
    next_spread: u8,
    /// Since the last solution, s.
    unsolved_s: f64,
    /// Mean of the body's up axis over the last span, ENU.
    up: Vector3<f32>,
    /// The horizon: the moment of the last fix taken.
    last: Moment,
}

/// What a unit of each parameter adds to a velocity, ENU.
type VelocityBy = [[f32; 3]; COUNT];

impl Observer {
    /// Starts on a level of some spread, with what is believed of the parameters.
    pub fn new(start: Time, tilt_sigma_rad: f64, prior: &Parameters, config: &Config) -> Self {
        let sigma = config.gnss.velocity_sigma_mps;
        let mut error = InsError::zero();
        error.tilt_rad.z = prior.value(index::AZIMUTH);
        Self {
            error,
            responses: core::array::from_fn(unit_response),
            level: Channel::new(tilt_sigma_rad * tilt_sigma_rad),
            vertical: Channel::new(0.0),
            level_innovations: Innovations::new(sigma),
            vertical_innovations: Innovations::new(sigma),
            stated_noise: StatedNoise::default(),
            roughness: Roughness::default(),
            corrections: LeastSquares::from_prior(&prior.sigma),
            parameters: *prior,
            next_spread: 0,
            unsolved_s: 0.0,
            up: Vector3::z(),
            last: Moment::start(start),
        }
    }

    /// Forgets the state of the INS error, not the parameters: after its velocity was set anew.
    /// What has tilted the platform may have turned it as far.
    pub fn restart(&mut self, start: Time, config: &Config) {
        self.error = InsError::zero();
        self.error.tilt_rad.z = self.parameters.value(index::AZIMUTH);
        self.responses = core::array::from_fn(unit_response);
        let tilt_rad = config.level_sigma();
        self.level = Channel::new(tilt_rad * tilt_rad);
        self.vertical = Channel::new(0.0);
        self.corrections
            .diffuse(index::AZIMUTH, math::single(self.level.tilt));
        self.last = Moment::start(start);
    }

    /// Spread of roll and pitch, rad, with all parameters known.
    pub fn tilt_sigma_rad(&self) -> f64 {
        math::sqrt(self.level.tilt)
    }

    /// What is known of the parameters.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Inertial samples were missing for `seconds`: what was filled in may be wrong by the rate
    /// and acceleration of an ordinary manoeuvre.
    pub fn on_hole(&mut self, seconds: f64) {
        let (rate, accel) = (0.1 * seconds, 1.0 * seconds);
        self.level.doubt(accel * accel, 0.01 * rate * rate);
        self.vertical.doubt(accel * accel, 0.0);
        self.corrections
            .diffuse(index::AZIMUTH, math::single(rate * rate));
    }

    /// The error of the INS at a moment after the horizon, as estimated.
    pub fn error_at(&self, moment: &Moment) -> InsError {
        let span = Span::between(&self.last, moment);
        // The horizon is close: the frame stands still.
        let forcing = Forcing::over(&span, &self.parameters);
        let passage = Passage::over(&span, &Vector3::zeros(), &forcing);
        self.error.after(&passage, &forcing)
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
        let residual = difference.velocity_mps - self.predicted(past, difference);
        let relative = self.stated_noise.relative(difference.stated_sigma_mps);
        let level_power = residual.xy().norm_squared();
        let Some(level_noise) =
            self.level_innovations
                .noise(level_power, self.level.velocity, relative)
        else {
            return Verdict::Outlier;
        };
        let step = self
            .level_innovations
            .step(level_power, self.level.velocity, relative);
        self.level.doubt(step, 0.0);
        let up_noise = difference
            .has_up
            .then(|| self.credible_up(residual.z, relative))
            .flatten();
        let weight = |predicted: f64, noise: f64| math::single(1.0 / (predicted + noise));
        let level_weight = weight(self.level.velocity, level_noise);
        let up_weight = up_noise.map_or(0.0, |noise| weight(self.vertical.velocity, noise));
        let mut by = self.velocity_by(past);
        self.correct_level(&by, &residual.xy(), level_noise);
        let likeness = self
            .level_innovations
            .measure(&residual.xy(), 2.0, relative);
        self.roughness.learn(likeness);
        if let Some(noise) = up_noise {
            self.correct_vertical(&by, residual.z, noise);
            let up = Vector2::new(residual.z, 0.0);
            let _ = self.vertical_innovations.measure(&up, 1.0, relative);
        }
        let weights = [level_weight, level_weight, up_weight];
        self.corrections
            .add(&mut by, single(&residual).into(), weights);
        match up_noise {
            Some(_) => Verdict::Used,
            None => Verdict::LevelUsed,
        }
    }

    /// Noise of a vertical velocity that is credible.
    fn credible_up(&mut self, residual_mps: f64, relative: f64) -> Option<f64> {
        let (predicted, power) = (self.vertical.velocity, residual_mps * residual_mps);
        let noise = self.vertical_innovations.noise(power, predicted, relative);
        let step = self.vertical_innovations.step(power, predicted, relative);
        // Refused again and again, it is the INS that errs: the gate opens.
        let doubt = if noise.is_some() { step } else { predicted };
        self.vertical.doubt(doubt, 0.0);
        noise
    }

    /// Carries the observer to a later moment in a frame that turns at `frame_rate`.
    pub fn propagate(&mut self, to: &Moment, frame_rate: &Vector3<f64>, config: &Config) {
        let span = Span::between(&self.last, to);
        if span.seconds <= 0.0 {
            return;
        }
        let forcing = Forcing::over(&span, &self.parameters);
        let passage = Passage::over(&span, frame_rate, &forcing);
        self.error = self.error.after(&passage, &forcing);
        let azimuth_sigma = self.parameters.sigma(index::AZIMUTH);
        self.parameters
            .set(index::AZIMUTH, self.error.tilt_rad.z, azimuth_sigma);
        let passage = passage.single();
        for response in &mut self.responses {
            response.carry(&passage);
        }
        for_each_input(&span, |which, input| {
            if let Some(response) = self.responses.get_mut(which) {
                response.feed(&passage, &input.single());
            }
        });
        let s = &config.sensors;
        let gyro = self.roughness.factor() * s.gyro_noise * s.gyro_noise;
        let accel = s.accel_noise * s.accel_noise;
        self.level
            .propagate(span.force_mps.z, span.seconds, accel, gyro);
        self.vertical.propagate(0.0, span.seconds, accel, 0.0);
        // Level force on a tilted platform, as in a steep bank: the channels are otherwise apart.
        let level_force = span.force_mps.xy().norm_squared();
        self.vertical.doubt(level_force * self.level.tilt, 0.0);
        self.doubt_tipping(&span, s.gyro_scale);
        self.unsolved_s += span.seconds;
        self.last = *to;
    }

    /// Scale errors of gyros turn the platform as the vehicle turns. About its up axis that is a
    /// parameter; tipping that axis over, as aircraft do, is noise.
    fn doubt_tipping(&mut self, span: &Span, gyro_scale: f64) {
        let up = single(&(span.attitude_s.column(2) / span.seconds));
        let tipped = f64::from((up - self.up).norm_squared());
        self.up = up;
        let variance = gyro_scale * gyro_scale * tipped;
        self.level.doubt(0.0, variance);
        self.corrections
            .diffuse(index::AZIMUTH, math::single(variance));
    }

    /// INS minus GNSS velocity as the parameters would have it.
    fn predicted(&self, past: &Past, difference: &Difference) -> Vector3<f64> {
        let p = &self.parameters;
        let latency = p.value(index::LATENCY) + self.unsolved_s * p.value(index::CLOCK_DRIFT);
        // The antenna moves by C' l more than the sensors.
        let lever = past.attitude_rate.fixed_columns::<2>(0) * p.lever_arm();
        self.error.velocity_mps + (latency - difference.latency_applied_s) * past.accel_mps2 - lever
    }

    /// What a unit of each parameter more would add to that.
    fn velocity_by(&self, past: &Past) -> VelocityBy {
        let mut by = [[0.0; 3]; COUNT];
        for (by, response) in by.iter_mut().zip(&self.responses) {
            *by = response.velocity_mps.into();
        }
        let mut add = |which: usize, velocity: Vector3<f32>| {
            for (by, component) in by.get_mut(which).into_iter().flatten().zip(&velocity) {
                *by += component;
            }
        };
        let accel = single(&past.accel_mps2);
        add(index::LATENCY, accel);
        add(index::CLOCK_DRIFT, accel * math::single(self.unsolved_s));
        for axis in 0..2 {
            let moved = past.attitude_rate.column(axis).into_owned();
            add(index::LEVER_ARM + axis, -single(&moved));
        }
        by
    }

    fn correct_level(&mut self, by: &VelocityBy, residual: &Vector2<f64>, noise: f64) {
        let (gain, tilt_gain) = self.level.update(noise);
        // dV_N' = g Phi_E and dV_E' = -g Phi_N.
        self.error.velocity_mps += gain * residual.push(0.0);
        self.error.tilt_rad += tilt_gain * Vector3::new(residual.y, -residual.x, 0.0);
        let (gain, tilt_gain) = (math::single(gain), math::single(tilt_gain));
        for (response, [east, north, _]) in self.responses.iter_mut().zip(by) {
            response.velocity_mps.x -= gain * east;
            response.velocity_mps.y -= gain * north;
            response.tilt_rad.x -= tilt_gain * north;
            response.tilt_rad.y += tilt_gain * east;
        }
    }

    fn correct_vertical(&mut self, by: &VelocityBy, residual: f64, noise: f64) {
        let (gain, _) = self.vertical.update(noise);
        self.error.velocity_mps.z += gain * residual;
        for (response, [_, _, up]) in self.responses.iter_mut().zip(by) {
            response.velocity_mps.z -= math::single(gain) * up;
        }
    }

    /// Solves for the parameters at the horizon.
    pub fn solve(&mut self, config: &Config) {
        self.come_to_now();
        self.diffuse(config);
        self.unsolved_s = 0.0;
        let corrections = self.corrections.solve();
        self.corrections.count_from_solution();
        for (response, by) in self.responses.iter().zip(&corrections) {
            let by = f64::from(*by);
            self.error.velocity_mps += response.velocity_mps.map(f64::from) * by;
            self.error.tilt_rad += response.tilt_rad.map(f64::from) * by;
        }
        self.parameters.value += corrections.map(f64::from);
    }

    /// Brings the spread of one parameter up to date, each in its turn.
    pub fn spread_next(&mut self) {
        let which = usize::from(self.next_spread);
        self.next_spread = if which + 1 < COUNT {
            self.next_spread + 1
        } else {
            0
        };
        let variance = f64::from(self.corrections.variance(which));
        let sigma = math::sqrt(variance * self.level_innovations.inflation());
        let value = self.parameters.value(which);
        self.parameters.set(which, value, sigma);
    }

    /// Makes azimuth and latency those of the horizon, where the other parameters have moved them.
    fn come_to_now(&mut self) {
        let azimuth = Row::from_fn(|which, _| match self.responses.get(which) {
            Some(response) if which != index::AZIMUTH => response.tilt_rad.z,
            _ => 0.0,
        });
        self.carry_forward(index::AZIMUTH, &azimuth);
        for (which, response) in self.responses.iter_mut().enumerate() {
            response.tilt_rad.z = unit_response(which).tilt_rad.z;
        }
        let mut latency = Row::zeros();
        if let Some(drift) = latency.get_mut(index::CLOCK_DRIFT) {
            *drift = math::single(self.unsolved_s);
        }
        self.carry_forward(index::LATENCY, &latency);
        let p = &mut self.parameters;
        p.shift(
            index::LATENCY,
            self.unsolved_s * p.value(index::CLOCK_DRIFT),
        );
    }

    /// Makes parameter `which` that of now, where it is greater by `by` times the later ones.
    fn carry_forward(&mut self, which: usize, by: &Row) {
        self.corrections.redefine(which, by);
        let Some(own) = self.responses.get(which).copied() else {
            return;
        };
        for (response, by) in self.responses.iter_mut().zip(by) {
            response.add_scaled(&own, -by);
        }
    }

    /// Lets everything random have walked since the last solution.
    fn diffuse(&mut self, config: &Config) {
        let (s, dt, rough) = (&config.sensors, self.unsolved_s, self.roughness.factor());
        let walks = [
            (index::AZIMUTH, 1, rough * s.gyro_noise * s.gyro_noise),
            (index::GYRO, 3, s.gyro_bias_walk * s.gyro_bias_walk),
            (index::ACCEL, 3, s.accel_bias_walk * s.accel_bias_walk),
        ];
        for (first, count, rate) in walks {
            for which in first..first + count {
                self.corrections.diffuse(which, math::single(rate * dt));
            }
        }
    }

    /// Latency `seconds` before the horizon and its spread, s.
    pub fn latency_before(&self, seconds: f64) -> (f64, f64) {
        let mut coefficients = Row::zeros();
        if let Some(now) = coefficients.get_mut(index::LATENCY) {
            *now = 1.0;
        }
        if let Some(drift) = coefficients.get_mut(index::CLOCK_DRIFT) {
            *drift = -math::single(seconds);
        }
        let p = &self.parameters;
        let value = p.value(index::LATENCY) - seconds * p.value(index::CLOCK_DRIFT);
        let variance = f64::from(self.corrections.variance_of(coefficients.into()));
        (
            value,
            math::sqrt(variance * self.level_innovations.inflation()),
        )
    }

    /// Adds a direct measurement of one parameter other than the azimuth.
    pub fn measure(&mut self, parameter: usize, value: f64, variance: f64) {
        let correction = value - self.parameters.value(parameter);
        self.corrections
            .add_direct(parameter, math::single(correction), math::single(variance));
    }
}

/// Response before anything has happened: the azimuth parameter is the azimuth error.
fn unit_response(which: usize) -> InsError<f32> {
    let mut response = InsError::zero();
    if which == index::AZIMUTH {
        response.tilt_rad.z = 1.0;
    }
    response
}
