//! A vector over a short time, by its values and derivatives at both ends.

use nalgebra::Vector3;

/// A cubic on [0, 1].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cubic([Vector3<f64>; 4]);

impl Cubic {
    /// Through value and derivative at both ends.
    pub(crate) fn between([v0, d0]: [Vector3<f64>; 2], [v1, d1]: [Vector3<f64>; 2]) -> Self {
        Self([
            v0,
            d0,
            3.0 * (v1 - v0) - 2.0 * d0 - d1,
            2.0 * (v0 - v1) + d0 + d1,
        ])
    }

    /// Value and derivative.
    pub(crate) fn at(&self, u: f64) -> (Vector3<f64>, Vector3<f64>) {
        let [c0, c1, c2, c3] = &self.0;
        (
            c0 + u * (c1 + u * (c2 + u * c3)),
            c1 + u * (2.0 * c2 + 3.0 * u * c3),
        )
    }

    /// Mean from the start on.
    pub(crate) fn mean_until(&self, u: f64) -> Vector3<f64> {
        let [c0, c1, c2, c3] = &self.0;
        c0 + u * (c1 / 2.0 + u * (c2 / 3.0 + u * c3 / 4.0))
    }

    /// Over the whole.
    pub(crate) fn integral(&self) -> Vector3<f64> {
        let [c0, c1, c2, c3] = &self.0;
        c0 + c1 / 2.0 + c2 / 3.0 + c3 / 4.0
    }
}
