//! Maximization without derivatives.

use nalgebra::{SMatrix, SVector};

/// Iterations of the simplex after which it has converged, or never will.
const MAX_ITERATIONS: u32 = 400;
/// Newton steps after which the maximum is reached, or never will be.
const MAX_STEPS: u32 = 20;
/// Step of the numerical gradient.
const GRADIENT_STEP: f64 = 0.01;
/// Least and first damping of the Newton steps, none of which is longer than one in any coordinate.
const LEAST_DAMPING: f64 = 1e-3;
const DAMPING: f64 = 0.1;

/// The point with the greatest value, from a start and a first step per coordinate
/// (Nelder and Mead, 1965).
pub fn nelder_mead<const N: usize>(
    f: impl Fn(&[f64; N]) -> f64,
    start: [f64; N],
    step: [f64; N],
    tolerance: f64,
) -> ([f64; N], f64) {
    let mut simplex: Vec<([f64; N], f64)> = (0..=N)
        .map(|corner| {
            let mut point = start;
            if corner > 0 {
                point[corner - 1] += step[corner - 1];
            }
            (point, f(&point))
        })
        .collect();
    for _ in 0..MAX_ITERATIONS {
        simplex.sort_by(|a, b| b.1.total_cmp(&a.1));
        let (best, worst) = (simplex[0].1, simplex[N].1);
        if best - worst < tolerance {
            break;
        }
        let last = simplex[N].0;
        let centre: [f64; N] = core::array::from_fn(|i| {
            simplex[..N].iter().map(|corner| corner.0[i]).sum::<f64>() / N as f64
        });
        let along = |factor: f64| {
            let point = core::array::from_fn(|i| centre[i] + factor * (last[i] - centre[i]));
            (point, f(&point))
        };
        let reflected = along(-1.0);
        let moved = if reflected.1 > best {
            let expanded = along(-2.0);
            if expanded.1 > reflected.1 {
                expanded
            } else {
                reflected
            }
        } else if reflected.1 > simplex[N - 1].1 {
            reflected
        } else {
            along(if reflected.1 > worst { -0.5 } else { 0.5 })
        };
        if moved.1 > worst {
            simplex[N] = moved;
        } else {
            let first = simplex[0].0;
            for corner in &mut simplex[1..] {
                corner.0 = core::array::from_fn(|i| 0.5 * (first[i] + corner.0[i]));
                corner.1 = f(&corner.0);
            }
        }
    }
    simplex.sort_by(|a, b| b.1.total_cmp(&a.1));
    simplex[0]
}

/// The maximum near a point where the curvature is about known, over the free coordinates: Newton's
/// steps, damped where the value falls (Levenberg, 1944), the curvature updated from the gradients.
pub fn newton<const N: usize>(
    f: impl Fn(&[f64; N]) -> f64,
    start: [f64; N],
    curvature: &SMatrix<f64, N, N>,
    free: [bool; N],
    tolerance: f64,
) -> ([f64; N], f64) {
    let f = |at: &SVector<f64, N>| f(&at.data.0[0]);
    let gradient = |at: &SVector<f64, N>, value: f64, curvature: &SMatrix<f64, N, N>| {
        SVector::<f64, N>::from_fn(|axis, _| {
            if !free[axis] {
                return 0.0;
            }
            let mut next = *at;
            next[axis] += GRADIENT_STEP;
            (f(&next) - value) / GRADIENT_STEP - 0.5 * GRADIENT_STEP * curvature[(axis, axis)]
        })
    };
    let mut curvature = SMatrix::from_fn(|i, j| {
        if free[i] && free[j] {
            curvature[(i, j)]
        } else {
            0.0
        }
    });
    let mut at = SVector::from(start);
    let mut value = f(&at);
    let mut slope = gradient(&at, value, &curvature);
    let mut damping = DAMPING;
    for _ in 0..MAX_STEPS {
        let Some(factor) = (SMatrix::identity() * damping - curvature).cholesky() else {
            damping *= 10.0;
            continue;
        };
        let step = factor.solve(&slope);
        let step = step / step.amax().max(1.0);
        if slope.dot(&step) < 2.0 * tolerance {
            break;
        }
        let next = at + step;
        let newton = f(&next);
        if newton <= value {
            damping *= 10.0;
            continue;
        }
        let there = gradient(&next, newton, &curvature);
        // Symmetric rank-one update of the curvature.
        let off = there - slope - curvature * step;
        let along = off.dot(&step);
        if along.abs() > 1e-3 * off.norm() * step.norm() {
            curvature += off * off.transpose() / along;
        }
        (at, value, slope) = (next, newton, there);
        damping = (0.1 * damping).max(LEAST_DAMPING);
    }
    (at.into(), value)
}

/// Second derivatives of a function at a point, by central differences.
pub fn curvature<const N: usize>(
    f: impl Fn(&[f64; N]) -> f64,
    at: [f64; N],
    step: f64,
) -> SMatrix<f64, N, N> {
    let shifted = |is_random: &[(usize, f64)]| {
        let mut point = at;
        for (coordinate, by) in is_random {
            point[*coordinate] += by * step;
        }
        f(&point)
    };
    let centre = f(&at);
    let mut second = SMatrix::zeros();
    for i in 0..N {
        second[(i, i)] = shifted(&[(i, 1.0)]) - 2.0 * centre + shifted(&[(i, -1.0)]);
        for j in 0..i {
            let cross = |a: f64, b: f64| shifted(&[(i, a), (j, b)]);
            second[(i, j)] =
                0.25 * (cross(1.0, 1.0) - cross(1.0, -1.0) - cross(-1.0, 1.0) + cross(-1.0, -1.0));
            second[(j, i)] = second[(i, j)];
        }
    }
    second / (step * step)
}

/// Where a falling function crosses zero between two points.
pub fn bisection(f: impl Fn(f64) -> f64, mut above: f64, mut below: f64, steps: u32) -> f64 {
    for _ in 0..steps {
        let middle = 0.5 * (above + below);
        if f(middle) > 0.0 {
            above = middle;
        } else {
            below = middle;
        }
    }
    0.5 * (above + below)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_top_of_a_curved_ridge() {
        // Rosenbrock's valley upside down: the top is 0 at (1, 1).
        let f = |x: &[f64; 2]| -(1.0 - x[0]).powi(2) - 100.0 * (x[1] - x[0] * x[0]).powi(2);
        let (at, value) = nelder_mead(f, [-1.2, 1.0], [0.5, 0.5], 1e-12);
        assert!(value > -1e-9 && (at[0] - 1.0).abs() < 1e-3, "{at:?}");
        // From near by, along the valley and across it.
        let near = curvature(f, [0.9, 0.8], 1e-3);
        let (at, value) = newton(f, [0.9, 0.8], &near, [true; 2], 1e-6);
        assert!(value > -0.01, "{at:?}");
        let (at, value) = newton(f, [0.9, 0.8], &near, [false, true], 1e-6);
        assert!(value > -0.0101 && (at[0] - 0.9).abs() < 1e-12, "{at:?}");
        let second = curvature(f, [1.0, 1.0], 1e-3);
        let expected = [[-802.0, 400.0], [400.0, -200.0]];
        for (i, row) in expected.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                assert!((second[(i, j)] - value).abs() < 0.01, "{second}");
            }
        }
    }
}
