//! Covariance of a few unknowns, as its lower triangle, row by row.

use nalgebra::SVector;

use crate::math;

/// Covariance of `N` unknowns; `T` is `N (N + 1) / 2`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Covariance<const N: usize, const T: usize> {
    lower: SVector<f32, T>,
}

impl<const N: usize, const T: usize> Covariance<N, T> {
    const SIZES_MATCH: () = assert!(T == N * (N + 1) / 2, "T must be N (N + 1) / 2");

    /// Independent unknowns with these standard deviations.
    pub(crate) fn from_sigma(sigma: &SVector<f32, N>) -> Self {
        let () = Self::SIZES_MATCH;
        let mut covariance = Self {
            lower: SVector::zeros(),
        };
        for (i, sigma) in sigma.iter().enumerate() {
            covariance.widen(i, sigma * sigma);
        }
        covariance
    }

    #[inline(never)]
    fn get(&self, i: usize, j: usize) -> f32 {
        self.lower.get(index_of(i, j)).copied().unwrap_or(0.0)
    }

    pub(crate) fn variance(&self, i: usize) -> f32 {
        self.get(i, i)
    }

    /// Adds to the variance of one unknown.
    pub(crate) fn widen(&mut self, i: usize, variance: f32) {
        if let Some(own) = self.lower.get_mut(index_of(i, i)) {
            *own += variance;
        }
    }

    /// Replaces unknown `i` by an independent one.
    pub(crate) fn reset(&mut self, i: usize, variance: f32) {
        for k in 0..N {
            if let Some(both) = self.lower.get_mut(index_of(i, k)) {
                *both = 0.0;
            }
        }
        self.widen(i, variance);
    }

    /// `x_i += factor x_j`.
    pub(crate) fn shear(&mut self, i: usize, j: usize, factor: f32) {
        let own = 2.0 * factor * self.get(i, j) + factor * factor * self.get(j, j);
        for k in (0..N).filter(|k| *k != i) {
            let add = factor * self.get(j, k);
            if let Some(both) = self.lower.get_mut(index_of(i, k)) {
                *both += add;
            }
        }
        self.widen(i, own);
    }

    /// `P h`.
    pub(crate) fn times(&self, h: &SVector<f32, N>) -> SVector<f32, N> {
        let mut product = SVector::<f32, N>::zeros();
        let mut rest = self.lower.as_slice();
        for (i, h_i) in h.iter().enumerate() {
            let Some((row, later)) = rest.split_at_checked(i + 1) else {
                break;
            };
            let mut own = 0.0;
            for ((p, h_j), to) in row.iter().zip(h).zip(&mut product).take(i) {
                own += p * h_j;
                *to += p * h_i;
            }
            let diagonal = row.last().copied().unwrap_or(0.0) * h_i;
            if let Some(to) = product.get_mut(i) {
                *to += own + diagonal;
            }
            rest = later;
        }
        product
    }

    /// Scalar measurement update, given `P h` and the innovation variance.
    pub(crate) fn update(&mut self, product: &SVector<f32, N>, variance: f32) {
        let mut rest = self.lower.as_mut_slice();
        for (i, with_i) in product.iter().enumerate() {
            let Some((row, later)) = rest.split_at_mut_checked(i + 1) else {
                break;
            };
            let gain = with_i / variance;
            // Rounding must not make it negative.
            let least = 1e-6 * row.last().copied().unwrap_or(0.0);
            for (p, with_j) in row.iter_mut().zip(product) {
                *p -= gain * with_j;
            }
            if let Some(own) = row.last_mut() {
                *own = math::max(*own, least);
            }
            rest = later;
        }
    }

    /// Standard deviation of the sum `h . x`.
    pub(crate) fn sigma_of(&self, h: &SVector<f32, N>) -> f64 {
        math::sqrt(math::max(f64::from(self.times(h).dot(h)), 0.0))
    }
}

/// Index of the covariance of two unknowns.
fn index_of(i: usize, j: usize) -> usize {
    let (low, high) = if i < j { (i, j) } else { (j, i) };
    high * (high + 1) / 2 + low
}
