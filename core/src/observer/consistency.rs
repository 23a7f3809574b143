//! Consistency of a parameter's corrections with its variance.
//!
//! Between two checks an estimate changes with the variance that it loses:
//! `Var(E[x|2] - E[x|1]) = Var(x|1) - Var(x|2)`, by the law of total variance, whatever was measured. If it
//! keeps changing by more, its variance is too small, or it is no constant: unmodelled noise of GNSS, an
//! accelerometer that warms up or rectifies vibration, a mount that slips. Then part of the variance lost
//! is added back at every check until the changes are consistent, and the stated sigma is larger by as
//! much.

use crate::math;

/// Least loss of variance for a check, as a part of it: less is lost in rounding.
const LEAST_REDUCTION: f32 = 0.02;
/// Bound on the normalized square of a change: of normal ones one in 16,000 is larger.
const LARGEST_SQUARE: f32 = 16.0;
/// Checks over which the squares are averaged: their mean is good to a fifth, and 1.5 beyond chance.
const MEMORY_CHECKS: f32 = 20.0;
const INCONSISTENT: f32 = 1.5;
/// Part of the lost variance that is added back per unit of the mean square beyond that: with changes twice
/// too large the variance does not fall any more.
const REINFLATION: f32 = 0.5;
/// Bound on that part: a loss of knowledge must show first.
const MOST_REINFLATION: f32 = 2.0;

/// Sigmas of the variance lost by which it may change while its variance halves: small changes in one
/// direction show there, and in no single check.
const HALVING_SIGMAS: f32 = 2.0;

/// Change since some time, and the variance then, plus what was added since.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Move {
    moved: f32,
    variance: f32,
}

impl Move {
    /// The first check only takes the variance.
    const NEVER: Self = Self::at(f32::MAX);

    const fn at(variance: f32) -> Self {
        Self {
            moved: 0.0,
            variance,
        }
    }
}

/// Changes of one parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Consistency {
    /// Since the last check, and since its variance was twice as large.
    recent: Move,
    halving: Move,
    /// Mean normalized square of the changes.
    mean: f32,
}

impl Consistency {
    /// Before the first check.
    pub const NEW: Self = Self {
        recent: Move::NEVER,
        halving: Move::NEVER,
        mean: 1.0,
    };

    /// The estimate has been corrected.
    pub fn on_correction(&mut self, by: f32) {
        self.recent.moved += by;
        self.halving.moved += by;
    }

    /// Process noise has been added.
    pub fn on_walk(&mut self, variance: f32) {
        self.recent.variance += variance;
        self.halving.variance += variance;
    }

    /// Checks it, given its variance; returns the variance to add.
    pub fn check(&mut self, variance: f32) -> f32 {
        math::max(self.check_recent(variance), self.check_halving(variance))
    }

    fn check_recent(&mut self, variance: f32) -> f32 {
        let Move { moved, variance: v } = self.recent;
        let reduction = v - variance;
        if reduction <= LEAST_REDUCTION * variance {
            return 0.0;
        }
        let bounded = math::min(moved * moved / reduction, LARGEST_SQUARE);
        self.mean += (bounded - self.mean) / MEMORY_CHECKS;
        self.recent = Move::at(variance);
        reduction * math::min(REINFLATION * (self.mean - INCONSISTENT), MOST_REINFLATION)
    }

    /// Adds what makes the change one of so many sigmas, and no more than was lost.
    fn check_halving(&mut self, variance: f32) -> f32 {
        let Move { moved, variance: v } = self.halving;
        if v < 2.0 * variance {
            return 0.0;
        }
        let reduction = v - variance;
        let excess = moved * moved / (HALVING_SIGMAS * HALVING_SIGMAS) - reduction;
        self.halving = Move::at(variance);
        math::min(math::max(excess, 0.0), reduction)
    }

    /// Factor on the stated variance.
    pub fn inflation(&self) -> f64 {
        f64::from(math::max(self.mean, INCONSISTENT) / INCONSISTENT)
    }
}

#[cfg(test)]
#[path = "../../tests/unit/consistency.rs"]
mod tests;
