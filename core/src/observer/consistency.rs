//! Whether a parameter is known as well as it seems, and is the constant that it is taken for.
//!
//! What an estimate moves by, from one look at it to the next, has the variance that it loses
//! meanwhile: `Var(E[x|2] - E[x|1]) = Var(x|1) - Var(x|2)`, by the law of total variance, whatever
//! was measured. One that goes on moving by more was told less than the model says, or does not
//! stand still: noise of GNSS that no model has, an accelerometer that warms up or rectifies
//! vibration, a unit that slips. Then some of what it has gained is taken back, again and again,
//! until it moves as it should; and it is stated to be known by as much less.

use crate::math;

/// Part of its variance that it must have lost to be looked at: less is lost in rounding.
const LEAST_GAIN: f32 = 0.02;
/// Largest square of a move that counts, in the variance lost: of normal ones one in 16,000 is
/// larger.
const LARGEST_SQUARE: f32 = 16.0;
/// Looks over which the squares are averaged. Their mean is then good to a fifth, and 1.5 beyond
/// chance.
const LOOKS: f32 = 20.0;
const INCONSISTENT: f32 = 1.5;
/// Part of the variance lost that is given back for each unit of the mean square beyond that: a
/// parameter whose moves are twice too large is known no better with time.
const REINFLATION: f32 = 0.5;
/// Largest part that is given back: what is less known than before must show that first.
const MOST_REINFLATION: f32 = 2.0;

/// Sigmas of what has become known that it may have moved by since its variance was twice as large.
/// Small moves that go on in one direction show there, and in no look.
const HALVING_SIGMAS: f32 = 2.0;

/// A move since some moment, and the variance of then, with what was added since.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Move {
    moved: f32,
    variance: f32,
}

impl Move {
    /// Sees nothing but the variance, when it is looked at first.
    const NEVER: Self = Self::at(f32::MAX);

    const fn at(variance: f32) -> Self {
        Self {
            moved: 0.0,
            variance,
        }
    }
}

/// How one parameter has moved.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Consistency {
    /// Since the last look, and since its variance was twice as large.
    recent: Move,
    halving: Move,
    /// Mean square of its moves from look to look, in the variance lost.
    mean: f32,
}

impl Consistency {
    /// Before the first look.
    pub const NEW: Self = Self {
        recent: Move::NEVER,
        halving: Move::NEVER,
        mean: 1.0,
    };

    /// Its estimate has moved.
    pub fn on_correction(&mut self, by: f32) {
        self.recent.moved += by;
        self.halving.moved += by;
    }

    /// It may have walked by a variance more.
    pub fn on_walk(&mut self, variance: f32) {
        self.recent.variance += variance;
        self.halving.variance += variance;
    }

    /// Looks at its variance now; what is to be added to it, if anything.
    pub fn check(&mut self, variance: f32) -> f32 {
        math::max(self.check_recent(variance), self.check_halving(variance))
    }

    fn check_recent(&mut self, variance: f32) -> f32 {
        let Move { moved, variance: v } = self.recent;
        let gained = v - variance;
        if gained <= LEAST_GAIN * variance {
            return 0.0;
        }
        let bounded = math::min(moved * moved / gained, LARGEST_SQUARE);
        self.mean += (bounded - self.mean) / LOOKS;
        self.recent = Move::at(variance);
        gained * math::min(REINFLATION * (self.mean - INCONSISTENT), MOST_REINFLATION)
    }

    /// As much as makes the move that of its sigmas; all that was gained at most.
    fn check_halving(&mut self, variance: f32) -> f32 {
        let Move { moved, variance: v } = self.halving;
        if v < 2.0 * variance {
            return 0.0;
        }
        let gained = v - variance;
        let excess = moved * moved / (HALVING_SIGMAS * HALVING_SIGMAS) - gained;
        self.halving = Move::at(variance);
        math::min(math::max(excess, 0.0), gained)
    }

    /// By how much less it is known than its variance says, in variance.
    pub fn inflation(&self) -> f64 {
        f64::from(math::max(self.mean, INCONSISTENT) / INCONSISTENT)
    }
}

#[cfg(test)]
#[path = "../../tests/unit/consistency.rs"]
mod tests;
