//! A quantity over time.

use nalgebra::Vector2;

/// A quantity at equal steps of time, to be looked up fast.
#[derive(Default)]
pub(super) struct Curve {
    start_s: f64,
    values: Vec<f64>,
    last: Option<(f64, f64)>,
}

impl Curve {
    /// Finer than any manoeuvre.
    const STEP_S: f64 = 0.02;

    /// Interpolates between points in order of time.
    pub(super) fn new(points: impl Iterator<Item = (f64, f64)>) -> Self {
        let mut curve = Self::default();
        for (time_s, value) in points {
            curve.push(time_s, value);
        }
        curve
    }

    /// Goes on to a point that is later than the last.
    pub(super) fn push(&mut self, to_s: f64, b: f64) {
        let (from_s, a) = self.last.replace((to_s, b)).unwrap_or_else(|| {
            self.start_s = to_s;
            (to_s, b)
        });
        loop {
            let time_s = self.start_s + Self::STEP_S * self.values.len() as f64;
            if time_s >= to_s {
                break;
            }
            self.values
                .push(a + (b - a) * (time_s - from_s) / (to_s - from_s));
        }
    }

    /// Whether a time is within.
    pub(super) fn reaches(&self, time_s: f64) -> bool {
        let step = (time_s - self.start_s) / Self::STEP_S;
        step >= 0.0 && step + 1.0 < self.values.len() as f64
    }

    /// The value at a time within.
    pub(super) fn at(&self, time_s: f64) -> f64 {
        let step = (time_s - self.start_s) / Self::STEP_S;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // Within, as promised.
        let index = (step as usize).min(self.values.len() - 2);
        let (a, b) = (self.values[index], self.values[index + 1]);
        a + (b - a) * (step - index as f64)
    }
}

/// Ends of successive intervals of a second or so, among what comes in order of time, s; where
/// nothing comes for three seconds there is none.
pub(super) fn intervals<T: Copy>(all: impl Iterator<Item = (f64, T)>) -> Vec<[(f64, T); 2]> {
    let mut intervals = Vec::new();
    let mut start: Option<(f64, T)> = None;
    for next in all {
        let from = *start.get_or_insert(next);
        let seconds = next.0 - from.0;
        if seconds < 0.95 {
            continue;
        }
        if seconds < 3.0 {
            intervals.push([from, next]);
        }
        start = Some(next);
    }
    intervals
}

/// Angle from one vector to the next, counter-clockwise.
pub(super) fn turned(from: Vector2<f64>, to: Vector2<f64>) -> f64 {
    from.perp(&to).atan2(from.dot(&to))
}
