//! The recent past of the INS, for data that arrives late: a fixed-size ring.

use nalgebra::{Matrix3, Vector3};

use crate::earth::GRAVITY_EQUATOR_MPS2;
use crate::ring::Ring;
use crate::time::Time;

/// Least time between two moments in the ring, s.
const SPACING_S: f64 = 0.045;
/// Moments held: 0.6 s or more.
const CAPACITY: usize = 14;

/// The INS at one moment. All but the velocity are totals since the start, so that the
/// difference of any two moments is the exact integral between them.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Moment {
    /// When.
    pub time: Time,
    /// Velocity, ENU, m/s.
    pub velocity_mps: Vector3<f64>,
    /// Integral of specific force, ENU, m/s.
    pub force_mps: Vector3<f64>,
    /// Integral of `C_B^L`, s.
    pub attitude_s: Matrix3<f64>,
    /// Angle sensed about the body's up axis, rad.
    pub turn_rad: f64,
    /// `Phi` that controls and compensations have put into the platform, rad.
    pub control_tilt_rad: Vector3<f64>,
    /// Velocity error that controls and compensations have caused, tilt included, m/s.
    pub control_velocity_mps: Vector3<f64>,
}

impl Moment {
    /// All totals zero.
    pub fn start(time: Time, velocity_mps: Vector3<f64>) -> Self {
        Self {
            time,
            velocity_mps,
            force_mps: Vector3::zeros(),
            attitude_s: Matrix3::zeros(),
            turn_rad: 0.0,
            control_tilt_rad: Vector3::zeros(),
            control_velocity_mps: Vector3::zeros(),
        }
    }

    /// Linear between two moments: `part` 0 gives `self`, 1 gives `later`.
    fn towards(&self, later: &Self, part: f64, time: Time) -> Self {
        Self {
            time,
            velocity_mps: self.velocity_mps + part * (later.velocity_mps - self.velocity_mps),
            force_mps: self.force_mps + part * (later.force_mps - self.force_mps),
            attitude_s: self.attitude_s + part * (later.attitude_s - self.attitude_s),
            turn_rad: self.turn_rad + part * (later.turn_rad - self.turn_rad),
            control_tilt_rad: self.control_tilt_rad
                + part * (later.control_tilt_rad - self.control_tilt_rad),
            control_velocity_mps: self.control_velocity_mps
                + part * (later.control_velocity_mps - self.control_velocity_mps),
        }
    }
}

/// What happened between two moments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Duration, s.
    pub seconds: f64,
    /// Integral of specific force, ENU, m/s.
    pub force_mps: Vector3<f64>,
    /// Integral of `C_B^L`, s.
    pub attitude_s: Matrix3<f64>,
    /// Angle sensed about the body's up axis, rad.
    pub turn_rad: f64,
    /// `Phi` that controls and compensations have put into the platform, rad.
    pub control_tilt_rad: Vector3<f64>,
    /// Velocity error that they have caused, with no tilt but that of this span, m/s.
    pub control_velocity_mps: Vector3<f64>,
}

impl Span {
    /// From one moment to a later one.
    pub fn between(earlier: &Moment, later: &Moment) -> Self {
        let force_mps = later.force_mps - earlier.force_mps;
        Self {
            seconds: later.time.seconds_since(earlier.time),
            force_mps,
            attitude_s: later.attitude_s - earlier.attitude_s,
            turn_rad: later.turn_rad - earlier.turn_rad,
            control_tilt_rad: later.control_tilt_rad - earlier.control_tilt_rad,
            control_velocity_mps: later.control_velocity_mps
                - earlier.control_velocity_mps
                - force_mps.cross(&earlier.control_tilt_rad),
        }
    }
}

/// A moment between two of the ring, and how the INS was changing there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Past {
    /// The moment itself.
    pub moment: Moment,
    /// Acceleration of the vehicle as the accelerometers feel it, ENU, m/s^2.
    pub accel_mps2: Vector3<f64>,
    /// Rate of change of `C_B^L`, 1/s.
    pub attitude_rate: Matrix3<f64>,
}

/// Why a moment cannot be given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Missing {
    /// It lies before the ring.
    TooOld,
    /// The ring has not reached it.
    Future,
}

/// Ring of past moments.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct History {
    moments: Ring<Moment, CAPACITY>,
}

impl History {
    /// Whether enough time has passed since the newest moment for the next.
    pub fn wants(&self, time: Time) -> bool {
        self.moments
            .newest()
            .is_none_or(|newest| time.seconds_since(newest.time) >= SPACING_S)
    }

    /// Adds the newest moment, dropping the oldest if full.
    pub fn push(&mut self, moment: Moment) {
        self.moments.push_over(moment);
    }

    /// The oldest moment held.
    pub fn oldest(&self) -> Option<&Moment> {
        self.moments.oldest()
    }

    /// The INS at `time`, which needs a moment of the ring after the interval that holds it.
    ///
    /// # Errors
    /// [`Missing`] if it does not lie in the ring.
    pub fn at(&self, time: Time) -> Result<Past, Missing> {
        let mut newer = self.moments.iter().rev();
        let (Some(mut last), Some(mut later)) = (newer.next(), newer.next()) else {
            return Err(Missing::Future);
        };
        if time > later.time {
            return Err(Missing::Future);
        }
        for earlier in newer {
            if earlier.time <= time {
                return Ok(past(earlier, later, last, time));
            }
            (last, later) = (later, earlier);
        }
        Err(Missing::TooOld)
    }
}

/// Interpolates in [`earlier`, `later`]; `last` follows and gives the second differences.
fn past(earlier: &Moment, later: &Moment, last: &Moment, time: Time) -> Past {
    let span = later.time.seconds_since(earlier.time);
    let next_span = last.time.seconds_since(later.time);
    let part = time.seconds_since(earlier.time) / span;
    // From specific force: the velocity itself also follows the noise of GNSS, by its controls.
    let gravity = Vector3::new(0.0, 0.0, GRAVITY_EQUATOR_MPS2);
    let slope = (later.force_mps - earlier.force_mps) / span - gravity;
    let next_slope = (last.force_mps - later.force_mps) / next_span - gravity;
    let attitude = (later.attitude_s - earlier.attitude_s) / span;
    let next_attitude = (last.attitude_s - later.attitude_s) / next_span;
    let curvature = (next_slope - slope) / (0.5 * (span + next_span));
    let mut moment = earlier.towards(later, part, time);
    // The parabola through three moments.
    moment.velocity_mps -= 0.5 * part * (1.0 - part) * span * span * curvature;
    Past {
        moment,
        accel_mps2: slope + (part - 0.5) * span * curvature,
        attitude_rate: (next_attitude - attitude) / (0.5 * (span + next_span)),
    }
}
