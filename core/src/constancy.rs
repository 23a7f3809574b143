//! Whether a parameter is known as well as it seems, and is the constant that it is taken for.
//!
//! What an estimate moves by, from one look at it to the next, has the variance that it loses
//! meanwhile: `Var(E[x|2] - E[x|1]) = Var(x|1) - Var(x|2)`, by the law of total variance, whatever
//! was measured. One that goes on moving by more was told less than the model says, or does not
//! stand still: noise of GNSS that no model has, an accelerometer that warms up or rectifies
//! vibration, a unit that slips. Then some of what it has gained is taken back, again and again,
//! until it moves as it should; and it is stated to be known by as much less.

/// Part of its variance that it must have lost to be looked at: less is lost in rounding.
const LEAST_GAIN: f32 = 0.02;
/// Largest square of a move that counts, in the variance lost: of normal ones one in 16,000 is
/// larger.
const LARGEST_SQUARE: f32 = 16.0;
/// Looks over which the squares are averaged. Their mean is then good to a fifth, and 1.5 beyond
/// chance.
const LOOKS: f32 = 20.0;
const RESTLESS: f32 = 1.5;
/// Part of the variance lost that is given back for each unit of the mean square beyond that: a
/// parameter whose moves are twice too large is known no better with time.
const GIVEN_BACK: f32 = 0.5;
/// Largest part that is given back: what is less known than before must show that first.
const MOST_BACK: f32 = 2.0;

/// How one parameter has moved.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Constancy {
    /// Since the last look.
    moved: f32,
    /// Variance at the last look, with what was added since.
    before: f32,
    /// Mean square of its moves, in the variance lost.
    mean: f32,
}

impl Constancy {
    /// Before the first look, which sees nothing but the variance.
    pub const NEW: Self = Self {
        moved: 0.0,
        before: f32::MAX,
        mean: 1.0,
    };

    /// Its estimate has moved.
    pub fn moved(&mut self, by: f32) {
        self.moved += by;
    }

    /// It may have walked by a variance more.
    pub fn walked(&mut self, variance: f32) {
        self.before += variance;
    }

    /// Looks at its variance now; what is to be added to it.
    pub fn look(&mut self, variance: f32) -> Option<f32> {
        let gained = self.before - variance;
        if gained <= LEAST_GAIN * variance {
            return None;
        }
        let square = self.moved * self.moved / gained;
        let bounded = if square < LARGEST_SQUARE {
            square
        } else {
            LARGEST_SQUARE
        };
        self.mean += (bounded - self.mean) / LOOKS;
        self.moved = 0.0;
        self.before = variance;
        let part = GIVEN_BACK * (self.mean - RESTLESS);
        (part > 0.0).then_some(gained * if part < MOST_BACK { part } else { MOST_BACK })
    }

    /// By how much less it is known than its variance says, in variance.
    pub fn inflation(&self) -> f64 {
        f64::from(if self.mean > RESTLESS {
            self.mean / RESTLESS
        } else {
            1.0
        })
    }
}

#[cfg(test)]
#[path = "../tests/unit/constancy.rs"]
mod tests;
