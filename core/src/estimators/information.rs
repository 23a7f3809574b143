//! Running normal equations: least squares of any number of rows in fixed memory.
//!
//! `matrix * parameters = vector`; the matrix is the information, the observability in physical
//! units. Nothing is inverted until an answer is asked for.
// Every index runs over 0..N of arrays of N.
#![allow(clippy::indexing_slicing, clippy::needless_range_loop)]

use nalgebra::{SMatrix, SVector};

use crate::math;

/// Normal equations of `N` parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Information<const N: usize> {
    matrix: SMatrix<f64, N, N>,
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

impl<const N: usize> Information<N> {
    /// Independent prior knowledge: mean and standard deviation of each parameter (positive).
    pub fn from_prior(mean: &SVector<f64, N>, sigma: &SVector<f64, N>) -> Self {
        let weight = sigma.map(|s| 1.0 / (s * s));
        Self {
            matrix: SMatrix::from_diagonal(&weight),
            vector: weight.component_mul(mean),
        }
    }

    /// Right-hand side.
    pub fn vector(&self) -> &SVector<f64, N> {
        &self.vector
    }

    /// Adds `weight` times the row `coefficients . parameters = measured`.
    pub fn add(&mut self, coefficients: &SVector<f64, N>, measured: f64, weight: f64) {
        let weighted = coefficients * weight;
        self.matrix += weighted * coefficients.transpose();
        self.vector += weighted * measured;
    }

    /// Adds a direct measurement of parameter `index`.
    pub fn add_direct(&mut self, index: usize, measured: f64, variance: f64) {
        if index < N {
            self.matrix[(index, index)] += 1.0 / variance;
            self.vector[index] += measured / variance;
        }
    }

    /// Lets parameter `index` have walked: adds `variance` to its spread.
    pub fn diffuse(&mut self, index: usize, variance: f64) {
        if index >= N || variance <= 0.0 {
            return;
        }
        let column: SVector<f64, N> = self.matrix.column(index).into_owned();
        let gain = 1.0 / (1.0 / variance + column[index]);
        let shift = self.vector[index] * gain;
        self.matrix -= column * gain * column.transpose();
        self.vector -= column * shift;
    }

    /// Forgets all about parameter `index` and what hung together with it, then knows it anew.
    pub fn replace(&mut self, index: usize, value: f64, variance: f64) {
        if index >= N {
            return;
        }
        // Schur complement: the other parameters keep what they know by themselves.
        let column: SVector<f64, N> = self.matrix.column(index).into_owned();
        let gain = 1.0 / column[index];
        let shift = self.vector[index] * gain;
        self.matrix -= column * gain * column.transpose();
        self.vector -= column * shift;
        self.matrix[(index, index)] = 1.0 / variance;
        self.vector[index] = value / variance;
    }

    /// Renames parameter `index`: new = old + `coefficients . parameters` + `offset`.
    ///
    /// The coefficient of the parameter itself is taken as zero.
    pub fn redefine(&mut self, index: usize, coefficients: &SVector<f64, N>, offset: f64) {
        if index >= N {
            return;
        }
        let mut others = *coefficients;
        others[index] = 0.0;
        let column: SVector<f64, N> = self.matrix.column(index).into_owned();
        let diagonal = column[index];
        self.vector += column * offset;
        let pivot = self.vector[index];
        self.vector -= others * pivot;
        self.matrix -= column * others.transpose() + others * column.transpose();
        self.matrix += others * diagonal * others.transpose();
    }

    /// Solves by Cholesky; `None` if the matrix is not positive definite.
    pub fn solve(&self) -> Option<Solved<N>> {
        let l = self.cholesky()?;
        let mut value = self.vector;
        for i in 0..N {
            for k in 0..i {
                value[i] -= l[(i, k)] * value[k];
            }
            value[i] /= l[(i, i)];
        }
        for i in (0..N).rev() {
            for k in i + 1..N {
                value[i] -= l[(k, i)] * value[k];
            }
            value[i] /= l[(i, i)];
        }
        Some(Solved {
            value,
            variance: inverse_diagonal(&l),
        })
    }

    /// Value and variance of the sum `coefficients . parameters`.
    pub fn combination(&self, coefficients: &SVector<f64, N>) -> Option<(f64, f64)> {
        let value = coefficients.dot(&self.solve()?.value);
        let l = self.cholesky()?;
        let mut half = *coefficients;
        for i in 0..N {
            for k in 0..i {
                half[i] -= l[(i, k)] * half[k];
            }
            half[i] /= l[(i, i)];
        }
        Some((value, half.norm_squared()))
    }

    fn cholesky(&self) -> Option<SMatrix<f64, N, N>> {
        let mut l = SMatrix::<f64, N, N>::zeros();
        for i in 0..N {
            for j in 0..=i {
                let mut sum = self.matrix[(i, j)];
                for k in 0..j {
                    sum -= l[(i, k)] * l[(j, k)];
                }
                if i == j {
                    // Negated so that NaN fails too.
                    if !(sum > 0.0) {
                        return None;
                    }
                    l[(i, i)] = math::sqrt(sum);
                } else {
                    l[(i, j)] = sum / l[(j, j)];
                }
            }
        }
        Some(l)
    }
}

/// Diagonal of `(L L^T)^-1`: squared columns of `L^-1` summed.
fn inverse_diagonal<const N: usize>(l: &SMatrix<f64, N, N>) -> SVector<f64, N> {
    let mut diagonal = SVector::<f64, N>::zeros();
    for j in 0..N {
        let mut column = SVector::<f64, N>::zeros();
        column[j] = 1.0 / l[(j, j)];
        for i in j + 1..N {
            let mut sum = 0.0;
            for k in j..i {
                sum -= l[(i, k)] * column[k];
            }
            column[i] = sum / l[(i, i)];
        }
        diagonal[j] = column.norm_squared();
    }
    diagonal
}
