//! Heading from motion, for any unknown heading, with one latency supposed.
//!
//! A levelled INS without a heading sees the velocity gained since the first fix, `u`, in a level
//! frame that points anywhere. GNSS sees `v`, and of its gain `d = v - v_1` the same frame sees
//! `c d + s d'`, with `(c, s)` the cosine and sine of the rotation that is sought and
//! `d' = (d_N, -d_E)`. So, `e` being the error of `u` and `a` the acceleration,
//!
//! `u = e + c d + s d' + l (a - a_1)`
//!
//! is linear in everything unknown: a heading about which nothing is known starts as
//! `(c, s) = 0` with variance 1/2 each, exactly the mean and variance of a direction on a circle.
//! `l` is what the latency exceeds the supposed one by; the first fix is as late as the others.
//! `e` grows by (1)-(2): `e' = f x phi`, `phi' = -C b`, with tilt `phi` and gyro biases `b`; about
//! up `phi` is the turn of the frame since the first fix, so the up gyro's bias, which bends `u`
//! against `v` more and more, comes out of the same equations. What is found of `e`, `phi`, `b`
//! and `l` goes into the INS at once, so that they stay small; biases of degrees per second and
//! the tilt of a start in a banked turn are then no matter of small angles.
//!
//! Mean velocities (of positions) are those of `u`, and of `e` half of the time ago.
//!
//! Accelerometer biases are not among the unknowns: at one attitude they are tilt. As the body
//! turns, they turn against the level frame, and the tilt walks by as much.

use nalgebra::{SVector, UnitQuaternion, Vector2, Vector3};

use super::covariance::Covariance;
use super::nodes::Node;
use super::sightings::Sighting;
use crate::attitude::{matrix, renormalized, small_rotation};
use crate::config::Config;
use crate::earth::GRAVITY_EQUATOR_MPS2;
use crate::estimators::parameters::{Parameters, index};
use crate::math::{self, single};
use crate::time::Time;

/// The unknowns: velocity error, tilt and turn, gyro biases, cosine and sine, latency.
const ERROR: usize = 0;
const TILT: usize = 2;
const BIAS: usize = 5;
const COS: usize = 8;
const SIN: usize = 9;
const LATENCY: usize = 10;
const COUNT: usize = 11;
const PAIRS: usize = COUNT * (COUNT + 1) / 2;

/// One number for each unknown.
type Row = SVector<f32, COUNT>;

/// Gain of speed below which the noise of GNSS itself would look like motion, sigmas: a vehicle
/// that keeps its speed shows no heading, however long.
const STEADY_SIGMAS: f32 = 4.0;
/// Residual beyond which a measurement counts less, sigmas.
const OUTLIER_SIGMAS: f32 = 3.0;
/// Acceleration of a vehicle while the first mean velocity is taken, m/s^2.
const FIRST_ACCEL_MPS2: f32 = 2.0;
/// Time over which an acceleration keeps its direction in the body, s.
const PUSH_S: f64 = 1.0;
/// Largest tilt found at once that is believed, rad.
const LARGEST_TURN_RAD: f64 = 0.5;

/// What the INS of a candidate starts from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Start {
    pub(crate) time: Time,
    pub(crate) attitude: UnitQuaternion<f64>,
    pub(crate) tilt_sigma_rad: f64,
    /// Earth rotation about the level and the up axis, rad/s.
    pub(crate) earth_rate_radps: Vector2<f64>,
}

/// A level INS that points anywhere, with one latency supposed, and what it has seen.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Candidate {
    /// Node and sighting that come next.
    pub(crate) node: u32,
    pub(crate) sighting: u32,
    time: Time,
    attitude: UnitQuaternion<f64>,
    gyro_bias_radps: Vector3<f64>,
    latency_s: f32,
    /// Velocity gained since the first sighting, way since the last, and velocity there.
    velocity_mps: Vector2<f32>,
    way_m: Vector2<f32>,
    velocity_before_mps: Vector2<f32>,
    /// Acceleration at the first sighting.
    first_accel_mps2: Option<Vector2<f32>>,
    /// Cosine and sine.
    rotation: Vector2<f32>,
    covariance: Covariance<COUNT, PAIRS>,
    /// Logarithm of the likelihood of all it has seen.
    pub(crate) log_likelihood: f32,
}

/// What GNSS measured, against the first sighting.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gain {
    pub(crate) sighting: Sighting,
    /// Velocity gained since the first, E and N, m/s.
    pub(crate) velocity_mps: Vector2<f32>,
    /// Factor by which the noise proved larger, in variance.
    pub(crate) excess: f32,
}

impl Candidate {
    /// Starts with a latency supposed and its spread.
    pub(crate) fn new(
        start: &Start,
        latency_s: f64,
        latency_sigma_s: f64,
        known: &Parameters,
        config: &Config,
    ) -> Self {
        let tilt = single(start.tilt_sigma_rad);
        let bias = |axis| {
            let sigma = known.sigma(index::GYRO + axis);
            let earth = start.earth_rate_radps.x;
            // The preset says what is usual of units, not what one may be.
            let unusual = if sigma < config.sensors.gyro_bias_radps {
                1.0
            } else {
                2.0
            };
            single(math::sqrt(sigma * sigma * unusual * unusual + earth * earth))
        };
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
        ];
        Self {
            node: 0,
            sighting: 0,
            time: start.time,
            attitude: start.attitude,
            gyro_bias_radps: known.vector(index::GYRO),
            latency_s: single(latency_s),
            velocity_mps: Vector2::zeros(),
            way_m: Vector2::zeros(),
            velocity_before_mps: Vector2::zeros(),
            first_accel_mps2: None,
            rotation: Vector2::zeros(),
            covariance: Covariance::from_sigma(&Row::from(sigma)),
            log_likelihood: 0.0,
        }
    }

    /// Moment of the INS that a stamp shows, s after where it stands.
    pub(crate) fn seconds_to(&self, stamp: Time) -> f64 {
        stamp.seconds_since(self.time) - f64::from(self.latency_s)
    }

    /// Advances over a node.
    pub(crate) fn advance(&mut self, node: &Node, up_rate_radps: f64, config: &Config) {
        let seconds = node.seconds();
        let body = matrix(&self.attitude);
        let (turn, gained) = node.without_bias(&self.gyro_bias_radps, &Vector3::zeros());
        let force = (body * gained).map(single);
        let dt = single(seconds);
        self.way_m += dt * (self.velocity_mps + 0.5 * force.xy());
        self.velocity_mps += force.xy();
        self.spread(&force, &(body.map(single) * dt));
        self.walk(seconds, &turn, &force, config);
        let earth = Vector3::new(0.0, 0.0, -seconds * up_rate_radps);
        self.attitude = renormalized(
            small_rotation(&earth) * self.attitude.as_ref() * small_rotation(&turn),
        );
        self.time = self.time.plus_seconds(seconds);
        self.node += 1;
    }

    /// `e' = f x phi`, `phi' = -C b`.
    fn spread(&mut self, force: &Vector3<f32>, body: &nalgebra::Matrix3<f32>) {
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

    /// What the sensors' noise and what turns with the body add.
    fn walk(
        &mut self,
        seconds: f64,
        turn_rad: &Vector3<f64>,
        force: &Vector3<f32>,
        config: &Config,
    ) {
        let s = &config.sensors;
        let turned = math::sqrt(turn_rad.norm_squared());
        let bias = s.accel_bias_mps2 / GRAVITY_EQUATOR_MPS2;
        let tilt = s.gyro_noise * s.gyro_noise * seconds
            + (bias * bias + s.gyro_scale * s.gyro_scale) * turned;
        let push = f64::from(force.xy().norm_squared()) * PUSH_S / seconds;
        let velocity = s.accel_noise * s.accel_noise * seconds + s.accel_scale * s.accel_scale * push;
        for axis in 0..2 {
            self.covariance.widen(ERROR + axis, single(velocity));
            self.covariance.widen(TILT + axis, single(tilt));
        }
        let heading = s.gyro_noise * s.gyro_noise * seconds + s.gyro_scale * s.gyro_scale * turned;
        self.covariance.widen(TILT + 2, single(heading));
    }

    /// Compares with what GNSS saw; the moment lies in `node`, which comes next. Returns the mean
    /// square of the two residuals over what they should be.
    pub(crate) fn compare(&mut self, gain: &Gain, node: &Node, config: &Config) -> f32 {
        self.sighting += 1;
        let seconds = single(self.seconds_to(gain.sighting.time));
        let body = matrix(&self.attitude);
        let (turn, gained) = node.without_bias(&self.gyro_bias_radps, &Vector3::zeros());
        let force = (body * gained).map(single) / single(node.seconds());
        let accel = force.xy();
        let velocity = self.velocity_mps + seconds * accel;
        let way = self.way_m + seconds * (self.velocity_mps + 0.5 * seconds * accel);
        self.way_m = -seconds * (self.velocity_mps + 0.5 * seconds * accel);
        let Some(first_accel) = self.first_accel_mps2 else {
            self.begin(&gain.sighting, &velocity, &accel);
            return 1.0;
        };
        let span_s = gain.sighting.span_s;
        let (seen, accel, back_s) = if span_s > 0.0 {
            let mean_accel = (velocity - self.velocity_before_mps) / span_s;
            (way / span_s, mean_accel, seconds - 0.5 * span_s)
        } else {
            (velocity, accel, seconds)
        };
        self.velocity_before_mps = velocity;
        let up_rate = single((body * turn).z) / single(node.seconds());
        let lever = single(config.gnss.lever_arm_sigma_m) * up_rate;
        let s = gain.sighting.sigma_mps;
        let mut noise = gain.excess * s * s + lever * lever;
        let d = gain.velocity_mps;
        let mut moved = d;
        if d.norm_squared() < STEADY_SIGMAS * STEADY_SIGMAS * noise {
            noise += 0.5 * d.norm_squared();
            moved = Vector2::zeros();
        }
        let late = accel - first_accel;
        let rows = [
            row(0, &moved, back_s, &force, late.x),
            row(1, &Vector2::new(moved.y, -moved.x), back_s, &force, late.y),
        ];
        // The second of two rows rotated by a right angle: c d_N - s d_E.
        let [x, y] = rows;
        let explained = |h: &Row| {
            let at = |i: usize| h.get(i).copied().unwrap_or(0.0);
            at(COS) * self.rotation.x + at(SIN) * self.rotation.y
        };
        let residual = Vector2::new(seen.x - explained(&x), seen.y - explained(&y));
        let (correction, first) = self.weigh(&x, residual.x, noise, &Row::zeros());
        let (correction, second) = self.weigh(&y, residual.y, noise, &correction);
        self.correct(&correction);
        0.5 * (first + second)
    }

    /// The first sighting: velocities count from here.
    fn begin(&mut self, first: &Sighting, velocity: &Vector2<f32>, accel: &Vector2<f32>) {
        self.velocity_mps -= velocity;
        // Way and velocity so far were those before the zero was set.
        self.way_m = Vector2::zeros();
        self.velocity_before_mps = Vector2::zeros();
        self.first_accel_mps2 = Some(*accel);
        let off = 0.5 * first.span_s * FIRST_ACCEL_MPS2;
        for axis in 0..2 {
            let noise = first.sigma_mps * first.sigma_mps + off * off;
            self.covariance.renew(ERROR + axis, noise);
        }
    }

    /// Takes one residual into covariance and correction.
    fn weigh(&mut self, h: &Row, residual: f32, noise: f32, correction: &Row) -> (Row, f32) {
        let left = residual - h.dot(correction);
        let with = self.covariance.with(h);
        let spread = with.dot(h);
        let ratio = left * left / (spread + noise);
        let limit = OUTLIER_SIGMAS * OUTLIER_SIGMAS;
        let variance = if ratio > limit {
            left * left / limit
        } else {
            spread + noise
        };
        let likely = if ratio > limit { limit } else { ratio };
        self.log_likelihood -= 0.5 * (likely + single(libm::log(f64::from(spread + noise))));
        self.covariance.measure(&with, variance);
        (correction + with * (left / variance), ratio)
    }

    /// Puts what was found into the INS.
    fn correct(&mut self, found: &Row) {
        let at = |i: usize| found.get(i).copied().unwrap_or(0.0);
        let wide = |i: usize| f64::from(at(i));
        self.velocity_mps -= Vector2::new(at(ERROR), at(ERROR + 1));
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
    }

    /// What it has found so far.
    pub(crate) fn found(&self) -> Found {
        let rotation = self.rotation.map(f64::from);
        let length = math::sqrt(rotation.norm_squared());
        let square = math::max(rotation.norm_squared(), 1e-6);
        let mut turn = Row::zeros();
        let mut grow = Row::zeros();
        let along = rotation / math::sqrt(square);
        for (i, h_turn, h_grow) in [
            (TILT + 2, 1.0, 0.0),
            (COS, -rotation.y / square, along.x),
            (SIN, rotation.x / square, along.y),
        ] {
            if let (Some(turn), Some(grow)) = (turn.get_mut(i), grow.get_mut(i)) {
                (*turn, *grow) = (single(h_turn), single(h_grow));
            }
        }
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
            gyro_sigma_radps: Vector3::new(deviation(BIAS), deviation(BIAS + 1), deviation(BIAS + 2)),
        }
    }

    /// Where it stands, body to the frame that points anywhere.
    pub(crate) fn attitude(&self) -> &UnitQuaternion<f64> {
        &self.attitude
    }

    /// Velocity gained since the first sighting, turned to east and north, m/s.
    pub(crate) fn velocity_en_mps(&self) -> Vector2<f64> {
        let u = self.velocity_mps.map(f64::from);
        let turn = self.rotation.map(f64::from);
        let length = math::max(math::sqrt(turn.norm_squared()), 1e-3);
        let (cos, sin) = (turn.x / length, turn.y / length);
        Vector2::new(cos * u.x - sin * u.y, sin * u.x + cos * u.y)
    }
}

/// What a candidate has found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Found {
    /// Rotation from its frame to the true one, counter-clockwise, rad.
    pub(crate) rotation_rad: f64,
    pub(crate) rotation_sigma_rad: f64,
    /// Length of cosine and sine, 1 if the two motions are one.
    pub(crate) length: f64,
    pub(crate) length_sigma: f64,
    pub(crate) tilt_sigma_rad: f64,
    pub(crate) latency_s: f64,
    pub(crate) latency_sigma_s: f64,
    pub(crate) gyro_bias_radps: Vector3<f64>,
    pub(crate) gyro_sigma_radps: Vector3<f64>,
}

/// How a component of `u` hangs on the unknowns, `back_s` after the INS's moment.
fn row(axis: usize, moved: &Vector2<f32>, back_s: f32, force: &Vector3<f32>, late: f32) -> Row {
    let (x, y) = (back_s * force.x, back_s * force.y);
    let z = back_s * force.z;
    let (error, tilt) = if axis == 0 {
        ([1.0, 0.0], [0.0, -z, y])
    } else {
        ([0.0, 1.0], [z, 0.0, -x])
    };
    let [tilt_x, tilt_y, turn] = tilt;
    let [error_x, error_y] = error;
    Row::from([
        error_x, error_y, tilt_x, tilt_y, turn, 0.0, 0.0, 0.0, moved.x, moved.y, late,
    ])
}
