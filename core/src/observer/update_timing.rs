//! Intervals of the measurement updates.

use crate::innovations::MANOEUVRE_S;
use crate::math;
use crate::time::Time;

/// Measurements no further apart belong to one update, s.
const ONE_MOMENT_S: f64 = 1e-3;

/// Interval of level or vertical updates.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct UpdateTiming {
    last: Time,
    /// Time since the measurement before, of the same update perhaps, and bounded by twice the interval
    /// before.
    pub seconds: f64,
    /// Updates at this interval within an ordinary manoeuvre.
    pub per_manoeuvre: f64,
}

impl UpdateTiming {
    /// Before the first.
    pub fn new(start: Time) -> Self {
        Self {
            last: start,
            seconds: 0.0,
            per_manoeuvre: 1.0,
        }
    }

    /// A measurement comes: after an outage it tells as little of that time as any other.
    pub fn step(&mut self, now: Time) {
        let since_s = now.seconds_since(self.last);
        self.last = now;
        self.seconds = math::min(since_s, 2.0 * MANOEUVRE_S / self.per_manoeuvre);
        if since_s > ONE_MOMENT_S {
            self.per_manoeuvre = math::max(MANOEUVRE_S / since_s, 1.0);
        }
    }
}
