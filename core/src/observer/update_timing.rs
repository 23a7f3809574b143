//! How often measurements come.

use crate::innovations::MANOEUVRE_S;
use crate::math;
use crate::time::Time;

/// Measurements no further apart are of one moment, s.
const ONE_MOMENT_S: f64 = 1e-3;

/// How often level or vertical measurements come.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct UpdateTiming {
    last: Time,
    /// Since the measurement before, which may be of the same moment, but no more than twice what lay between
    /// those before.
    pub seconds: f64,
    /// How many moments like the last an ordinary manoeuvre has.
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

    /// One comes: after an outage it says as little of the time without as any other.
    pub fn step(&mut self, now: Time) {
        let since_s = now.seconds_since(self.last);
        self.last = now;
        self.seconds = math::min(since_s, 2.0 * MANOEUVRE_S / self.per_manoeuvre);
        if since_s > ONE_MOMENT_S {
            self.per_manoeuvre = math::max(MANOEUVRE_S / since_s, 1.0);
        }
    }
}
