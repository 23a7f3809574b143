//! Running normal equations: least squares of any number of rows in fixed memory.
//!
//! `matrix * parameters = vector`; the matrix is the information, the observability in physical
//! units. Nothing is inverted until an answer is asked for.

use nalgebra::SVector;

use super::triangle::Triangle;
use crate::math;

/// Normal equations of `N` parameters; `T` is `N (N + 1) / 2`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Information<const N: usize, const T: usize> {
    matrix: Triangle<N, T>,
    vector: SVector<f64, N>,
}

/// Solution of the normal equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solved<const N: usize> {
    /// Least-squares value of each parameter.
    pub value: SVector<f64, N>,
    /// Variance of each parameter for rows of unit weight.
    pub variance: SVector<f64, N>,
}

impl<const N: usize, const T: usize> Information<N, T> {
    /// Independent prior knowledge: mean and standard deviation of each parameter (positive).
    pub fn from_prior(mean: &SVector<f64, N>, sigma: &SVector<f64, N>) -> Self {
        let weight = sigma.map(|s| 1.0 / (s * s));
        Self {
            matrix: Triangle::from_diagonal(&weight),
            vector: weight.component_mul(mean),
        }
    }

    /// Right-hand side.
    pub fn vector(&self) -> &SVector<f64, N> {
        &self.vector
    }

    /// Adds `weight` times the row `coefficients . parameters = measured`.
    pub fn add(&mut self, coefficients: &SVector<f64, N>, measured: f64, weight: f64) {
        self.matrix.add_square(coefficients, weight);
        self.vector += coefficients * (weight * measured);
    }

    /// Adds a direct measurement of parameter `index`.
    pub fn add_direct(&mut self, index: usize, measured: f64, variance: f64) {
        self.matrix.add_diagonal(index, 1.0 / variance);
        if let Some(sum) = self.vector.get_mut(index) {
            *sum += measured / variance;
        }
    }

    /// Lets parameter `index` have walked: adds `variance` to its spread.
    pub fn diffuse(&mut self, index: usize, variance: f64) {
        if variance <= 0.0 {
            return;
        }
        let column = self.matrix.column(index);
        let gain = 1.0 / (1.0 / variance + at(&column, index));
        self.matrix.add_square(&column, -gain);
        self.vector -= column * (at(&self.vector, index) * gain);
    }

    /// Renames parameter `index`: new = old + `coefficients . parameters` + `offset`.
    ///
    /// The coefficient of the parameter itself must be zero.
    pub fn redefine(&mut self, index: usize, coefficients: &SVector<f64, N>, offset: f64) {
        let column = self.matrix.column(index);
        self.vector += column * offset;
        self.vector -= coefficients * at(&self.vector, index);
        // -s c^T - c s^T + c_i s s^T, with half of the last in each of the first two.
        let half = coefficients * (0.5 * at(&column, index)) - column;
        self.matrix.add_product(coefficients, &half);
    }

    /// Solves by Cholesky; `None` if the matrix is not positive definite.
    pub fn solve(&self) -> Option<Solved<N>> {
        let root = self.matrix.cholesky()?;
        let half = root.solve_lower(&self.vector, 0);
        let mut variance = SVector::<f64, N>::zeros();
        for (column, variance) in variance.iter_mut().enumerate() {
            let mut unit = SVector::<f64, N>::zeros();
            if let Some(one) = unit.get_mut(column) {
                *one = 1.0;
            }
            *variance = root.solve_lower(&unit, column).norm_squared();
        }
        Some(Solved {
            value: root.solve_upper(&half),
            variance,
        })
    }

    /// Value and variance of the sum `coefficients . parameters`.
    pub fn combination(&self, coefficients: &SVector<f64, N>) -> Option<(f64, f64)> {
        let root = self.matrix.cholesky()?;
        let row = root.solve_lower(coefficients, 0);
        let half = root.solve_lower(&self.vector, 0);
        Some((row.dot(&half), row.norm_squared()))
    }
}

/// One component; zero if there is none.
fn at<const N: usize>(vector: &SVector<f64, N>, index: usize) -> f64 {
    vector.get(index).copied().unwrap_or(0.0)
}

/// Square root, `None` unless the number is positive.
pub(super) fn positive_root(square: f64) -> Option<f64> {
    (square > 0.0).then(|| math::sqrt(square))
}
