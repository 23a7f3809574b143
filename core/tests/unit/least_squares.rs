//! Square-root information filter against dense covariance algebra.
#![allow(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::indexing_slicing,
    // Bits are compared.
    clippy::float_cmp
)]

use nalgebra::{Matrix4, Vector2, Vector4};
use proptest::prelude::*;

use super::LeastSquares;

/// The same estimate as mean and covariance, by the textbook formulas.
#[derive(Clone, Copy, Debug)]
struct Gaussian {
    mean: Vector4<f64>,
    covariance: Matrix4<f64>,
}

impl Gaussian {
    fn measure(&mut self, row: &Vector4<f64>, measured: f64, variance: f64) {
        let gain = self.covariance * row / (row.dot(&(self.covariance * row)) + variance);
        self.mean += gain * (measured - row.dot(&self.mean));
        let i_minus_kh = Matrix4::identity() - gain * row.transpose();
        self.covariance = i_minus_kh * self.covariance * i_minus_kh.transpose()
            + gain * variance * gain.transpose();
    }

    fn redefine(&mut self, index: usize, others: &Vector4<f64>) {
        let mut transformation = Matrix4::identity();
        for k in 0..4 {
            transformation[(index, k)] += others[k];
        }
        self.mean = transformation * self.mean;
        self.covariance = transformation * self.covariance * transformation.transpose();
    }
}

#[derive(Clone, Debug)]
enum Operation {
    Measure([Vector4<f64>; 2], [f64; 2], [f64; 2]),
    Direct(usize, f64, f64),
    Diffuse(usize, f64),
    Redefine(usize, Vector4<f64>),
    ZeroSolution,
}

fn step() -> impl Strategy<Value = Operation> {
    let number = || -3.0_f64..3.0;
    let four = || [number(), number(), number(), number()].prop_map(Vector4::from);
    let variance = || 0.05_f64..5.0;
    prop_oneof![
        6 => ([four(), four()], [number(), number()], [variance(), variance()])
            .prop_map(|(r, m, v)| Operation::Measure(r, m, v)),
        1 => (0..4_usize, number(), variance()).prop_map(|(i, m, v)| Operation::Direct(i, m, v)),
        2 => (0..4_usize, variance()).prop_map(|(i, v)| Operation::Diffuse(i, v)),
        2 => (0..4_usize, four()).prop_map(|(i, c)| Operation::Redefine(i, c)),
        1 => Just(Operation::ZeroSolution),
    ]
}

proptest! {
    /// For any sequence of operations.
    #[test]
    fn least_squares_matches_the_covariance_form(
        steps in prop::collection::vec(step(), 1..60),
        asked in [-3.0_f64..3.0, -3.0..3.0, -3.0..3.0, -3.0..3.0],
    ) {
        let sigma = Vector4::new(1.0, 2.0, 0.5, 3.0);
        let mut rows = LeastSquares::<4, 10>::from_prior(&sigma.cast());
        let covariance = Matrix4::from_diagonal(&sigma.component_mul(&sigma));
        let mut gaussian = Gaussian { mean: Vector4::zeros(), covariance };
        for step in steps {
            match step {
                Operation::Measure([a, b], measured, variance) => {
                    let single = |x: f64| x as f32;
                    let mut both = core::array::from_fn(|k| [single(a[k]), single(b[k])]);
                    rows.add(&mut both, measured.map(single), variance.map(|v| single(1.0 / v)));
                    gaussian.measure(&a, measured[0], variance[0]);
                    gaussian.measure(&b, measured[1], variance[1]);
                }
                Operation::Direct(index, measured, variance) => {
                    rows.add_direct(index, [measured as f32], [variance as f32]);
                    gaussian.measure(&Vector4::ith(index, 1.0), measured, variance);
                }
                Operation::Diffuse(index, variance) => {
                    let step = rows.diffuse(index, variance as f32).unwrap();
                    let before = gaussian.covariance;
                    gaussian.covariance[(index, index)] += variance;
                    // Estimated step, from the parameters after it.
                    let expected_step = variance * gaussian.covariance.try_inverse().unwrap().column(index);
                    let remaining = variance * (1.0 - expected_step[index]);
                    let condition = before.norm() * before.try_inverse().unwrap().norm();
                    let rounding = 3e-5 * condition.sqrt().max(10.0);
                    prop_assume!(rounding < 0.05);
                    let error = step.by.map(f64::from) + expected_step;
                    prop_assert!(error.norm() < rounding * expected_step.norm().max(1.0), "{error} of {expected_step}");
                    let variance_error = f64::from(step.variance) / remaining - 1.0;
                    prop_assert!(variance_error.abs() < rounding, "{variance_error}");
                    let z = -expected_step.dot(&gaussian.mean);
                    let size = expected_step.norm().max(1.0) * gaussian.mean.norm().max(1.0);
                    prop_assert!((f64::from(step.z) - z).abs() < rounding * size, "{z}");
                }
                Operation::Redefine(index, mut later) => {
                    later.rows_mut(0, index + 1).fill(0.0);
                    rows.redefine(index, &later.cast());
                    gaussian.redefine(index, &later);
                }
                Operation::ZeroSolution => {
                    rows.zero_solution();
                    gaussian.mean = Vector4::zeros();
                }
            }
        }
        // Repeated redefinitions are ill-conditioned: rounding times the root of the condition number.
        let condition = gaussian.covariance.norm() * gaussian.covariance.try_inverse().unwrap().norm();
        let rounding = 3e-5 * condition.sqrt().max(10.0);
        prop_assume!(rounding < 0.05);
        let solved = rows.solve();
        let size = gaussian.covariance.norm().sqrt() + gaussian.mean.norm();
        for k in 0..4 {
            prop_assert!((f64::from(solved[k]) - gaussian.mean[k]).abs() < rounding * size);
            let expected = gaussian.covariance[(k, k)];
            prop_assert!((f64::from(rows.variance(k)) / expected - 1.0).abs() < rounding);
            let regression = rows.regression_on(k).map(f64::from);
            let difference = regression - gaussian.covariance.column(k) / expected;
            prop_assert!(difference.norm() < rounding * gaussian.covariance.norm() / expected);
        }
        let asked = Vector4::from(asked);
        let variance = f64::from(rows.variance_of(asked.cast().into()));
        let expected = asked.dot(&(gaussian.covariance * asked));
        prop_assert!((variance - expected).abs() < rounding * gaussian.covariance.norm() * asked.norm_squared());
    }

    /// The sum of what rows add is the sum of squared residuals of the solution.
    #[test]
    fn squared_residuals_are_summed(
        rows in prop::collection::vec(([-3.0_f32..3.0, -3.0..3.0], -3.0_f32..3.0), 1..20),
    ) {
        let sigma = Vector2::new(1.0, 2.0);
        let mut squares = LeastSquares::<2, 3>::from_prior(&sigma);
        let mut misfit = 0.0;
        for ([a, b], measured) in &rows {
            misfit += squares.add(&mut [[*a], [*b]], [*measured], [1.0]).square;
        }
        let x = squares.solve();
        let residuals = rows.iter().map(|([a, b], m)| (a * x.x + b * x.y - m).powi(2)).sum::<f32>();
        let expected = residuals + x.x * x.x + x.y * x.y / 4.0;
        prop_assert!((misfit - expected).abs() < 1e-4 * (1.0 + expected));
    }

    #[test]
    fn parameters_known_exactly_change_no_bit_of_the_others(
        rows in prop::collection::vec(([-3.0_f32..3.0, -3.0..3.0, -3.0..3.0, -3.0..3.0], -3.0_f32..3.0), 1..20),
    ) {
        let mut few = LeastSquares::<2, 3>::from_prior(&Vector2::new(1.0, 2.0));
        let mut many = LeastSquares::<4, 10>::from_prior(&Vector4::new(1.0, 2.0, 0.0, 0.0));
        for ([a, b, c, d], measured) in rows {
            let of_few = few.add(&mut [[a], [b]], [measured], [1.0]);
            prop_assert_eq!(many.add(&mut [[a], [b], [c], [d]], [measured], [1.0]), of_few);
            let (of_few, of_many) = (few.diffuse(1, 0.1).unwrap(), many.diffuse(1, 0.1).unwrap());
            prop_assert_eq!(of_many.by, of_few.by.push(0.0).push(0.0));
            few.redefine(0, &Vector2::new(0.0, c));
            many.redefine(0, &Vector4::new(0.0, c, d, a));
            prop_assert_eq!(many.solve(), few.solve().push(0.0).push(0.0));
            prop_assert_eq!(many.variance_of([a, b, c, d]), few.variance_of([a, b]));
        }
        let before = many;
        many.diffuse(2, 1.0);
        many.redefine(2, &Vector4::repeat(1.0));
        many.add_direct(3, [1.0], [1.0]);
        prop_assert_eq!(many, before);
    }
}

#[test]
fn an_invalid_index_changes_nothing() {
    let before = LeastSquares::<2, 3>::from_prior(&Vector2::repeat(1.0));
    let mut after = before;
    after.add_direct(2, [1.0], [1.0]);
    after.diffuse(2, 1.0);
    // Nor does a walk whose inverse overflows.
    after.diffuse(0, 1e-40);
    after.redefine(2, &Vector2::zeros());
    assert_eq!(after, before);
    assert_eq!(before.regression_on(2), Vector2::zeros());
}
