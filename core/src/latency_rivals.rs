//! Whether another latency explains what GNSS measures far better than the one that was found.
//!
//! Small corrections lead to the latency that is next. Where motion repeats, as steps do, one that
//! is a period off looks nearly right, and only what does not repeat tells: over minutes, the
//! residuals that each of a row of other latencies would leave are held against one's own.

use nalgebra::{Matrix2, Vector2, Vector3};

use crate::math;

/// The first of them, their distance, and how far from one's own they must be, s: a linear
/// correction leads from one to the next, and the ring is as long as that.
const FIRST_S: f64 = -0.9;
const SPACING_S: f64 = 0.15;
const RIVALS: usize = 14;
const APART_S: f64 = 0.2;
/// Log-likelihood by which a rival wins, as if the noise were white: for it often is not, and there
/// are many rivals and many fixes, far more than odds alone ask for.
const DECIDED: f64 = 50.0;
/// Log-likelihood that excludes a rival, by the same reason, and that of each comparison: an INS
/// that follows a wrong latency makes all residuals larger.
const EXCLUDED: f64 = 100.0;
const EXCLUDED_EACH: f64 = 0.4;
/// Least time between two comparisons that are taken, s: noise that is not white tells no more.
const LEAST_INTERVAL_S: f32 = 0.3;
/// Comparisons that are remembered, of residuals and of the way that the body goes.
const MEMORY: f32 = 1000.0;
const WAY_MEMORY: f32 = 100.0;

/// INS minus GNSS at another moment, level, m/s, and by what it changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// East and north.
    pub velocity_mps: Vector2<f32>,
    /// With a latency a second shorter, m/s^2.
    pub accel_mps2: Vector2<f32>,
    /// With a lever arm longer by a second of the way that the body goes, m/s.
    pub swing_mps: Vector2<f32>,
}

/// Sums over the same comparisons.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Rival {
    count: f32,
    /// Squares of one's own residuals and of its, (m/s)^2.
    own: f32,
    its: f32,
    /// Their products with what they change by, and of that with itself.
    by_change: Vector2<f32>,
    change: Matrix2<f32>,
}

/// All rivals.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LatencyRivals {
    rivals: [Rival; RIVALS],
    /// The one whose odds are looked at next.
    turn: u8,
    /// Velocity in the body, on average, m/s.
    way_mps: Vector3<f32>,
    /// Since the last comparison that was taken, s.
    waited_s: f32,
}

impl LatencyRivals {
    /// Whether a comparison that comes so many seconds after the last one is worth its work.
    pub fn wants(&mut self, interval_s: f64) -> bool {
        self.waited_s += math::single(interval_s);
        self.waited_s >= LEAST_INTERVAL_S
    }

    /// Takes a velocity in the body, m/s, and what a comparison would have been with other
    /// latencies than `own_s`, where it can be had. The latency that has won, if one has, s.
    pub fn take(
        &mut self,
        body_mps: &Vector3<f32>,
        own_s: f64,
        with: impl Fn(f64, &Vector3<f32>) -> Option<Residual>,
    ) -> Option<f64> {
        self.waited_s = 0.0;
        self.way_mps += (body_mps - self.way_mps) / WAY_MEMORY;
        let own = with(own_s, &self.way_mps)?.velocity_mps.norm_squared();
        for (rival, nth) in self.rivals.iter_mut().zip(0..) {
            if let Some(residual) = with(latency_s(nth), &self.way_mps) {
                rival.take(own, &residual);
            }
        }
        self.turn = if usize::from(self.turn) + 1 < RIVALS {
            self.turn + 1
        } else {
            0
        };
        let (more_s, odds) = self.rivals.get(usize::from(self.turn))?.best()?;
        let rival_s = latency_s(self.turn) + more_s;
        if odds < DECIDED || math::abs(rival_s - own_s) < APART_S {
            return None;
        }
        *self = Self::default();
        Some(rival_s)
    }

    /// How far off a rival is that cannot be excluded, s, although so small a spread of the latency
    /// as this does it beyond doubt: zero if there is none.
    pub fn open_s(&self, own_s: f64, sigma_s: f64) -> f64 {
        let mut farthest_s = 0.0;
        for (rival, nth) in self.rivals.iter().zip(0_u8..) {
            let Some((more_s, odds)) = rival.best() else {
                continue;
            };
            let off_s = math::abs(latency_s(nth) + more_s - own_s);
            let sigmas = off_s / sigma_s;
            let excluded = math::max(EXCLUDED, EXCLUDED_EACH * f64::from(rival.count));
            let sure = sigmas * sigmas > 4.0 * EXCLUDED && rival.expected(off_s) > 2.0 * excluded;
            if odds > -excluded && sure && off_s > APART_S {
                farthest_s = math::max(farthest_s, off_s);
            }
        }
        farthest_s
    }

    /// Along the way, m/s.
    pub fn way_mps(&self) -> f64 {
        f64::from(self.way_mps.norm())
    }
}

impl Rival {
    fn take(&mut self, own: f32, residual: &Residual) {
        let velocity_mps = &residual.velocity_mps;
        let change = Matrix2::from_columns(&[residual.accel_mps2, residual.swing_mps]);
        let keep = 1.0 - self.count / (MEMORY * MEMORY);
        self.count = keep * self.count + 1.0;
        self.own = keep * self.own + own;
        self.its = keep * self.its + velocity_mps.norm_squared();
        self.by_change = keep * self.by_change + change.tr_mul(velocity_mps);
        self.change = keep * self.change + change.tr_mul(&change);
    }

    /// Log-likelihood that would exclude it, so far off, if the motion did not repeat.
    fn expected(&self, off_s: f64) -> f64 {
        let more = off_s * off_s * f64::from(self.change.m11 / self.own);
        f64::from(self.count) * math::log(1.0 + more)
    }

    /// By how much more the latency would be at its best, s, and how much likelier that is than
    /// one's own.
    fn best(&self) -> Option<(f64, f64)> {
        let corrections = -self.change.try_inverse()? * self.by_change;
        let left = self.its + corrections.dot(&self.by_change);
        let more_s = -f64::from(corrections.x);
        (math::abs(more_s) < SPACING_S && left > 0.0).then(|| {
            let odds = f64::from(self.count) * math::log(f64::from(self.own / left));
            (more_s, odds)
        })
    }
}

/// Which latency each supposes, s.
fn latency_s(nth: u8) -> f64 {
    FIRST_S + SPACING_S * f64::from(nth)
}

#[cfg(test)]
#[path = "../tests/unit/latency_rivals.rs"]
mod tests;
