//! Heading from motion, without any prior, at one initial latency.
//!
//! A levelled INS without a heading measures the velocity gained since the first fix, `u`, in a level frame
//! of arbitrary azimuth. GNSS measures `v`, and its gain `d = v - v_1` is `c d + s d'` in that frame, with
//! `(c, s)` the cosine and sine of the rotation that is sought and `d' = (d_N, -d_E)`. So, with the error
//! `e` of `u` and the acceleration `a` of the antenna,
//!
//! `u = e + c d + s d' + l (a - a_1)`
//!
//! is linear in all unknowns: an unknown heading starts as `(c, s) = 0` with variance 1/2 each, exactly the
//! mean and variance of a direction on a circle. `l` is the latency beyond the initial one; the first fix
//! is as late as the others. An antenna at the lever arm `b` moves by `C' b` more: in a steady turn a
//! forward arm looks like a latency, so the three components of `b` are unknowns too, with `- C' b` in the
//! sum. `e` grows by (1)-(2): `e' = f x phi`, `phi' = -C b`, with tilt `phi` and gyro biases `b`. Estimates
//! of `e`, `phi`, `b` and `l` correct the INS at once, so that they stay small.
//!
//! The frame drifts about up with the up gyro's bias, 60 degrees in 20 s at 3 deg/s. So the rotation sought
//! is the present one: with every fix `(c, s)` turn by the `phi` about up since the last one, and `e` by
//! the change of `c d + s d'`. While the heading is unknown this does nothing, any rotation being as likely
//! as another; later it is linear over one interval of fixes instead of the whole search.
//!
//! An antenna that swings while the unit hardly moves (`u` near zero) is explained by `(c, s) = b = 0` as
//! well as by the truth, and better with a wrong latency: then cosine and sine are shorter than 1. If so
//! while INS motion is small against GNSS motion, all restart.
//!
//! `d` is a noisy regressor: noise in it that is uncorrelated with `u` biases `c` and `s` toward zero
//! (errors in variables). Hence a steady `d` is held, the variance that the noise removes is given back,
//! and once the angle is known `d` is taken from the INS.
//!
//! Mean velocities (of positions) are those of `u`, and of `e` at the middle of the interval.
//!
//! Accelerometer biases are no unknowns: at one attitude they are tilt. As the body turns, they turn
//! against the level frame, which is noise of the tilt.

use nalgebra::{Matrix2x3, Matrix3, SVector, UnitQuaternion, Vector2, Vector3};

use super::covariance::Covariance;
use super::nodes::Node;
use super::observations::Observation;
use crate::attitude::{matrix, renormalized, small_rotation};
use crate::config::Config;
use crate::earth::GRAVITY_EQUATOR_MPS2;
use crate::math::{self, single};
use crate::parameters::{Parameters, index};
use crate::time::Time;

/// The unknowns: velocity error, tilt and turn, gyro biases, cosine and sine, latency, lever arm.
const ERROR: usize = 0;
const TILT: usize = 2;
const BIAS: usize = 5;
const COS: usize = 8;
const SIN: usize = 9;
const LATENCY: usize = 10;
const ARM: usize = 11;
const COUNT: usize = 14;
const PAIRS: usize = COUNT * (COUNT + 1) / 2;

/// One number for each unknown.
type Row = SVector<f32, COUNT>;

/// Change of velocity that counts as motion, sigmas of the difference of two: at constant speed noise shows
/// no heading, for however long.
const STEADY_SIGMAS: f32 = 3.0;
/// Residual beyond which a measurement counts less, sigmas.
const OUTLIER_SIGMAS: f32 = 3.0;
/// Change of velocity that neither the INS nor so many sigmas explain, whatever the heading: a wrong fix.
const GROSS_SIGMAS: f32 = 6.0;
/// Time after which such fixes are believed: the one before them was wrong, or their noise is, s.
const GROSS_S: f64 = 10.0;
/// Largest sigma of the angle at which cosine and sine are linear in it, rad.
const KNOWN_ANGLE_RAD: f64 = 0.35;
/// Sigma beyond which it is forgotten, and least length of cosine and sine that has an angle.
const LOST_ANGLE_RAD: f64 = 0.6;
const LEAST_LENGTH: f64 = 0.2;
/// Sigma of an unknown angle, rad: above any, and finite, for not every format of a serialized state has
/// infinities.
const UNKNOWN_ANGLE_RAD: f32 = f32::MAX;
/// Time without a change of velocity after which motion is steady, s.
const STEADY_S: f32 = 5.0;
/// Time after such a change in which smaller ones are followed, and averaging time that keeps the noise out
/// of the regressor, s.
const HOLD_S: f32 = 2.0;
const MEAN_S: f64 = 0.2;
/// Ratio of the noise of receivers to what they state, in variance.
const UNDERSTATED: f32 = 2.0;
/// Error of the length of cosine and sine by the scale errors of both sensors.
const LENGTH_ERROR: f64 = 0.05;
/// Sigmas by which they are too short for any angle.
const SHORT_SIGMAS: f64 = 3.0;
/// INS motion below this part of GNSS motion is small.
const LEAST_POWER_SHARE: f32 = 0.5;
/// Random walk of the latency, s/sqrt(s): observations at a wrong latency are worth less.
const LATENCY_WALK: f64 = 0.02;
/// Sigma of the gyro biases of an uncalibrated unit, over that of the preset.
const UNKNOWN_UNIT: f64 = 3.0;
/// Acceleration of a vehicle during the first mean velocity, m/s^2.
const FIRST_ACCEL_MPS2: f32 = 2.0;
/// Time over which an acceleration keeps its direction in the body, s.
const PUSH_S: f64 = 1.0;
/// Smoothing of the acceleration that is the partial by latency, s: faster motion (steps, vibration) is
/// periodic, and would fit a period off.
const SMOOTH_S: f64 = 0.3;
/// Downward acceleration that no vehicle keeps up, m/s^2, and for how long, s.
const FALLING_MPS2: f64 = 2.5;
const FALLING_S: f64 = 3.0;
/// Largest correction of the tilt at once, rad.
const LARGEST_TURN_RAD: f64 = 0.5;

/// Initial state of a candidate's INS.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Start {
    pub(crate) time: Time,
    pub(crate) attitude: UnitQuaternion<f64>,
    pub(crate) tilt_sigma_rad: f64,
    /// Earth rate about the level and the up axis, rad/s.
    pub(crate) earth_rate_radps: Vector2<f64>,
}

/// A level INS of arbitrary azimuth at one initial latency, and its filter.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Candidate {
    /// Next node and observation.
    pub(crate) node: u32,
    pub(crate) observation: u32,
    time: Time,
    attitude: UnitQuaternion<f64>,
    gyro_bias_radps: Vector3<f64>,
    pub(crate) latency_s: f32,
    /// Antenna from the sensors, body, m.
    lever_arm_m: Vector3<f32>,
    /// Velocity of the first observation, E and N, m/s; none before it.
    first_mps: Option<Vector2<f32>>,
    /// Velocity gained since the first observation, displacement since the last, and velocity there.
    velocity_mps: Vector2<f32>,
    way_m: Vector2<f32>,
    /// Vertical velocity gained since the start, m/s.
    risen_mps: f32,
    velocity_before_mps: Vector2<f32>,
    level_before: Matrix2x3<f32>,
    /// Velocity at the last observation, and the observed one.
    last_mps: Vector2<f32>,
    last_observed_mps: Vector2<f32>,
    /// Regressor `d`: gain of GNSS velocity that counts as motion, m/s.
    regressor_mps: Vector2<f32>,
    /// Sums of the squares of INS and of GNSS motion, (m/s)^2.
    ins_power: f32,
    gnss_power: f32,
    /// The last gain that differed by more than noise, and time since then.
    last_change_mps: Vector2<f32>,
    steady_s: f32,
    last_observation: Time,
    /// Acceleration of the antenna, smoothed, and at the first observation.
    accel_mps2: Vector2<f32>,
    first_accel_mps2: Vector2<f32>,
    /// Velocity of the antenna in the last node, per unit of its arm, 1/s.
    swing_radps: Matrix2x3<f32>,
    /// Sigma of the angle of cosine and sine, rad.
    angle_sigma_rad: f32,
    /// Whether it was ever known.
    had_angle: bool,
    /// Cosine and sine.
    rotation: Vector2<f32>,
    covariance: Covariance<COUNT, PAIRS>,
    /// Log likelihood of the observations.
    pub(crate) log_likelihood: f32,
}

impl Candidate {
    /// Starts with this sigma of the latency, which is set afterwards.
    pub(crate) fn new(
        start: &Start,
        latency_sigma_s: f64,
        known: &Parameters,
        config: &Config,
    ) -> Self {
        let tilt = single(start.tilt_sigma_rad);
        let earth = start.earth_rate_radps.x;
        let bias = |axis| {
            let sigma = gyro_sigma(known, axis, config);
            single(math::sqrt(sigma * sigma + earth * earth))
        };
        let arm = |axis| single(known.sigma(index::LEVER_ARM + axis));
        let half = core::f32::consts::FRAC_1_SQRT_2;
        let sigma = [
            0.0,
            0.0,
            tilt,
            tilt,
            0.0,
            bias(0),
            bias(1),
            bias(2),
            half,
            half,
            single(latency_sigma_s),
            arm(0),
            arm(1),
            arm(2),
        ];
        Self {
            node: 0,
            observation: 0,
            time: start.time,
            attitude: start.attitude,
            gyro_bias_radps: known.vector(index::GYRO),
            latency_s: 0.0,
            lever_arm_m: known.lever_arm().map(single),
            first_mps: None,
            velocity_mps: Vector2::zeros(),
            way_m: Vector2::zeros(),
            risen_mps: 0.0,
            velocity_before_mps: Vector2::zeros(),
            level_before: Matrix2x3::zeros(),
            last_mps: Vector2::zeros(),
            last_observed_mps: Vector2::zeros(),
            regressor_mps: Vector2::zeros(),
            ins_power: 0.0,
            gnss_power: 0.0,
            last_change_mps: Vector2::zeros(),
            steady_s: 0.0,
            last_observation: start.time,
            accel_mps2: Vector2::zeros(),
            first_accel_mps2: Vector2::zeros(),
            swing_radps: Matrix2x3::zeros(),
            angle_sigma_rad: UNKNOWN_ANGLE_RAD,
            had_angle: false,
            rotation: Vector2::zeros(),
            covariance: Covariance::from_sigma(&Row::from(sigma)),
            log_likelihood: 0.0,
        }
    }

    /// Whether it has fallen since the start as no vehicle does: its level is wrong.
    pub(crate) fn is_falling(&self, start: Time) -> bool {
        let seconds = self.time.seconds_since(start);
        seconds > FALLING_S && f64::from(self.risen_mps) < -FALLING_MPS2 * seconds
    }

    /// Time of the INS that a stamp refers to, s after its own.
    pub(crate) fn seconds_to(&self, stamp: Time) -> f64 {
        stamp.seconds_since(self.time) - f64::from(self.latency_s)
    }

    /// Advances over a node.
    pub(crate) fn advance(&mut self, node: &Node, up_rate_radps: f64, config: &Config) {
        let seconds = node.seconds();
        let body = matrix(&self.attitude);
        let (turn, gained) = node.without_bias(&self.gyro_bias_radps);
        let force = (body * gained).map(single);
        let dt = single(seconds);
        self.way_m += dt * (self.velocity_mps + 0.5 * force.xy());
        self.velocity_mps += force.xy();
        self.risen_mps += force.z - dt * single(GRAVITY_EQUATOR_MPS2);
        let swing = swing_of(&body, &(turn / seconds));
        let swung = (swing - self.swing_radps) * self.lever_arm_m;
        self.swing_radps = swing;
        let part = single(math::min(seconds / SMOOTH_S, 1.0));
        let accel = (force.xy() + swung) / dt;
        self.accel_mps2 += part * (accel - self.accel_mps2);
        self.propagate(&force, &(body.map(single) * dt));
        self.add_noise(seconds, &turn, &force, config);
        let earth = Vector3::new(0.0, 0.0, -seconds * up_rate_radps);
        self.attitude =
            renormalized(small_rotation(&earth) * self.attitude.as_ref() * small_rotation(&turn));
        self.time = self.time.plus_seconds(seconds);
        self.node += 1;
    }

    /// `e' = f x phi`, `phi' = -C b`.
    fn propagate(&mut self, force: &Vector3<f32>, body: &Matrix3<f32>) {
        let p = &mut self.covariance;
        p.shear(ERROR, TILT + 1, -force.z);
        p.shear(ERROR, TILT + 2, force.y);
        p.shear(ERROR + 1, TILT, force.z);
        p.shear(ERROR + 1, TILT + 2, -force.x);
        for (axis, column) in body.column_iter().enumerate() {
            for (tilt, part) in column.iter().enumerate() {
                p.shear(TILT + tilt, BIAS + axis, -part);
            }
        }
    }

    /// Process noise of the sensors and of what turns with the body.
    fn add_noise(
        &mut self,
        seconds: f64,
        turn_rad: &Vector3<f64>,
        force: &Vector3<f32>,
        config: &Config,
    ) {
        let s = &config.sensors;
        let turned = math::sqrt(turn_rad.norm_squared());
        let bias = s.accel_bias_mps2 / GRAVITY_EQUATOR_MPS2;
        let (gyro, accel) = (s.mean_gyro_noise(), s.mean_accel_noise());
        let tilt = gyro * gyro * seconds + (bias * bias + s.gyro_scale * s.gyro_scale) * turned;
        let push = f64::from(force.xy().norm_squared()) * PUSH_S / seconds;
        let velocity = accel * accel * seconds + s.accel_scale * s.accel_scale * push;
        for axis in 0..2 {
            self.covariance.widen(ERROR + axis, single(velocity));
            self.covariance.widen(TILT + axis, single(tilt));
        }
        let heading = gyro * gyro * seconds + s.gyro_scale * s.gyro_scale * turned;
        self.covariance.widen(TILT + 2, single(heading));
        self.covariance
            .widen(LATENCY, single(LATENCY_WALK * LATENCY_WALK * seconds));
    }

    /// Measurement update with an observation; its time is in `node`, the next one. `excess` is the ratio
    /// of its noise to the stated one, in variance. Returns the mean normalized square of the residuals.
    #[inline(never)]
    pub(crate) fn compare(&mut self, observation: &Observation, excess: f32, node: &Node) -> f32 {
        self.observation += 1;
        let moment = self.moment(observation, node);
        let velocity_before = self.velocity_before_mps;
        let level_before = core::mem::replace(&mut self.level_before, moment.level);
        let Some(first) = self.first_mps else {
            self.begin(observation, moment.velocity_mps, &moment.swing_radps);
            return 1.0;
        };
        self.velocity_before_mps = moment.velocity_mps;
        let predicted = if observation.span_s > 0.0 {
            moment.mean(observation.span_s, velocity_before, &level_before)
        } else {
            Predicted {
                velocity_mps: moment.velocity_mps,
                accel_mps2: self.accel_mps2,
                offset_s: moment.seconds,
                swing_radps: moment.swing_radps,
            }
        };
        let white = excess * observation.sigma_mps * observation.sigma_mps;
        let since_s = observation.time.seconds_since(self.last_observation);
        if since_s < GROSS_S && self.is_gross(observation, &predicted, white, single(since_s)) {
            return OUTLIER_SIGMAS * OUTLIER_SIGMAS;
        }
        let antenna = predicted.velocity_mps + predicted.swing_radps * self.lever_arm_m;
        let d = observation.velocity_mps - first;
        self.ins_power += predicted.velocity_mps.norm_squared();
        self.gnss_power += d.norm_squared();
        self.last_observation = observation.time;
        let spurious = self.regressor(d, antenna, white, since_s);
        let regressor = self.regressor_mps;
        let unknown = self.covariance.variance(COS) + self.covariance.variance(SIN);
        // Second order of the latency: half the jerk times its square.
        let late = self.covariance.variance(LATENCY);
        let noise = observation.shared * white
            + 0.5 * late * late * moment.jerk_mps3.norm_squared()
            + 0.5 * unknown * (d - regressor).norm_squared();
        let late = predicted.accel_mps2 - self.first_accel_mps2;
        let (force, swing) = (&moment.force_mps2, &predicted.swing_radps);
        let rows = [
            row(0, regressor, predicted.offset_s, force, late.x, swing),
            row(
                1,
                right_of(regressor),
                predicted.offset_s,
                force,
                late.y,
                swing,
            ),
        ];
        let residual = [
            antenna.x - self.rotation.dot(&d),
            antenna.y - self.rotation.dot(&right_of(d)),
        ];
        self.last_mps = predicted.velocity_mps;
        self.last_observed_mps = observation.velocity_mps;
        let misfit = self.fuse_both(&rows, residual, noise, spurious);
        self.normalize();
        self.rotate_reference(regressor);
        if self.steady_s > STEADY_S && self.angle_is_lost() {
            self.forget_angle();
            self.begin(observation, moment.velocity_mps, swing);
        }
        misfit
    }

    /// Whether GNSS velocity changes as the INS does not: how much it changes needs no heading. Noise, tilt,
    /// the swing of the antenna and a latency while the vehicle speeds up explain some of it. A wrong latency
    /// also cuts a manoeuvre elsewhere: the INS may have half of a change within the interval.
    fn is_gross(
        &self,
        observation: &Observation,
        predicted: &Predicted,
        white: f32,
        since_s: f32,
    ) -> bool {
        let p = &self.covariance;
        let tilt = math::max(p.variance(TILT), p.variance(TILT + 1));
        let tilted = single(GRAVITY_EQUATOR_MPS2) * since_s;
        let arm = self.arm_variance().sum() + self.lever_arm_m.norm_squared();
        let accel = predicted.accel_mps2.norm_squared() + FIRST_ACCEL_MPS2 * FIRST_ACCEL_MPS2;
        let variance = 2.0 * observation.shared * white
            + tilt * tilted * tilted
            + 2.0 * arm * predicted.swing_radps.norm_squared()
            + p.variance(LATENCY) * accel;
        let gained = (predicted.velocity_mps - self.last_mps).norm_squared();
        let change = (observation.velocity_mps - self.last_observed_mps).norm_squared();
        change > 4.0 * gained + GROSS_SIGMAS * GROSS_SIGMAS * variance
    }

    /// Motion at the time of an observation, where the next displacement begins.
    fn moment(&mut self, observation: &Observation, node: &Node) -> Moment {
        let seconds = single(self.seconds_to(observation.time));
        let node_s = single(node.seconds());
        let body = matrix(&self.attitude);
        let (turn, gained) = node.without_bias(&self.gyro_bias_radps);
        let force_mps2 = (body * gained).map(single) / node_s;
        let accel = force_mps2.xy();
        let way = seconds * (self.velocity_mps + 0.5 * seconds * accel);
        let way_m = self.way_m + way;
        self.way_m = -way;
        let swing_radps = swing_of(&body, &(turn / node.seconds()));
        let swung = (swing_radps - self.swing_radps) / node_s * self.lever_arm_m;
        Moment {
            seconds,
            force_mps2,
            velocity_mps: self.velocity_mps + seconds * accel,
            way_m,
            level: level_rows(&body),
            swing_radps,
            jerk_mps3: (accel + swung - self.accel_mps2) / single(SMOOTH_S),
        }
    }

    /// Updates with both residuals, of equal noise, `spurious` the noise of the regressor. Returns their
    /// mean normalized square.
    fn fuse_both(&mut self, rows: &[Row; 2], residual: [f32; 2], noise: f32, spurious: f32) -> f32 {
        let mut correction = Row::zeros();
        let mut misfit = 0.0;
        let mut expected = 0.0;
        let before = [COS, SIN].map(|i| self.covariance.variance(i));
        for (h, residual) in rows.iter().zip(residual) {
            let (ratio, variance) = self.fuse(h, residual, noise, &mut correction);
            let log = single(libm::log(f64::from(variance)));
            self.log_likelihood -= 0.5 * (limited(ratio) + log);
            misfit += 0.5 * ratio;
            expected += 0.5 * variance;
        }
        for (unknown, before) in [COS, SIN].into_iter().zip(before) {
            self.restore_variance(unknown, before, 2.0 * spurious / expected);
        }
        self.correct(&correction);
        misfit
    }

    /// Updates the regressor: from the INS by the known angle, without noise; if GNSS contradicts that, or
    /// without an angle, from GNSS while it changes by more than noise. Returns the variance of its noise.
    fn regressor(&mut self, d: Vector2<f32>, seen: Vector2<f32>, white: f32, since_s: f64) -> f32 {
        let least = STEADY_SIGMAS * STEADY_SIGMAS * 2.0 * white;
        self.steady_s += single(since_s);
        if (d - self.last_change_mps).norm_squared() > least {
            self.last_change_mps = d;
            self.steady_s = 0.0;
        }
        let (cos, sin) = (self.rotation.x, self.rotation.y);
        let predicted = Vector2::new(cos * seen.x - sin * seen.y, sin * seen.x + cos * seen.y);
        if self.knows_angle() && (d - predicted).norm_squared() < least {
            self.regressor_mps = predicted;
        } else if self.steady_s < HOLD_S {
            let part = single(since_s / (since_s + MEAN_S));
            self.regressor_mps += part * (d - self.regressor_mps);
            return UNDERSTATED * white * part / (2.0 - part);
        }
        0.0
    }

    /// Noise of the regressor removes `P n^2 P / S` of variance per measurement too much, toward zero. That
    /// is given back.
    fn restore_variance(&mut self, unknown: usize, before: f32, noise: f32) {
        let room = 0.5 - self.covariance.variance(unknown);
        let back = math::min(before * before * noise, room);
        if back > 0.0 {
            self.covariance.widen(unknown, back);
        }
    }

    /// Whether cosine and sine are linear in their angle.
    fn knows_angle(&self) -> bool {
        f64::from(self.angle_sigma_rad) < KNOWN_ANGLE_RAD
    }

    /// Whether the angle is too uncertain to be linear.
    fn angle_is_lost(&self) -> bool {
        let limit = if self.had_angle {
            LOST_ANGLE_RAD
        } else {
            core::f64::consts::PI
        };
        f64::from(self.angle_sigma_rad) > limit
    }

    /// Whether cosine and sine are too short for any angle, with little INS motion.
    pub(crate) fn is_degenerate(&self) -> bool {
        let short = 1.0 - math::sqrt(f64::from(self.rotation.norm_squared()));
        let [cos, sin] = [COS, SIN].map(|i| f64::from(self.covariance.variance(i)));
        let sigma = math::sqrt(math::max(cos, sin)) + LENGTH_ERROR;
        let hardly_moved = self.ins_power < LEAST_POWER_SHARE * LEAST_POWER_SHARE * self.gnss_power;
        hardly_moved && !self.knows_angle() && short > SHORT_SIGMAS * sigma
    }

    /// Restarts with the next observation, but keeps tilt, gyro biases and latency.
    pub(crate) fn restart_search(&mut self, known: &Parameters) {
        self.forget_angle();
        self.first_mps = None;
        self.lever_arm_m = known.lever_arm().map(single);
        for axis in 0..3 {
            let sigma = single(known.sigma(index::LEVER_ARM + axis));
            self.covariance.reset(ARM + axis, sigma * sigma);
        }
        self.log_likelihood = 0.0;
    }

    /// Forgets an uncertain heading in steady motion: beyond some angle the equations are not linear, and
    /// an unknown heading has an exact start.
    fn forget_angle(&mut self) {
        self.rotation = Vector2::zeros();
        self.angle_sigma_rad = UNKNOWN_ANGLE_RAD;
        self.had_angle = false;
        for unknown in [COS, SIN] {
            self.covariance.reset(unknown, 0.5);
        }
    }

    /// First observation: velocities count from here.
    fn begin(&mut self, first: &Observation, velocity: Vector2<f32>, swing: &Matrix2x3<f32>) {
        self.velocity_mps -= velocity;
        self.first_mps = Some(first.velocity_mps);
        self.way_m = Vector2::zeros();
        self.velocity_before_mps = Vector2::zeros();
        self.last_mps = Vector2::zeros();
        self.last_observed_mps = first.velocity_mps;
        self.regressor_mps = Vector2::zeros();
        self.ins_power = 0.0;
        self.gnss_power = 0.0;
        self.last_change_mps = Vector2::zeros();
        self.steady_s = 0.0;
        self.last_observation = first.time;
        self.first_accel_mps2 = self.accel_mps2;
        let off = 0.5 * first.span_s * FIRST_ACCEL_MPS2;
        let swung = swing.component_mul(swing) * self.arm_variance();
        for (axis, swung) in swung.iter().enumerate() {
            let noise = first.shared * first.sigma_mps * first.sigma_mps + off * off + swung;
            self.covariance.reset(ERROR + axis, noise);
        }
    }

    fn arm_variance(&self) -> Vector3<f32> {
        [0, 1, 2]
            .map(|axis| self.covariance.variance(ARM + axis))
            .into()
    }

    /// Scalar measurement update of covariance and correction; returns the normalized square of the
    /// residual, and its variance.
    fn fuse(&mut self, h: &Row, residual: f32, noise: f32, correction: &mut Row) -> (f32, f32) {
        let left = residual - h.dot(correction);
        let with = self.covariance.times(h);
        let expected = with.dot(h) + noise;
        let ratio = left * left / expected;
        let variance = math::max(expected * ratio / limited(ratio), expected);
        self.covariance.update(&with, variance);
        *correction += with * (left / variance);
        (ratio, expected)
    }

    /// Length of cosine and sine as a measurement, once their angle is known.
    fn normalize(&mut self) {
        let (turn, grow) = self.directions();
        let angle = self.covariance.sigma_of(&turn);
        let seen = math::sqrt(f64::from(self.rotation.norm_squared())) > LEAST_LENGTH;
        self.angle_sigma_rad = if seen {
            single(angle)
        } else {
            UNKNOWN_ANGLE_RAD
        };
        let length = self.covariance.sigma_of(&grow);
        self.had_angle |= self.knows_angle();
        if !(self.knows_angle() && length > LENGTH_ERROR) {
            return;
        }
        let off = 1.0 - math::sqrt(f64::from(self.rotation.norm_squared()));
        // Second order of the angle: 1 - cos.
        let noise = LENGTH_ERROR * LENGTH_ERROR + 0.25 * angle * angle * angle * angle;
        let mut correction = Row::zeros();
        let (ratio, _) = self.fuse(&grow, single(off), single(noise), &mut correction);
        self.log_likelihood -= 0.5 * limited(ratio);
        self.correct(&correction);
    }

    /// Refers the rotation to the present frame: `(c, s)` turn by the frame's turn since the last time, `e`
    /// by the effect on the velocity. A turn before the heading is known is thus forgotten: any rotation is
    /// as likely as another.
    fn rotate_reference(&mut self, regressor: Vector2<f32>) {
        let turn = self.rotation;
        let (x, y) = (turn.dot(&regressor), turn.dot(&right_of(regressor)));
        let p = &mut self.covariance;
        p.shear(COS, TILT + 2, -turn.y);
        p.shear(SIN, TILT + 2, turn.x);
        p.shear(ERROR, TILT + 2, -y);
        p.shear(ERROR + 1, TILT + 2, x);
        p.reset(TILT + 2, 0.0);
    }

    /// Partials of the angle of cosine and sine, with the turn since, and of their length.
    fn directions(&self) -> (Row, Row) {
        let rotation = self.rotation.map(f64::from);
        let square = math::max(rotation.norm_squared(), 1e-6);
        let along = rotation / math::sqrt(square);
        let mut turn = Row::zeros();
        let mut grow = Row::zeros();
        for (i, h_turn, h_grow) in [
            (TILT + 2, 1.0, 0.0),
            (COS, -rotation.y / square, along.x),
            (SIN, rotation.x / square, along.y),
        ] {
            if let (Some(turn), Some(grow)) = (turn.get_mut(i), grow.get_mut(i)) {
                (*turn, *grow) = (single(h_turn), single(h_grow));
            }
        }
        (turn, grow)
    }

    /// Corrects the INS.
    fn correct(&mut self, found: &Row) {
        let at = |i: usize| found.get(i).copied().unwrap_or(0.0);
        let wide = |i: usize| f64::from(at(i));
        let error = Vector2::new(at(ERROR), at(ERROR + 1));
        self.velocity_mps -= error;
        self.velocity_before_mps -= error;
        self.last_mps -= error;
        let mut tilt = Vector3::new(wide(TILT), wide(TILT + 1), wide(TILT + 2));
        let size = math::sqrt(tilt.norm_squared());
        if size > LARGEST_TURN_RAD {
            tilt *= LARGEST_TURN_RAD / size;
        }
        // C = (I + [phi x]) C of before.
        self.attitude = renormalized(small_rotation(&tilt) * self.attitude.as_ref());
        self.gyro_bias_radps += Vector3::new(wide(BIAS), wide(BIAS + 1), wide(BIAS + 2));
        self.rotation += Vector2::new(at(COS), at(SIN));
        self.latency_s += at(LATENCY);
        self.lever_arm_m += Vector3::new(at(ARM), at(ARM + 1), at(ARM + 2));
    }

    /// Estimates so far.
    pub(crate) fn found(&self) -> Found {
        let rotation = self.rotation.map(f64::from);
        let length = math::sqrt(rotation.norm_squared());
        let (turn, grow) = self.directions();
        let deviation = |i: usize| math::sqrt(f64::from(self.covariance.variance(i)));
        Found {
            rotation_rad: math::atan2(rotation.y, rotation.x),
            rotation_sigma_rad: self.covariance.sigma_of(&turn),
            length,
            length_sigma: self.covariance.sigma_of(&grow),
            tilt_sigma_rad: math::max(deviation(TILT), deviation(TILT + 1)),
            latency_s: f64::from(self.latency_s),
            latency_sigma_s: deviation(LATENCY),
            gyro_bias_radps: self.gyro_bias_radps,
            gyro_sigma_radps: [0, 1, 2].map(|axis| deviation(BIAS + axis)).into(),
        }
    }

    /// Body to its level frame of arbitrary azimuth.
    pub(crate) fn attitude(&self) -> &UnitQuaternion<f64> {
        &self.attitude
    }

    /// Velocity of the vehicle, E and N, m/s: the last observation that was used, and what was gained since.
    pub(crate) fn velocity_en_mps(&self) -> Vector2<f64> {
        let u = (self.velocity_mps - self.last_mps).map(f64::from);
        let turn = self.rotation.map(f64::from);
        let length = math::max(math::sqrt(turn.norm_squared()), 1e-3);
        let (cos, sin) = (turn.x / length, turn.y / length);
        let gained = Vector2::new(cos * u.x - sin * u.y, sin * u.x + cos * u.y);
        self.last_observed_mps.map(f64::from) + gained
    }
}

/// Bounds a normalized square.
fn limited(ratio: f32) -> f32 {
    math::min(ratio, OUTLIER_SIGMAS * OUTLIER_SIGMAS)
}

/// Regressor of the sine, for the second component.
fn right_of(d: Vector2<f32>) -> Vector2<f32> {
    Vector2::new(d.y, -d.x)
}

/// Sigma of a gyro bias, rad/s. The preset has the usual one, not the possible.
fn gyro_sigma(known: &Parameters, axis: usize, config: &Config) -> f64 {
    let sigma = known.sigma(index::GYRO + axis);
    let preset = single(config.sensors.gyro_bias_radps);
    if known.value(index::GYRO + axis) == 0.0 && sigma >= f64::from(preset) {
        UNKNOWN_UNIT * sigma
    } else {
        sigma
    }
}

/// Largest sigma of a gyro bias, rad/s.
#[inline(never)]
pub(crate) fn largest_gyro_sigma(known: &Parameters, config: &Config) -> f64 {
    (0..3).fold(0.0, |widest, axis| {
        math::max(widest, gyro_sigma(known, axis, config))
    })
}

/// Motion at the time of an observation, in the level frame of arbitrary azimuth.
struct Moment {
    /// After the time of the INS, s.
    seconds: f32,
    force_mps2: Vector3<f32>,
    velocity_mps: Vector2<f32>,
    /// Since the last observation, m.
    way_m: Vector2<f32>,
    level: Matrix2x3<f32>,
    swing_radps: Matrix2x3<f32>,
    /// Of the antenna, m/s^3.
    jerk_mps3: Vector2<f32>,
}

impl Moment {
    /// Mean since the last observation, with velocity and attitude there.
    fn mean(&self, span_s: f32, velocity_mps: Vector2<f32>, level: &Matrix2x3<f32>) -> Predicted {
        Predicted {
            velocity_mps: self.way_m / span_s,
            accel_mps2: (self.velocity_mps - velocity_mps) / span_s,
            offset_s: self.seconds - 0.5 * span_s,
            swing_radps: (self.level - level) / span_s,
        }
    }
}

/// Predicted motion for an observation.
struct Predicted {
    velocity_mps: Vector2<f32>,
    accel_mps2: Vector2<f32>,
    /// Time after that of the INS, s.
    offset_s: f32,
    swing_radps: Matrix2x3<f32>,
}

/// Estimates of a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Found {
    /// Rotation from its frame to the true one, counter-clockwise, rad.
    pub(crate) rotation_rad: f64,
    pub(crate) rotation_sigma_rad: f64,
    /// Length of cosine and sine, 1 if the motions agree.
    pub(crate) length: f64,
    pub(crate) length_sigma: f64,
    pub(crate) tilt_sigma_rad: f64,
    pub(crate) latency_s: f64,
    pub(crate) latency_sigma_s: f64,
    pub(crate) gyro_bias_radps: Vector3<f64>,
    pub(crate) gyro_sigma_radps: Vector3<f64>,
}

/// Velocity of an antenna, east and north, per unit of its arm, 1/s.
fn swing_of(to_level: &Matrix3<f64>, rate_radps: &Vector3<f64>) -> Matrix2x3<f32> {
    level_rows(&(to_level * rate_radps.cross_matrix()))
}

/// East and north rows of the attitude.
fn level_rows(to_level: &Matrix3<f64>) -> Matrix2x3<f32> {
    to_level.fixed_rows::<2>(0).map(single)
}

/// Partials of a component of `u`, `offset_s` after the INS's time.
fn row(
    axis: usize,
    regressor: Vector2<f32>,
    offset_s: f32,
    force: &Vector3<f32>,
    late: f32,
    swing: &Matrix2x3<f32>,
) -> Row {
    let (x, y, z) = (offset_s * force.x, offset_s * force.y, offset_s * force.z);
    let [error_x, error_y, tilt_x, tilt_y, turn] = if axis == 0 {
        [1.0, 0.0, 0.0, -z, y]
    } else {
        [0.0, 1.0, z, 0.0, -x]
    };
    let arm = |component: usize| -swing.get((axis, component)).copied().unwrap_or(0.0);
    Row::from([
        error_x,
        error_y,
        tilt_x,
        tilt_y,
        turn,
        0.0,
        0.0,
        0.0,
        regressor.x,
        regressor.y,
        late,
        arm(0),
        arm(1),
        arm(2),
    ])
}
