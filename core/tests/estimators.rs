//! The running least squares against dense algebra, and the literal estimators against an exactly
//! quasi-steady drive.
#![allow(clippy::cast_precision_loss)]
#![allow(
    clippy::cast_possible_truncation,
    clippy::disallowed_methods,
    clippy::unwrap_used,
    clippy::indexing_slicing
)]

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use ins_core::earth::GRAVITY_EQUATOR_MPS2 as G;
use ins_core::least_squares::LeastSquares;
use ins_core::literal::{azimuth, latency, level_accels, level_gyros, vertical};
use nalgebra::{Matrix2, Matrix3, Matrix4, Vector2, Vector3, Vector4};
use proptest::prelude::*;

/// The same knowledge as mean and covariance, by the textbook's formulas.
#[derive(Clone, Copy, Debug)]
struct Gaussian {
    mean: Vector4<f64>,
    covariance: Matrix4<f64>,
}

impl Gaussian {
    fn measure(&mut self, row: &Vector4<f64>, measured: f64, variance: f64) {
        let gain = self.covariance * row / (row.dot(&(self.covariance * row)) + variance);
        self.mean += gain * (measured - row.dot(&self.mean));
        let kept = Matrix4::identity() - gain * row.transpose();
        self.covariance =
            kept * self.covariance * kept.transpose() + gain * variance * gain.transpose();
    }

    fn redefine(&mut self, index: usize, others: &Vector4<f64>) {
        let mut map = Matrix4::identity();
        for k in 0..4 {
            map[(index, k)] += others[k];
        }
        self.mean = map * self.mean;
        self.covariance = map * self.covariance * map.transpose();
    }
}

#[derive(Clone, Debug)]
enum Step {
    Measure([Vector4<f64>; 2], [f64; 2], [f64; 2]),
    Direct(usize, f64, f64),
    Diffuse(usize, f64),
    Redefine(usize, Vector4<f64>),
    CountFromSolution,
}

fn step() -> impl Strategy<Value = Step> {
    let number = || -3.0_f64..3.0;
    let four = || [number(), number(), number(), number()].prop_map(Vector4::from);
    let variance = || 0.05_f64..5.0;
    prop_oneof![
        6 => ([four(), four()], [number(), number()], [variance(), variance()])
            .prop_map(|(r, m, v)| Step::Measure(r, m, v)),
        1 => (0..4_usize, number(), variance()).prop_map(|(i, m, v)| Step::Direct(i, m, v)),
        2 => (0..4_usize, variance()).prop_map(|(i, v)| Step::Diffuse(i, v)),
        2 => (0..4_usize, four()).prop_map(|(i, c)| Step::Redefine(i, c)),
        1 => Just(Step::CountFromSolution),
    ]
}

proptest! {
    /// Whatever is done to it, what it knows is that of the covariance treated alike.
    #[test]
    fn least_squares_is_the_covariance_seen_from_the_other_side(
        steps in prop::collection::vec(step(), 1..60),
        asked in [-3.0_f64..3.0, -3.0..3.0, -3.0..3.0, -3.0..3.0],
    ) {
        let sigma = Vector4::new(1.0, 2.0, 0.5, 3.0);
        let mut rows = LeastSquares::<4, 10>::from_prior(&sigma.cast());
        let covariance = Matrix4::from_diagonal(&sigma.component_mul(&sigma));
        let mut gaussian = Gaussian { mean: Vector4::zeros(), covariance };
        for step in steps {
            match step {
                Step::Measure([a, b], measured, variance) => {
                    let single = |x: f64| x as f32;
                    let mut both = core::array::from_fn(|k| [single(a[k]), single(b[k])]);
                    rows.add(&mut both, measured.map(single), variance.map(|v| single(1.0 / v)));
                    gaussian.measure(&a, measured[0], variance[0]);
                    gaussian.measure(&b, measured[1], variance[1]);
                }
                Step::Direct(index, measured, variance) => {
                    rows.add_direct(index, measured as f32, variance as f32);
                    gaussian.measure(&Vector4::ith(index, 1.0), measured, variance);
                }
                Step::Diffuse(index, variance) => {
                    rows.diffuse(index, variance as f32);
                    gaussian.covariance[(index, index)] += variance;
                }
                Step::Redefine(index, mut later) => {
                    later.rows_mut(0, index + 1).fill(0.0);
                    rows.redefine(index, &later.cast());
                    gaussian.redefine(index, &later);
                }
                Step::CountFromSolution => {
                    rows.count_from_solution();
                    gaussian.mean = Vector4::zeros();
                }
            }
        }
        // Repeated renaming makes both ill-conditioned: rounding times the root of that.
        let condition = gaussian.covariance.norm() * gaussian.covariance.try_inverse().unwrap().norm();
        let rounding = 3e-5 * condition.sqrt().max(10.0);
        prop_assume!(rounding < 0.05);
        let solved = rows.solve();
        let size = gaussian.covariance.norm().sqrt() + gaussian.mean.norm();
        for k in 0..4 {
            prop_assert!((f64::from(solved[k]) - gaussian.mean[k]).abs() < rounding * size);
            let expected = gaussian.covariance[(k, k)];
            prop_assert!((f64::from(rows.variance(k)) / expected - 1.0).abs() < rounding);
        }
        let asked = Vector4::from(asked);
        let variance = f64::from(rows.variance_of(asked.cast().into()));
        let expected = asked.dot(&(gaussian.covariance * asked));
        prop_assert!((variance - expected).abs() < rounding * gaussian.covariance.norm() * asked.norm_squared());
    }

    /// What rows add to the sum of squared residuals is what is left of them in the end.
    #[test]
    fn contradictions_are_counted(
        rows in prop::collection::vec(([-3.0_f32..3.0, -3.0..3.0], -3.0_f32..3.0), 1..20),
    ) {
        let sigma = Vector2::new(1.0, 2.0);
        let mut squares = LeastSquares::<2, 3>::from_prior(&sigma);
        let mut misfit = 0.0;
        for ([a, b], measured) in &rows {
            misfit += squares.add(&mut [[*a], [*b]], [*measured], [1.0]);
        }
        let x = squares.solve();
        let left = rows.iter().map(|([a, b], m)| (a * x.x + b * x.y - m).powi(2)).sum::<f32>();
        let expected = left + x.x * x.x + x.y * x.y / 4.0;
        prop_assert!((misfit - expected).abs() < 1e-4 * (1.0 + expected));
    }

    /// (8) solved for any biases, headings and number of turns.
    #[test]
    fn turns_show_the_level_accelerometers(
        bias in [-0.1_f64..0.1, -0.1..0.1],
        headings in prop::collection::vec(0.0..TAU, 3..8),
    ) {
        let bias = Vector2::from(bias);
        let observability: f64 = headings.windows(2).map(|h| 2.0 - 2.0 * (h[1] - h[0]).cos()).sum();
        prop_assume!(observability > 0.1);
        let mut rows = weak_rows();
        for pair in headings.windows(2) {
            add_turn(&mut rows, pair[0], pair[1], &bias);
        }
        // Single precision over the observability.
        prop_assert!((rows.solve().cast() - bias).norm() < 1e-5);
        // The information of each bias is what (8) says of the turn.
        prop_assert!((f64::from(rows.variance(0)) * observability - 1.0).abs() < 1e-4);
    }
}

fn weak_rows() -> LeastSquares<2, 3> {
    LeastSquares::from_prior(&Vector2::repeat(1e6))
}

/// `C_B^L` of a level vehicle: right is (cos H, -sin H), forward (sin H, cos H).
fn level(heading_rad: f64) -> Matrix3<f64> {
    let (s, c) = heading_rad.sin_cos();
    Matrix3::new(c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0)
}

/// What the controls turn in the quasi-steady state, (6): they hold `g Phi_N = df_E` and
/// `g Phi_E = -df_N`, so over a change of `C df` they turn by that much.
fn add_turn(rows: &mut LeastSquares<2, 3>, from_rad: f64, to_rad: f64, bias: &Vector2<f64>) {
    let change: Matrix2<f64> = (level(to_rad) - level(from_rad))
        .fixed_view::<2, 2>(0, 0)
        .into();
    let change_enu = change * bias;
    let turned = Vector2::new(-change_enu.y, change_enu.x) / G;
    let _ = level_accels(rows, &change, &turned, &Vector2::zeros());
}

#[test]
fn a_full_turn_shows_no_accelerometer() {
    let bias = Vector2::new(0.02, -0.01);
    for (turn, sigma) in [(PI, 0.5), (FRAC_PI_2, FRAC_PI_2.sin() / 2.0_f64.sqrt())] {
        let mut rows = weak_rows();
        add_turn(&mut rows, 0.3, 0.3 + turn, &bias);
        let found = f64::from(rows.variance(0)).sqrt();
        assert!((found - sigma).abs() < 1e-5, "{turn}");
        assert!((rows.solve().cast() - bias).norm() < 1e-6);
    }
    let mut rows = weak_rows();
    add_turn(&mut rows, 0.3, 0.3 + TAU, &bias);
    // Nothing beyond the prior, in value and in spread.
    assert!((f64::from(rows.variance(0)).sqrt() / 1e6 - 1.0).abs() < 1e-6);
    assert!(rows.solve().norm() < 1e-6);
}

#[test]
fn what_is_compensated_comes_on_top() {
    let (bias, known) = (Vector2::new(0.02, -0.01), Vector2::new(0.015, 0.003));
    let mut rows = weak_rows();
    let change: Matrix2<f64> = (level(2.0) - level(0.0)).fixed_view::<2, 2>(0, 0).into();
    // The controls see only what is left.
    let left = change * (bias - known);
    let turned = Vector2::new(-left.y, left.x) / G;
    let misfit = level_accels(&mut rows, &change, &turned, &known);
    // Two rows for two unknowns contradict nothing.
    assert!(misfit < 1e-9);
    assert!((rows.solve().cast() - bias).norm() < 1e-6);
}

/// The loops of (1) with their controls, integrated finely: what (7), (9), (11) read.
struct Loop {
    velocity: Vector2<f64>,
    tilt: Vector2<f64>,
    turned: Vector2<f64>,
}

const K1: f64 = 2.0 * 0.7 * 0.5;
const K2: f64 = 0.25 / G;

impl Loop {
    fn new() -> Self {
        Self {
            velocity: Vector2::zeros(),
            tilt: Vector2::zeros(),
            turned: Vector2::zeros(),
        }
    }

    /// `tilt` is `(Phi_E, Phi_N)`; (1) without 1/R, which (6) neglects too.
    fn run(&mut self, seconds: u32, accel: &Vector2<f64>, azimuth_rad: f64, drift: &Vector2<f64>) {
        let dt = 1e-3;
        for _ in 0..1000 * seconds {
            let dv = self.velocity;
            let control = Vector2::new(-K2 * dv.y, K2 * dv.x);
            let felt = Vector2::new(
                -G * self.tilt.y + accel.y * azimuth_rad,
                G * self.tilt.x - accel.x * azimuth_rad,
            );
            self.velocity += dt * (felt - K1 * dv);
            self.tilt += dt * (control - drift);
            self.turned += dt * control;
        }
    }
}

#[test]
fn a_long_acceleration_shows_the_azimuth() {
    // 30 s are 15 / w0: the loop has settled to exp(-0.7 * 15), 3e-5.
    let (phi, accel) = (0.02, Vector2::new(1.2, -0.8));
    let mut loops = Loop::new();
    loops.run(30, &accel, phi, &Vector2::zeros());
    let (top, bottom) = azimuth(&accel, &loops.turned);
    assert!((top / bottom - phi).abs() < 1e-4 * phi, "{}", top / bottom);
    assert!((bottom - accel.norm_squared()).abs() < 1e-12);
}

#[test]
fn settled_controls_show_the_gyros_at_any_heading() {
    for heading_rad in [0.0, 1.0, -2.5] {
        let bias = Vector3::new(3e-6, -5e-6, 0.0);
        let c = level(heading_rad);
        let mut loops = Loop::new();
        loops.run(40, &Vector2::zeros(), 0.0, &(c * bias).xy());
        let before = loops.turned;
        loops.run(20, &Vector2::zeros(), 0.0, &(c * bias).xy());
        let mean = (loops.turned - before) / 20.0;
        let found = level_gyros(&c, &mean.push(0.0));
        // (9) as printed.
        let (s, co) = heading_rad.sin_cos();
        let printed = Vector2::new(mean.x * co - mean.y * s, mean.x * s + mean.y * co);
        assert!((found - printed).norm() < 1e-20);
        assert!((found - bias.xy()).norm() < 1e-3 * bias.norm(), "{found}");
    }
}

#[test]
fn a_late_fix_shows_its_latency() {
    // (5): the difference is a tau; any accelerations add up.
    let (tau, mut top, mut bottom) = (-0.07, 0.0, 0.0);
    for accel in [
        Vector2::new(2.0, 0.5),
        Vector2::new(-1.0, 1.5),
        Vector2::new(0.1, -0.2),
    ] {
        let (t, b) = latency(&accel, &(accel * tau));
        top += t;
        bottom += b;
    }
    assert!((top / bottom - tau).abs() < 1e-15);
    assert_eq!(vertical(-0.03, 2e-6), (0.03, 2e-6));
}

#[test]
fn an_index_that_does_not_exist_changes_nothing() {
    let before = LeastSquares::<2, 3>::from_prior(&Vector2::repeat(1.0));
    let mut after = before;
    after.add_direct(2, 1.0, 1.0);
    after.diffuse(2, 1.0);
    after.redefine(2, &Vector2::zeros());
    assert_eq!(after, before);
}
