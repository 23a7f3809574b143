//! Recursive least squares in fixed memory, as a square-root-free information filter.
//!
//! The state is triangular: row `i` says `x_i + sum r_ij x_j = z_i` over the later `j`, with a weight. New
//! rows are rotated in without square roots (Gentleman, J. Inst. Maths Applics 12, 1973; Bierman,
//! Factorization Methods for Discrete Sequential Estimation, 1977): the condition number is that of the
//! rows, not its square as in normal equations, so single precision is enough for corrections to a
//! solution, and a solution is one substitution.

use nalgebra::{ArrayStorage, SVector};

use crate::math;

/// Least squares of at most `N` parameters; `T` is `N (N + 1) / 2`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LeastSquares<const N: usize, const T: usize> {
    /// Number of estimated parameters, from the first on. The others cost nothing.
    count: usize,
    weight: SVector<f32, N>,
    /// Row by row the later coefficients and, last, `z`.
    rows: SVector<f32, T>,
}

/// Statistics of rows against what was known before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Added {
    /// Normalized square of the innovations: the growth of the weighted sum of squared residuals.
    pub square: f32,
    /// Determinant of their covariance over that of the rows' own noise: one plus the parameters' part, in
    /// one direction.
    pub determinant: f32,
}

/// Row of a random-walk step, given the parameters: `step + by . x = z`, with a variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WalkStep<const N: usize> {
    pub by: SVector<f32, N>,
    pub z: f32,
    pub variance: f32,
}

impl<const N: usize, const T: usize> LeastSquares<N, T> {
    const SIZES_MATCH: () = assert!(T == N * (N + 1) / 2, "T must be N (N + 1) / 2");

    /// Of no parameter: all zeros, to take no flash.
    pub const EMPTY: Self = Self {
        count: 0,
        weight: SVector::from_array_storage(ArrayStorage([[0.0; N]])),
        rows: SVector::from_array_storage(ArrayStorage([[0.0; T]])),
    };

    /// Independent prior: zero with these standard deviations, which may be zero for the last ones.
    #[cfg(any(test, feature = "literal"))]
    pub fn from_prior(sigma: &SVector<f32, N>) -> Self {
        let mut own = Self::EMPTY;
        own.set_prior(sigma);
        own
    }

    /// Sets the prior of [`Self::EMPTY`] in place: it is large.
    pub fn set_prior(&mut self, sigma: &SVector<f32, N>) {
        let () = Self::SIZES_MATCH;
        self.count = sigma.iter().take_while(|sigma| **sigma > 0.0).count();
        self.weight = sigma.map(|s| if s > 0.0 { 1.0 / (s * s) } else { 0.0 });
    }

    /// Number of estimated parameters.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Adds `R` rows `coefficients . x = measured`, each with its weight; `coefficients` is a row per
    /// parameter, and is overwritten.
    pub fn add<const R: usize>(
        &mut self,
        coefficients: &mut [[f32; R]; N],
        mut measured: [f32; R],
        weights: [f32; R],
    ) -> Added {
        let mut weight = weights;
        let mut left = coefficients.get_mut(..self.count).unwrap_or_default();
        let mut rows = self.rows.as_mut_slice();
        for own in &mut self.weight {
            let Some((pivots, later)) = left.split_first_mut() else {
                break;
            };
            let Some((row, below)) = rows.split_at_mut_checked(later.len() + 1) else {
                break;
            };
            let matters = pivots.iter().any(|x| *x != 0.0);
            if let (true, Some((z, row))) = (matters, row.split_last_mut()) {
                let mut takes = [0.0; R];
                for ((x, weight), take) in pivots.iter().zip(&mut weight).zip(&mut takes) {
                    let keep;
                    (keep, *take) = rotate(own, *weight, *x);
                    *weight *= keep;
                }
                by_eights(row, later.as_chunks_mut::<8>(), |old, new| {
                    givens(old, new, pivots, &takes);
                });
                givens(z, &mut measured, pivots, &takes);
            }
            (left, rows) = (later, below);
        }
        let squares = measured.iter().zip(&weight);
        let ratios = weights.iter().zip(&weight);
        Added {
            square: squares.map(|(left, weight)| weight * left * left).sum(),
            determinant: ratios.map(|(own, weight)| own / weight).product(),
        }
    }

    /// Fades all that is known: weights times this.
    pub fn fade(&mut self, keep: f32) {
        self.weight *= keep;
    }

    /// Adds direct measurements of parameters from `first` on, each with its variance.
    pub fn add_direct<const R: usize>(
        &mut self,
        first: usize,
        measured: [f32; R],
        variance: [f32; R],
    ) {
        let mut rows = [[0.0; R]; N];
        for (axis, row) in rows.iter_mut().skip(first).take(R).enumerate() {
            if let Some(one) = row.get_mut(axis) {
                *one = 1.0;
            }
        }
        self.add(&mut rows, measured, variance.map(|variance| 1.0 / variance));
    }

    /// Adds a random-walk step of this variance to parameter `index`.
    ///
    /// The step is one more unknown with a prior of zero; it is rotated out of all rows that contain it,
    /// from the last up, and its own row is returned.
    pub fn diffuse(&mut self, index: usize, variance: f32) -> Option<WalkStep<N>> {
        if variance < f32::MIN_POSITIVE || index >= self.count {
            return None;
        }
        let mut step_weight = 1.0 / variance;
        let mut step = SVector::<f32, N>::zeros();
        let mut step_z = 0.0;
        for i in (0..=index).rev() {
            let (Some(row), Some(later), Some(weight)) = (
                self.rows
                    .as_mut_slice()
                    .get_mut(start(self.count, i)..start(self.count, i + 1)),
                step.as_mut_slice().get_mut(i..self.count),
                self.weight.get_mut(i),
            ) else {
                return None;
            };
            let (Some((z, row)), Some((own, later))) =
                (row.split_last_mut(), later.split_first_mut())
            else {
                return None;
            };
            let x = if i == index {
                -1.0
            } else {
                -row.get(index - i - 1).copied().unwrap_or(0.0)
            };
            let (keep, take) = rotate(&mut step_weight, *weight, x);
            *weight *= keep;
            *own += take;
            by_eights(row, later.as_chunks_mut::<8>(), |row, step| {
                *row -= x * *step;
                *step += take * *row;
            });
            *z -= x * step_z;
            step_z += take * *z;
        }
        Some(WalkStep {
            by: step,
            z: step_z,
            variance: 1.0 / step_weight,
        })
    }

    /// Replaces parameter `index` by itself plus `by . x`, where `by` holds later parameters alone.
    pub fn redefine(&mut self, index: usize, by: &SVector<f32, N>) {
        if index >= self.count {
            return;
        }
        for i in 0..=index {
            let (Some(row), Some(by)) = (
                self.rows
                    .as_mut_slice()
                    .get_mut(start(self.count, i)..start(self.count, i + 1)),
                by.as_slice().get(i + 1..self.count),
            ) else {
                return;
            };
            let own = if i == index {
                1.0
            } else {
                row.get(index - i - 1).copied().unwrap_or(0.0)
            };
            for (element, by) in row.iter_mut().zip(by) {
                *element -= own * by;
            }
        }
    }

    pub fn solve(&self) -> SVector<f32, N> {
        self.substitute(|_, z| z)
    }

    /// Covariances of one parameter with each, over its variance: by how much each is wrong if it is by one.
    pub fn regression_on(&self, index: usize) -> SVector<f32, N> {
        let mut one = unit(index);
        let variance = self.whiten(&mut one);
        let covariances = self.substitute(|i, _| {
            let (own, weight) = (one.get(i), self.weight.get(i));
            own.zip(weight).map_or(0.0, |(own, weight)| own / weight)
        });
        covariances / math::max(variance, f32::MIN_POSITIVE)
    }

    /// Back substitution of a right side, which is given each row's number and `z`.
    fn substitute(&self, right: impl Fn(usize, f32) -> f32) -> SVector<f32, N> {
        let mut x = SVector::zeros();
        let rows = self.rows.as_slice();
        let Some(mut rows) = rows.get(..start(self.count, self.count)) else {
            return x;
        };
        for i in (0..self.count).rev() {
            let Some((above, row)) = rows.split_at_checked(start(self.count, i)) else {
                return x;
            };
            let (Some((z, row)), Some((own, later))) = (
                row.split_last(),
                x.as_mut_slice()
                    .get_mut(i..self.count)
                    .and_then(<[f32]>::split_first_mut),
            ) else {
                return x;
            };
            *own = right(i, *z) - dot(row, later);
            rows = above;
        }
        x
    }

    /// Makes the solution the new origin of the parameters.
    pub fn zero_solution(&mut self) {
        for i in 1..=self.count {
            if let Some(z) = self.rows.as_mut_slice().get_mut(start(self.count, i) - 1) {
                *z = 0.0;
            }
        }
    }

    pub fn variance(&self, index: usize) -> f32 {
        self.variance_of(unit(index))
    }

    /// Mean variance of the sums `coefficients . x` of rows as [`Self::add`] takes them.
    pub fn mean_variance<const R: usize>(&self, coefficients: &[[f32; R]; N]) -> f64 {
        let mut sum = 0.0;
        let mut count = 0.0;
        for row in 0..R {
            let one = coefficients.map(|of| of.get(row).copied().unwrap_or(0.0));
            sum += f64::from(self.variance_of(one));
            count += 1.0;
        }
        sum / count
    }

    /// Variance of the sum `coefficients . x`.
    pub fn variance_of(&self, mut coefficients: [f32; N]) -> f32 {
        self.whiten(&mut coefficients)
    }

    /// Makes coefficients of the parameters those of the rows' independent errors, and returns the variance
    /// of the sum.
    fn whiten(&self, coefficients: &mut [f32; N]) -> f32 {
        let mut left = coefficients.get_mut(..self.count).unwrap_or_default();
        let mut rows = self.rows.as_slice();
        let mut variance = 0.0;
        for weight in &self.weight {
            let Some((own, later)) = left.split_first_mut() else {
                return variance;
            };
            let Some((row, below)) = rows.split_at_checked(later.len() + 1) else {
                return variance;
            };
            if let (true, Some((_z, row))) = (*own != 0.0, row.split_last()) {
                variance += *own * *own / weight;
                by_eights(later, row.as_chunks::<8>(), |later, element| {
                    *later -= *own * element;
                });
            }
            (left, rows) = (later, below);
        }
        variance
    }
}

/// Applies a function to pairs of elements, unrolled by eight: the inner loop of most of the work, of which
/// the counting would be a quarter.
fn by_eights<A, B, Eight: IntoIterator<Item = B>>(
    elements: &mut [A],
    (eights, rest): (impl IntoIterator<Item = Eight>, impl IntoIterator<Item = B>),
    mut each: impl FnMut(&mut A, B),
) {
    let (own_eights, own_rest) = elements.as_chunks_mut::<8>();
    for (own, eight) in own_eights.iter_mut().zip(eights) {
        for (own, partner) in own.iter_mut().zip(eight) {
            each(own, partner);
        }
    }
    for (own, partner) in own_rest.iter_mut().zip(rest) {
        each(own, partner);
    }
}

/// Applies the rotations to one element of a row and those of the rows that are rotated in.
fn givens<const R: usize>(old: &mut f32, new: &mut [f32; R], pivots: &[f32; R], takes: &[f32; R]) {
    for ((new, x), take) in new.iter_mut().zip(pivots).zip(takes) {
        *new -= x * *old;
        *old += take * *new;
    }
}

/// Rotation of a row with pivot `x` into row `own`: the factor on its weight, and the coefficient by which
/// `own` takes of it.
fn rotate(own: &mut f32, weight: f32, x: f32) -> (f32, f32) {
    let total = *own + weight * x * x;
    let inverse = 1.0 / total;
    let keep = *own * inverse;
    *own = total;
    (keep, weight * x * inverse)
}

/// First element of row `i` of `count`.
const fn start(count: usize, i: usize) -> usize {
    i * count - i * (i.saturating_sub(1)) / 2
}

/// Row that selects one parameter.
fn unit<const N: usize>(index: usize) -> [f32; N] {
    core::array::from_fn(|i| if i == index { 1.0 } else { 0.0 })
}

fn dot(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).fold(0.0, |sum, (a, b)| sum + a * b)
}

#[cfg(test)]
#[path = "../tests/unit/least_squares.rs"]
mod tests;
