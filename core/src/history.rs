//! Recent states of the INS, for measurements that arrive late: a fixed-size ring.

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::earth::GRAVITY_EQUATOR_MPS2;
use crate::math::{self, singles};
use crate::ring::Ring;
use crate::time::Time;

/// Sums of the INS between two times, ENU. Successive spans combine exactly by [`Span::extend`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Span<T: nalgebra::Scalar = f64> {
    /// Duration, s.
    pub seconds: T,
    /// Integral of specific force, m/s.
    pub force_mps: Vector3<T>,
    /// Integral of that integral, m.
    pub force_position_m: Vector3<T>,
    /// Integral of `C_B^L`, s.
    pub attitude_s: Matrix3<T>,
    /// Angle sensed by the gyros, body, rad.
    pub angle_rad: Vector3<T>,
    /// The part of it about the local vertical, rad.
    pub turn_rad: T,
    /// `Phi` by controls and compensations, rad.
    pub control_tilt_rad: Vector3<T>,
    /// Velocity error by them, with no tilt but that of this span, m/s.
    pub control_velocity_mps: Vector3<T>,
    /// Position error by them, likewise, m.
    pub control_position_m: Vector3<T>,
    /// Displacement of the INS, controls included, m.
    pub way_m: Vector3<T>,
}

impl<T: nalgebra::RealField + Copy> Span<T> {
    /// This span and the one after it.
    #[must_use]
    pub fn then(mut self, next: &Self) -> Self {
        self.extend(next);
        self
    }

    /// Appends the next span.
    pub fn extend(&mut self, next: &Self) {
        let tilt = &self.control_tilt_rad;
        self.control_position_m += self.control_velocity_mps * next.seconds
            + next.force_position_m.cross(tilt)
            + next.control_position_m;
        self.control_velocity_mps += next.force_mps.cross(tilt) + next.control_velocity_mps;
        self.control_tilt_rad += next.control_tilt_rad;
        self.force_position_m += self.force_mps * next.seconds + next.force_position_m;
        self.force_mps += next.force_mps;
        self.attitude_s += next.attitude_s;
        self.angle_rad += next.angle_rad;
        self.turn_rad += next.turn_rad;
        self.way_m += next.way_m;
        self.seconds += next.seconds;
    }

    /// First or last part of a span. Controls and force are constant within it, and the rest of its sums
    /// linear: parts combine to the whole.
    #[must_use]
    fn part(&self, fraction: T) -> Self {
        let half: T = nalgebra::convert(0.5);
        let third: T = nalgebra::convert(1.0 / 3.0);
        let (seconds, square) = (self.seconds, fraction * fraction);
        let tilt = &self.control_tilt_rad;
        let even_moved = self.force_mps * (seconds * half);
        let other_moved = self.force_position_m - even_moved;
        let bent_velocity = self.force_mps.cross(tilt) * half;
        let even_velocity = self.control_velocity_mps - bent_velocity;
        let bent_twice = bent_velocity * (seconds * third);
        let bent_once = (even_velocity * seconds + other_moved.cross(tilt)) * half;
        let even_position = self.control_position_m - bent_once - bent_twice;
        Self {
            seconds: seconds * fraction,
            force_mps: self.force_mps * fraction,
            force_position_m: other_moved * fraction + even_moved * square,
            attitude_s: self.attitude_s * fraction,
            angle_rad: self.angle_rad * fraction,
            turn_rad: self.turn_rad * fraction,
            control_tilt_rad: tilt * fraction,
            control_velocity_mps: even_velocity * fraction + bent_velocity * square,
            control_position_m: even_position * fraction
                + bent_once * square
                + bent_twice * (square * fraction),
            way_m: self.way_m * fraction,
        }
    }

    /// In another precision: a span in the ring is short.
    fn map<U: nalgebra::Scalar>(&self, to: impl Fn(T) -> U + Copy) -> Span<U> {
        Span {
            seconds: to(self.seconds),
            force_mps: self.force_mps.map(to),
            force_position_m: self.force_position_m.map(to),
            attitude_s: self.attitude_s.map(to),
            angle_rad: self.angle_rad.map(to),
            turn_rad: to(self.turn_rad),
            control_tilt_rad: self.control_tilt_rad.map(to),
            control_velocity_mps: self.control_velocity_mps.map(to),
            control_position_m: self.control_position_m.map(to),
            way_m: self.way_m.map(to),
        }
    }
}

impl Span<f32> {
    /// Mean velocity of an antenna about the sensors, per unit of its arm, 1/s.
    fn swing(&self) -> Matrix3<f32> {
        self.attitude_s * self.angle_rad.cross_matrix() / (self.seconds * self.seconds)
    }

    /// Rate of change of the mean attitude from an earlier span, 1/s.
    fn turned_from(&self, earlier: &Self) -> Matrix3<f32> {
        let change = self.attitude_s / self.seconds - earlier.attitude_s / earlier.seconds;
        change / (0.5 * (self.seconds + earlier.seconds))
    }
}

/// Least spacing of the ring, s: short against manoeuvres, and no longer than a receiver's smoothing.
/// Incommensurate with usual fix intervals: at a constant phase to the entries, aliased vibration would
/// look like a latency.
pub const SPACING_S: f64 = 0.105;

/// Smoothing from which on the second derivative is no longer enough, s: of a swing of 1 Hz it would remove
/// a sixth too much, and of one twice as fast half.
pub const LONG_SMOOTHING_S: f64 = 0.1;

/// Squared phase of a swing over the spacing up to which its third derivative is resolved: 3 Hz.
const FASTEST_PHASE: f64 = 3.5;

/// INS at a past time, and its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PastState {
    /// Its time.
    pub time: Time,
    /// Velocity, ENU, m/s.
    pub velocity_mps: Vector3<f64>,
    /// Acceleration by the accelerometers, on a platform that may be tilted, ENU, m/s^2.
    pub accel_mps2: Vector3<f64>,
    /// Its derivative, m/s^3; for a smoothing receiver see [`History::smooth`].
    pub jerk_mps3: Vector3<f64>,
    /// And its second derivative, m/s^4.
    pub snap_mps4: Vector3<f64>,
    /// Whether the jerk is that for a smoothing receiver.
    pub smoothed: bool,
    /// Variance of a level velocity by jolts and vibration between two entries, which the interpolation
    /// does not resolve, (m/s)^2.
    pub unresolved_velocity: f64,
    /// The same of the angular rate, (rad/s)^2.
    pub unresolved_rate: f64,
    /// `C_B^L`.
    pub attitude: Matrix3<f64>,
    /// Its derivatives, 1/s, 1/s^2, and 1/s^3 like the jerk.
    pub attitude_rate: Matrix3<f64>,
    pub attitude_accel: Matrix3<f64>,
    pub attitude_jerk: Matrix3<f32>,
    /// Displacement of the INS from this time to the newest entry, ENU, m.
    pub way_since_m: Vector3<f64>,
}

impl PastState {
    /// Interpolates to another state, but for the displacement since.
    pub fn blend(&mut self, next: &Self, part: f64) {
        let seconds = next.time.seconds_since(self.time);
        self.time = self.time.plus_seconds(seconds * part);
        self.velocity_mps += (next.velocity_mps - self.velocity_mps) * part;
        self.accel_mps2 += (next.accel_mps2 - self.accel_mps2) * part;
        self.jerk_mps3 += (next.jerk_mps3 - self.jerk_mps3) * part;
        self.snap_mps4 += (next.snap_mps4 - self.snap_mps4) * part;
        self.unresolved_velocity += (next.unresolved_velocity - self.unresolved_velocity) * part;
        self.unresolved_rate += (next.unresolved_rate - self.unresolved_rate) * part;
        self.attitude += (next.attitude - self.attitude) * part;
        self.attitude_rate += (next.attitude_rate - self.attitude_rate) * part;
        self.attitude_accel += (next.attitude_accel - self.attitude_accel) * part;
        self.attitude_jerk += (next.attitude_jerk - self.attitude_jerk) * math::single(part);
    }
}

/// Why there is no state for a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Missing {
    /// It is before the ring.
    TooOld,
    /// It is after the ring.
    Future,
}

/// Entry of the ring.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct RingEntry {
    time: Time,
    /// Mean velocity since the entry before.
    velocity_mps: Vector3<f32>,
    /// Since the entry before.
    span: Span<f32>,
    /// See [`Vibration`]: of velocity and angular rate.
    vibration: f32,
    rate_vibration: f32,
}

/// Deviation of the level velocity from its chord between two entries, and of the angular rate from its
/// mean.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Vibration {
    seconds: f32,
    gained_mps: Vector2<f32>,
    /// Sums of its square, of its product with time, and of the square of time.
    square: f32,
    moment: Vector2<f32>,
    seconds2: f32,
    /// Integral of the squared angular rate.
    rate_square: f32,
}

impl Vibration {
    /// Adds a velocity gained over an interval, m/s, and the angle, rad.
    pub fn add(&mut self, gained_mps: &Vector3<f64>, angle_rad: &Vector3<f64>, seconds: f64) {
        let dt = math::single(seconds);
        self.rate_square += math::single(angle_rad.norm_squared() / seconds);
        self.gained_mps += singles(gained_mps).xy();
        self.seconds += dt;
        self.square += self.gained_mps.norm_squared() * dt;
        self.moment += self.gained_mps * (self.seconds * dt);
        self.seconds2 += self.seconds * self.seconds * dt;
    }

    /// Mean square of a component about the chord, (m/s)^2.
    fn variance(&self) -> f32 {
        if self.seconds <= 0.0 {
            return 0.0;
        }
        let slope = self.gained_mps / self.seconds;
        // All are sums over the same samples, so that a steady acceleration is no deviation.
        let chord = slope.norm_squared() * self.seconds2;
        0.5 * (self.square - 2.0 * slope.dot(&self.moment) + chord) / self.seconds
    }

    /// Mean square of the rate about its mean, (rad/s)^2.
    fn rate_variance(&self, span: &Span) -> f32 {
        let mean = span.angle_rad.norm_squared() / (span.seconds * span.seconds);
        self.rate_square / math::single(span.seconds) - math::single(mean)
    }
}

/// Ring of past states.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct History<const N: usize> {
    entries: Ring<RingEntry, N>,
}

impl<const N: usize> History<N> {
    /// Whether the next entry is due, with samples at this interval: rare ones are not skipped.
    pub fn is_due(&self, time: Time, interval_s: f64) -> bool {
        self.entries.newest().is_none_or(|newest| {
            let since_s = time.seconds_since(newest.time);
            since_s >= SPACING_S || since_s + interval_s > 1.5 * SPACING_S
        })
    }

    /// End of the span that the next entry drops from a full ring.
    pub fn next_dropped(&self) -> Option<Time> {
        let full = self.entries.len() == N;
        self.entries.oldest().filter(|_| full).map(|old| old.time)
    }

    /// Appends an entry, with the span since the last and its mean velocity; a full ring drops the oldest.
    pub fn push(
        &mut self,
        time: Time,
        velocity_mps: &Vector3<f64>,
        span: &Span,
        vibration: &Vibration,
    ) {
        self.entries.push_over(RingEntry {
            time,
            vibration: vibration.variance(),
            rate_vibration: vibration.rate_variance(span),
            velocity_mps: singles(velocity_mps),
            span: span.map(math::single),
        });
    }

    /// Mean change of the specific force within a fifth of a second, m/s^2.
    pub fn shaking_mps2(&self) -> f64 {
        let (mut sum_mps, mut count) = (0.0, 0.0);
        let mut before: Option<&RingEntry> = None;
        for entry in self.entries.iter().step_by(2) {
            if let Some(before) = before.replace(entry) {
                sum_mps += (entry.span.force_mps - before.span.force_mps).amax();
                count += 1.0;
            }
        }
        f64::from(sum_mps) / (SPACING_S * math::max(count, 1.0))
    }

    /// Sums from a time on, and until when: at most `longest_s`, or one entry.
    #[inline(never)]
    pub fn next_span(&self, from: Time, to: Time, longest_s: f64) -> Option<(Span, Time)> {
        let mut joined = Span::default();
        for entry in self.entries.since_first(|entry| entry.time > from) {
            let seconds = f64::from(entry.span.seconds);
            let end_s = entry.time.seconds_since(from);
            let start_s = end_s - seconds;
            let last_s = math::min(end_s, to.seconds_since(from));
            let inside_s = last_s - math::max(start_s, 0.0);
            if inside_s <= 0.0 {
                break;
            }
            let mut part = entry.span.map(f64::from);
            if inside_s < seconds {
                part = part.part(inside_s / seconds);
            }
            if joined.seconds <= 0.0 {
                joined = part;
            } else if joined.seconds + part.seconds > longest_s {
                return Some((joined, from.plus_seconds(joined.seconds)));
            } else {
                joined.extend(&part);
            }
        }
        (joined.seconds > 0.0).then_some((joined, to))
    }

    /// Whether a time is not after the newest entry.
    pub fn covers(&self, time: Time) -> bool {
        (self.entries.newest()).is_some_and(|newest| time <= newest.time)
    }

    /// The INS at `time`, which must be after the first entry. With `wait` an entry must follow those
    /// around it, for a better interpolation.
    ///
    /// # Errors
    /// [`Missing`] if it does not.
    #[inline(never)]
    pub fn at(&self, time: Time, wait: bool) -> Result<PastState, Missing> {
        let mut older = self.entries.iter().rev();
        let Some(mut end) = older.next().filter(|newest| time <= newest.time) else {
            return Err(Missing::Future);
        };
        let mut after = None;
        let mut way_since_m = Vector3::zeros();
        for start in older {
            if wait && after.is_none() && time > start.time {
                return Err(Missing::Future);
            }
            if start.time <= time {
                let around = Stencil { start, end, after };
                return Ok(around.past(time, &way_since_m));
            }
            way_since_m += end.span.way_m.map(f64::from);
            (after, end) = (Some(end), start);
        }
        Err(Missing::TooOld)
    }

    /// Replaces the jerk, and that of an arm, by the one that a receiver with this time constant shows,
    /// where a fast turn needs more than the second derivative: its mean over delays of variance `s`, as
    /// `s / 2` times a jerk. The receiver is a first-order low pass, advanced by its lag in a steady
    /// acceleration.
    #[inline(never)]
    pub fn smooth(&self, past: &mut PastState, memory_s: f64) {
        if memory_s < LONG_SMOOTHING_S {
            return;
        }
        // Weights of each velocity gain, smoothed less merely delayed; outside the ring all is constant.
        let mut beyond_mps = Vector3::zeros();
        let mut swung_beyond = Matrix3::zeros();
        let (mut turns, mut swing) = (None, Matrix3::zeros());
        let (mut end_s, mut missed) = (memory_s, 1.0);
        let mut older = self.entries.iter().rev().peekable();
        while let Some(entry) = older.next() {
            let span = &entry.span;
            let seconds = f64::from(span.seconds);
            let start_s = entry.time.seconds_since(past.time) - seconds;
            // Rate of the attitude at the ends of a span: velocity of an arm of unit length.
            let at_start = older.peek().map(|older| span.turned_from(&older.span));
            let at_end = core::mem::replace(&mut turns, at_start);
            if start_s >= memory_s {
                continue;
            }
            let missed_before = match at_start {
                Some(_) => missed * math::decayed((end_s - start_s) / memory_s),
                None => 0.0,
            };
            let late_s = math::max(end_s, 0.0) - math::max(start_s, 0.0);
            let beyond = (late_s - memory_s * (missed - missed_before)) / seconds;
            beyond_mps += beyond * span.force_mps.map(f64::from);
            if let (Some(at_start), Some(at_end)) = (at_start, at_end) {
                swing = at_end - at_start;
            }
            swung_beyond += swing * math::single(beyond);
            (end_s, missed) = (start_s, missed_before);
        }
        let per_square = 2.0 / (memory_s * memory_s);
        past.jerk_mps3 = beyond_mps * per_square;
        past.attitude_jerk = swung_beyond * math::single(per_square);
        past.smoothed = true;
    }
}

/// Entries around an interval from `start` to `end`.
struct Stencil<'a> {
    start: &'a RingEntry,
    end: &'a RingEntry,
    after: Option<&'a RingEntry>,
}

impl Stencil<'_> {
    /// Interpolation by parabolas, of velocity through the mean velocities of the intervals: velocities at
    /// single times alias faster swings, at phases that for regular fixes look like an acceleration.
    fn past(&self, time: Time, way_after_m: &Vector3<f64>) -> PastState {
        let Self { start, end, after } = self;
        let here = Means::over(end);
        let slopes = Slopes {
            at_start: here.slope_from(&Means::over(start)),
            at_end: after.map(|after| Means::over(after).slope_from(&here)),
        };
        let bend = slopes.at_middle();
        let part = time.seconds_since(start.time) / here.seconds;
        let off_s = (part - 0.5) * here.seconds;
        let [middle_mps, accel_mps2, jerk_mps3] = self.parabola(&here, &bend.force_mps2);
        // A cubic with zero mean over the three intervals leaves the parabola's means.
        let snap_mps4 = slopes.snap(here.seconds, &accel_mps2);
        let flat = 1.25 * here.seconds * here.seconds;
        let velocity = |off_s: f64| {
            middle_mps
                + off_s * (accel_mps2 + 0.5 * off_s * jerk_mps3)
                + off_s * (off_s * off_s - flat) / 6.0 * snap_mps4
        };
        let (first, velocity_mps) = (velocity(-0.5 * here.seconds), velocity(off_s));
        // The mean velocity over the rest of the interval is that of its two ends.
        let left_s = (1.0 - part) * here.seconds;
        let way = end.span.way_m.map(f64::from);
        let left = (1.0 - part) * way + 0.5 * left_s * (velocity_mps - first);
        // Mean square of a parabola about its chord.
        let height = here.seconds * here.seconds * bend.force_mps2.xy();
        let explained = height.norm_squared() / 240.0;
        // And of a ramp about its mean.
        let turning = (here.seconds * bend.rate_radps).norm_squared() / 12.0;
        let attitude = here.attitude + off_s * bend.attitude;
        let rate_radps = here.rate_radps + off_s * bend.rate_radps;
        PastState {
            time,
            velocity_mps,
            accel_mps2: accel_mps2
                + off_s * jerk_mps3
                + (0.5 * off_s * off_s - flat / 6.0) * snap_mps4,
            jerk_mps3: jerk_mps3 + off_s * snap_mps4,
            snap_mps4,
            smoothed: false,
            unresolved_velocity: math::max(f64::from(end.vibration) - explained, 0.0),
            unresolved_rate: math::max(f64::from(end.rate_vibration) - turning, 0.0),
            attitude,
            attitude_rate: attitude * rate_radps.cross_matrix(),
            attitude_accel: attitude * turn_accel(&rate_radps, &bend.rate_radps),
            attitude_jerk: self.swing_curvature(),
            way_since_m: left + way_after_m,
        }
    }

    /// Second difference of the antenna's mean velocity, per unit of its arm.
    fn swing_curvature(&self) -> Matrix3<f32> {
        let Some(after) = self.after else {
            return Matrix3::zeros();
        };
        let here = &self.end.span;
        let bent = self.start.span.swing() + after.span.swing() - here.swing() * 2.0;
        bent / (here.seconds * here.seconds)
    }

    /// Velocity, acceleration and jerk at the middle, from the means of three intervals; with no later
    /// entry of two, and the change of specific force. Differences of means come from specific force: the
    /// velocity also follows GNSS noise, by the controls.
    fn parabola(&self, here: &Means, force_slope: &Vector3<f64>) -> [Vector3<f64>; 3] {
        let square = here.seconds * here.seconds;
        // Offset of another interval's middle, difference of its mean, and the coefficient of the jerk in
        // that.
        let beside = |other: &RingEntry, gained_mps: &Vector3<f64>, side: f64| {
            let seconds = f64::from(other.span.seconds);
            let off_s = side * 0.5 * (here.seconds + seconds);
            let bent = 0.5 * off_s * off_s + (seconds * seconds - square) / 24.0;
            let fallen = Vector3::new(0.0, 0.0, GRAVITY_EQUATOR_MPS2 * off_s);
            (off_s, side * gained_mps - fallen, bent)
        };
        let gained_before = gained_between(&self.start.span, &self.end.span);
        let (before_s, before, before_bent) = beside(self.start, &gained_before, -1.0);
        let jerk_mps3 = match self.after {
            Some(after) => {
                let gained_after = gained_between(&self.end.span, &after.span);
                let (after_s, after, after_bent) = beside(after, &gained_after, 1.0);
                (before_s * after - after_s * before)
                    / (before_s * after_bent - after_s * before_bent)
            }
            None => *force_slope,
        };
        let middle_mps = self.end.velocity_mps.map(f64::from) - square / 24.0 * jerk_mps3;
        let accel_mps2 = (before - before_bent * jerk_mps3) / before_s;
        [middle_mps, accel_mps2, jerk_mps3]
    }
}

/// Slopes of the means at the start of an interval, and at its end if an entry follows.
struct Slopes {
    at_start: Means,
    at_end: Option<Means>,
}

impl Slopes {
    /// Derivative of the jerk over an interval, m/s^4, with a later entry; attenuated for swings too fast
    /// for the ring, by its ratio to the acceleration.
    fn snap(&self, interval_s: f64, accel_mps2: &Vector3<f64>) -> Vector3<f64> {
        let Self { at_start, at_end } = self;
        let Some(at_end) = at_end else {
            return Vector3::zeros();
        };
        let snap =
            (at_end.force_mps2 - at_start.force_mps2) / (0.5 * (at_start.seconds + at_end.seconds));
        // Squared phase of a swing over the spacing.
        let phase = snap.norm() * interval_s * interval_s / (accel_mps2.norm() + 1e-6);
        let ratio = phase * phase / (FASTEST_PHASE * FASTEST_PHASE);
        snap / (1.0 + ratio * ratio)
    }

    /// At the middle. With the slope of one end alone the interpolation lags: by 1.4 ms in the gusts of a
    /// light aircraft.
    fn at_middle(&self) -> Means {
        let Self { at_start, at_end } = self;
        let Some(at_end) = at_end else {
            return *at_start;
        };
        Means {
            seconds: at_start.seconds,
            force_mps2: 0.5 * (at_start.force_mps2 + at_end.force_mps2),
            rate_radps: 0.5 * (at_start.rate_radps + at_end.rate_radps),
            attitude: 0.5 * (at_start.attitude + at_end.attitude),
        }
    }
}

/// `w w + dw/dt`, both as cross products: the factor on the attitude in its second derivative.
fn turn_accel(rate_radps: &Vector3<f64>, growth_radps2: &Vector3<f64>) -> Matrix3<f64> {
    let (x, y, z) = (rate_radps.x, rate_radps.y, rate_radps.z);
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let (xy, xz, yz) = (x * y, x * z, y * z);
    let growth = growth_radps2;
    Matrix3::new(
        -zz - yy,
        xy - growth.z,
        xz + growth.y,
        xy + growth.z,
        -zz - xx,
        yz - growth.x,
        xz - growth.y,
        yz + growth.x,
        -yy - xx,
    )
}

/// Difference of the mean velocities of two spans by specific force, m/s.
fn gained_between(first: &Span<f32>, second: &Span<f32>) -> Vector3<f64> {
    let gained = first.force_mps - first.force_position_m / first.seconds;
    (gained + second.force_position_m / second.seconds).map(f64::from)
}

/// Means between two entries, or their slopes.
#[derive(Clone, Copy)]
struct Means {
    seconds: f64,
    force_mps2: Vector3<f64>,
    rate_radps: Vector3<f64>,
    attitude: Matrix3<f64>,
}

impl Means {
    /// Over the span that ends at an entry.
    fn over(entry: &RingEntry) -> Self {
        let span = &entry.span;
        let seconds = f64::from(span.seconds);
        Self {
            seconds,
            force_mps2: span.force_mps.map(f64::from) / seconds,
            rate_radps: span.angle_rad.map(f64::from) / seconds,
            attitude: span.attitude_s.map(f64::from) / seconds,
        }
    }

    /// Slope from an earlier mean.
    fn slope_from(&self, earlier: &Self) -> Self {
        let seconds = 0.5 * (earlier.seconds + self.seconds);
        Self {
            seconds,
            force_mps2: (self.force_mps2 - earlier.force_mps2) / seconds,
            rate_radps: (self.rate_radps - earlier.rate_radps) / seconds,
            attitude: (self.attitude - earlier.attitude) / seconds,
        }
    }
}

#[cfg(test)]
#[path = "../tests/unit/history.rs"]
mod tests;
