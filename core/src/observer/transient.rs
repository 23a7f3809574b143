//! Errors in proportion to a manoeuvre, which vanish with it.

use nalgebra::Vector3;

use crate::innovations::MANOEUVRE_S;
use crate::math::{self, singles};

/// Error in proportion to a vector.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TransientError {
    vector: Vector3<f32>,
    /// Square of it that is accounted for.
    square: f32,
}

impl TransientError {
    /// Growth of its square over a span that adds `change`, beyond what is accounted for: oscillation adds
    /// nothing.
    pub fn grow(&mut self, change: &Vector3<f64>, seconds: f64) -> f64 {
        let keep = math::single(1.0 / (1.0 + seconds / MANOEUVRE_S));
        self.vector = self.vector * keep + singles(change);
        self.square *= keep * keep;
        let growth = math::max(self.vector.norm_squared() - self.square, 0.0);
        self.square += growth;
        f64::from(growth)
    }
}
