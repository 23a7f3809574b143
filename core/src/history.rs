//! The recent past of the INS, for data that arrives late: a fixed-size ring.

use nalgebra::{Matrix3, Vector3};

use crate::earth::GRAVITY_EQUATOR_MPS2;
use crate::ring::Ring;
use crate::time::Time;

/// Least time between two moments in the ring, s.
const SPACING_S: f64 = 0.115;
/// Moments held: of the last 0.46 s or more any moment can be given.
const CAPACITY: usize = 6;

/// What the INS has gone through up to one moment: totals since the start, so that the difference
/// of any two moments is the exact integral between them.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Moment {
    /// When.
    pub time: Time,
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
    pub fn start(time: Time) -> Self {
        Self {
            time,
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
    /// Velocity, ENU, m/s.
    pub velocity_mps: Vector3<f64>,
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

/// A moment of the ring and the velocity then, ENU, m/s.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Recorded {
    moment: Moment,
    velocity_mps: Vector3<f64>,
}

/// Ring of past moments.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct History {
    moments: Ring<Recorded, CAPACITY>,
}

impl History {
    /// Empties the ring.
    pub fn forget(&mut self) {
        while self.moments.pop().is_some() {}
    }

    /// Whether enough time has passed since the newest moment for the next.
    pub fn wants(&self, time: Time) -> bool {
        self.moments
            .newest()
            .is_none_or(|newest| time.seconds_since(newest.moment.time) >= SPACING_S)
    }

    /// The oldest moment and the velocity then, ENU, m/s.
    pub fn oldest(&self) -> Option<(Moment, Vector3<f64>)> {
        let oldest = self.moments.oldest()?;
        Some((oldest.moment, oldest.velocity_mps))
    }

    /// Adds the newest moment, dropping the oldest if full.
    pub fn push(&mut self, moment: Moment, velocity_mps: Vector3<f64>) {
        self.moments.push_over(Recorded {
            moment,
            velocity_mps,
        });
    }

    /// The INS at `time`, which must lie after the second moment of the ring, and which is best
    /// known once a moment follows those around it: `wait` asks for that.
    ///
    /// # Errors
    /// [`Missing`] if it does not.
    pub fn at(&self, time: Time, wait: bool) -> Result<Past, Missing> {
        let mut older = self.moments.iter().rev();
        let (Some(mut end), Some(mut start)) = (older.next(), older.next()) else {
            return Err(Missing::Future);
        };
        if time > end.moment.time || (wait && time > start.moment.time) {
            return Err(Missing::Future);
        }
        let mut after = None;
        for before in older {
            if start.moment.time <= time {
                let around = Around {
                    before,
                    start,
                    end,
                    after,
                };
                return Ok(around.past(time));
            }
            (after, end, start) = (Some(end), start, before);
        }
        Err(Missing::TooOld)
    }
}

/// The moments around an interval, from `start` to `end`.
struct Around<'a> {
    before: &'a Recorded,
    start: &'a Recorded,
    end: &'a Recorded,
    after: Option<&'a Recorded>,
}

impl Around<'_> {
    /// Interpolates by the parabola that bends as the INS does in the middle of the interval.
    fn past(&self, time: Time) -> Past {
        let Self { start, end, .. } = self;
        let here = Means::between(start, end);
        let bend = self.bend(&here);
        let part = time.seconds_since(start.moment.time) / here.seconds;
        // From specific force: the velocity itself also follows the noise of GNSS, by its controls.
        let chord = start.velocity_mps + part * (end.velocity_mps - start.velocity_mps);
        let sag = 0.5 * part * (1.0 - part) * here.seconds * here.seconds;
        let gravity = Vector3::new(0.0, 0.0, GRAVITY_EQUATOR_MPS2);
        let slope = here.force_mps2 - gravity;
        Past {
            moment: start.moment.towards(&end.moment, part, time),
            velocity_mps: chord - sag * bend.force_mps2,
            accel_mps2: slope + (part - 0.5) * here.seconds * bend.force_mps2,
            attitude_rate: bend.attitude,
        }
    }

    /// How fast the means change in the middle of the interval. What changes at one end alone
    /// lets the interpolation lag behind: by 1.4 ms in the gusts of a light aircraft.
    fn bend(&self, here: &Means) -> Means {
        let at_start = here.slope_from(&Means::between(self.before, self.start));
        let Some(after) = self.after else {
            return at_start;
        };
        let at_end = Means::between(self.end, after).slope_from(here);
        Means {
            seconds: here.seconds,
            force_mps2: 0.5 * (at_start.force_mps2 + at_end.force_mps2),
            attitude: 0.5 * (at_start.attitude + at_end.attitude),
        }
    }
}

/// Means between two moments of the ring, or how fast they change.
struct Means {
    seconds: f64,
    force_mps2: Vector3<f64>,
    attitude: Matrix3<f64>,
}

impl Means {
    fn between(start: &Recorded, end: &Recorded) -> Self {
        let (start, end) = (&start.moment, &end.moment);
        let seconds = end.time.seconds_since(start.time);
        Self {
            seconds,
            force_mps2: (end.force_mps - start.force_mps) / seconds,
            attitude: (end.attitude_s - start.attitude_s) / seconds,
        }
    }

    /// Change per second from an earlier mean to this.
    fn slope_from(&self, earlier: &Self) -> Self {
        let seconds = 0.5 * (earlier.seconds + self.seconds);
        Self {
            seconds,
            force_mps2: (self.force_mps2 - earlier.force_mps2) / seconds,
            attitude: (self.attitude - earlier.attitude) / seconds,
        }
    }
}
