//! Lower triangles in packed form: symmetric matrices and their Cholesky factors.
//!
//! Row `i` holds the elements 0 to `i`. Everything goes row by row through slices, so that no
//! index can be out of bounds.

use nalgebra::SVector;

use super::information::positive_root;

/// Lower triangle of `N` rows; `T` is `N (N + 1) / 2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle<const N: usize, const T: usize> {
    packed: [f64; T],
}

/// First element of row `i`.
const fn start(i: usize) -> usize {
    i * (i + 1) / 2
}

impl<const N: usize, const T: usize> Triangle<N, T> {
    const SIZES_MATCH: () = assert!(T == start(N), "T must be N (N + 1) / 2");

    fn zeros() -> Self {
        let () = Self::SIZES_MATCH;
        Self { packed: [0.0; T] }
    }

    /// A diagonal matrix.
    pub fn from_diagonal(diagonal: &SVector<f64, N>) -> Self {
        let mut matrix = Self::zeros();
        for (i, value) in diagonal.iter().enumerate() {
            matrix.add_diagonal(i, *value);
        }
        matrix
    }

    fn row(&self, i: usize) -> &[f64] {
        self.packed.get(start(i)..start(i + 1)).unwrap_or_default()
    }

    /// Adds to one element of the diagonal.
    pub fn add_diagonal(&mut self, i: usize, value: f64) {
        if let Some(element) = self.packed.get_mut(start(i) + i) {
            *element += value;
        }
    }

    /// Column `index` of the symmetric matrix.
    pub fn column(&self, index: usize) -> SVector<f64, N> {
        let mut column = SVector::<f64, N>::zeros();
        for (i, element) in column.iter_mut().enumerate() {
            let place = if i < index {
                start(index) + i
            } else {
                start(i) + index
            };
            *element = self.packed.get(place).copied().unwrap_or(0.0);
        }
        column
    }

    /// Adds `weight v v^T`.
    pub fn add_square(&mut self, v: &SVector<f64, N>, weight: f64) {
        let mut rest = self.packed.as_mut_slice();
        for (i, vi) in v.iter().enumerate() {
            let Some((row, below)) = rest.split_at_mut_checked(i + 1) else {
                return;
            };
            let factor = weight * vi;
            for (element, vj) in row.iter_mut().zip(v) {
                *element += factor * vj;
            }
            rest = below;
        }
    }

    /// Adds `a b^T + b a^T`.
    pub fn add_product(&mut self, a: &SVector<f64, N>, b: &SVector<f64, N>) {
        let mut rest = self.packed.as_mut_slice();
        for (i, (ai, bi)) in a.iter().zip(b).enumerate() {
            let Some((row, below)) = rest.split_at_mut_checked(i + 1) else {
                return;
            };
            for (element, (aj, bj)) in row.iter_mut().zip(a.iter().zip(b)) {
                *element += ai * bj + bi * aj;
            }
            rest = below;
        }
    }

    /// The factor `L` of `L L^T`; `None` if the matrix is not positive definite.
    pub fn cholesky(&self) -> Option<Self> {
        let mut root = *self;
        for i in 0..N {
            let (above, rest) = root.packed.split_at_mut_checked(start(i))?;
            let (row, _) = rest.split_at_mut_checked(i + 1)?;
            let mut upper = &*above;
            for j in 0..i {
                let (other, below) = upper.split_at_checked(j + 1)?;
                upper = below;
                let (done, todo) = row.split_at_mut_checked(j)?;
                let (pivot, known) = other.split_last()?;
                let element = todo.first_mut()?;
                *element = (*element - dot(done, known)) / pivot;
            }
            let (pivot, done) = row.split_last_mut()?;
            *pivot = positive_root(*pivot - dot(done, done))?;
        }
        Some(root)
    }

    /// Solves `L x = b` for this `L`, where `b` is zero before element `from`.
    pub fn solve_lower(&self, b: &SVector<f64, N>, from: usize) -> SVector<f64, N> {
        let mut x = *b;
        for i in from..N {
            let row = self.row(i).get(from..).unwrap_or_default();
            if let (Some(known), Some((pivot, row))) = (x.as_slice().get(from..i), row.split_last())
            {
                let sum = dot(row, known);
                if let Some(element) = x.get_mut(i) {
                    *element = (*element - sum) / pivot;
                }
            }
        }
        x
    }

    /// Solves `L^T x = b` for this `L`.
    pub fn solve_upper(&self, b: &SVector<f64, N>) -> SVector<f64, N> {
        let mut x = *b;
        for i in (0..N).rev() {
            let Some((pivot, row)) = self.row(i).split_last() else {
                continue;
            };
            let Some((element, above)) = x
                .as_mut_slice()
                .get_mut(..=i)
                .and_then(<[f64]>::split_last_mut)
            else {
                continue;
            };
            *element /= pivot;
            for (other, l) in above.iter_mut().zip(row) {
                *other -= l * *element;
            }
        }
        x
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |sum, (a, b)| sum + a * b)
}

/// Arrays of any size are beyond serde's derive: packed elements cross as a sequence.
#[cfg(feature = "serde")]
mod serde_packed {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::Triangle;

    impl<const N: usize, const T: usize> Serialize for Triangle<N, T> {
        fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            nalgebra::SVector::<f64, T>::from(self.packed).serialize(serializer)
        }
    }

    impl<'de, const N: usize, const T: usize> Deserialize<'de> for Triangle<N, T> {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            let packed = nalgebra::SVector::<f64, T>::deserialize(deserializer)?;
            let packed = <[f64; T]>::try_from(packed.as_slice()).map_err(D::Error::custom)?;
            Ok(Self { packed })
        }
    }
}
