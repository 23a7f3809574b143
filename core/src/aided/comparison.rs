//! INS minus GNSS: a fix beside the INS of its own time, or the mean of several that are close to each
//! other.

use nalgebra::Vector3;

use crate::channel::Measured;
use crate::history::PastState;
use crate::math;
use crate::measurement::{Difference, Kind};
use crate::samples::GnssFix;
use crate::time::Time;

/// Fixes closer than this to the last comparison wait for the next, and are compared as one, s: the errors
/// of an INS change little meanwhile, and those of a receiver hardly more, so that the mean loses nothing.
/// No multiple of a usual interval: times move by microseconds with the latency estimate.
pub const AVERAGING_S: f64 = 0.29;

/// Next step of a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Step {
    /// More fixes may be averaged.
    Gather,
    /// The estimators are propagated to its time.
    Advance,
    /// They are updated with one kind.
    Take(Kind),
    /// The loops get it.
    Damp,
}

/// Status of one kind of measurement in a comparison.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Component {
    /// Whether the fixes have it.
    pub has: bool,
    /// Stated variance in one fix.
    pub stated: Option<f64>,
    /// Whether the estimators have accepted it.
    pub used: bool,
}

impl Component {
    /// Of a fix, with its stated sigma; not positive, as -1 of many receivers, it is none.
    pub fn of(has: bool, sigma: Option<f64>) -> Self {
        Self {
            has,
            stated: sigma
                .map(|sigma| sigma * math::abs(sigma))
                .filter(|variance| *variance > 0.0),
            used: false,
        }
    }

    /// Averages another fix with `count` of them, at this weight.
    fn average(&mut self, next: &Self, count: f64, part: f64) {
        self.has &= next.has;
        let left = 1.0 - part;
        self.stated = match (self.stated, next.stated) {
            (Some(own), Some(next)) => {
                Some((count + 1.0) * (left * left * own / count + part * part * next))
            }
            _ => None,
        };
    }

    /// Weight of another fix in the mean with `count` of them.
    fn weight_of(&self, next: &Self, count: f64) -> f64 {
        match (self.stated, next.stated) {
            (Some(own), Some(next)) => own / (count * next + own),
            _ => 1.0 / (count + 1.0),
        }
    }
}

/// A fix beside the INS of its own time, or the mean of several.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Comparison {
    /// Next step.
    pub step: Step,
    /// INS of that time.
    pub past: PastState,
    /// Number of fixes; zero: of the barometer alone.
    pub fixes: u8,
    /// Stamp of the newest fix, its time, and that of the last fix of the comparison before.
    pub stamp: Time,
    pub newest: Time,
    pub before: Time,
    /// Arrival of the newest fix.
    pub arrived: Time,
    /// Latency already compensated, s.
    pub latency_applied_s: f64,
    /// INS minus GNSS, ENU, m/s and m.
    pub velocity_mps: Vector3<f64>,
    pub position_m: Vector3<f64>,
    /// Status of each kind.
    pub velocity: Component,
    pub climb: Component,
    pub position: Component,
    pub height: Component,
    /// Additional variance of the climb, (m/s)^2: that for its unknown sign, or of an assumed one.
    pub climb_variance: f64,
    /// The climb is not of a fix but assumed.
    pub climb_assumed: bool,
    /// Time since the last position, and since the last height, s.
    pub position_s: f64,
    pub height_s: f64,
}

impl Comparison {
    /// Vertical velocity that no fix measures: INS minus the assumed one, and its variance. One of a fix
    /// with the wrong sign has been left out.
    pub fn assume_climb(&mut self, difference_mps: f64, variance: f64) {
        self.velocity_mps.z = difference_mps;
        self.climb = Component::of(true, None);
        self.climb_variance = variance;
        self.climb_assumed = true;
    }

    /// Whether anything of the fixes was used; an assumed climb is not of them.
    pub fn is_used(&self) -> bool {
        let climb = self.climb.used && !self.climb_assumed;
        self.velocity.used || climb || self.position.used || self.height.used
    }

    /// Whether a fix of this time can be averaged with these.
    pub fn accepts(&self, fix: &GnssFix, moment: Time) -> bool {
        self.step == Step::Gather
            && moment.seconds_since(self.before) < 2.0 * AVERAGING_S
            && self.velocity.has == fix.velocity_en_mps.is_some()
            && self.position.has == fix.position.is_some()
            && self.height.has == fix.height_m.is_some()
    }

    /// Averages another one with these.
    pub fn add(&mut self, next: &Self) {
        let count = f64::from(self.fixes);
        self.fixes += 1;
        let part = if self.velocity.has {
            self.velocity.weight_of(&next.velocity, count)
        } else {
            self.position.weight_of(&next.position, count)
        };
        self.past.blend(&next.past, part);
        self.latency_applied_s += (next.latency_applied_s - self.latency_applied_s) * part;
        self.velocity_mps += (next.velocity_mps - self.velocity_mps) * part;
        self.position_m += (next.position_m - self.position_m) * part;
        self.velocity.average(&next.velocity, count, part);
        self.climb.average(&next.climb, count, part);
        self.position.average(&next.position, count, part);
        self.height.average(&next.height, count, part);
        (self.stamp, self.newest, self.arrived) = (next.stamp, next.newest, next.arrived);
    }

    /// Status of a kind.
    pub fn component(&mut self, kind: Kind) -> &mut Component {
        match kind {
            Kind::Velocity => &mut self.velocity,
            Kind::Climb => &mut self.climb,
            Kind::Position => &mut self.position,
            Kind::Height => &mut self.height,
        }
    }

    /// Time since the comparison before, s.
    pub fn interval_s(&self) -> f64 {
        self.newest.seconds_since(self.before)
    }

    /// Closes it if no other fix can join, or none has come for too long.
    pub fn close(&mut self, now: Time) {
        let late = now.seconds_since(self.arrived) > 2.0 * AVERAGING_S;
        if self.step == Step::Gather && (late || self.interval_s() >= AVERAGING_S) {
            self.step = Step::Advance;
        }
    }

    /// Sets the step after a kind, or the first.
    pub fn next_step(&mut self, after: Option<Kind>) {
        let done = after.map_or(0, |after| 1 + after as usize);
        let mut left = Kind::ALL.into_iter().skip(done);
        let next = left.find(|kind| self.component(*kind).has);
        self.step = next.map_or(Step::Damp, Step::Take);
    }

    /// Input of the estimators for a kind.
    pub fn difference(&mut self, kind: Kind) -> Difference {
        Difference {
            value: match kind.measured() {
                Measured::Velocity => self.velocity_mps,
                Measured::Position => self.position_m,
            },
            fixes: f64::from(self.fixes.max(1)),
            stated_variance: self.component(kind).stated,
            extra_variance: if kind == Kind::Climb {
                self.climb_variance
            } else {
                0.0
            },
            from_receiver: !(kind == Kind::Climb && self.climb_assumed),
            latency_applied_s: self.latency_applied_s,
        }
    }
}
