//! (7) to (11) against an exactly quasi-steady motion.
#![allow(
    clippy::cast_precision_loss,
    clippy::disallowed_methods,
    clippy::indexing_slicing
)]

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use proptest::prelude::*;

use super::{G, azimuth, latency, level_accels, level_gyros, vertical};
use crate::least_squares::LeastSquares;

proptest! {
    /// (8) solved for any biases, headings and number of turns.
    #[test]
    fn turns_observe_the_level_accelerometers(
        bias in [-0.1_f64..0.1, -0.1..0.1],
        headings in prop::collection::vec(0.0..TAU, 3..8),
    ) {
        let bias = Vector2::from(bias);
        let observability: f64 = headings.windows(2).map(|h| 2.0 - 2.0 * (h[1] - h[0]).cos()).sum();
        prop_assume!(observability > 0.1);
        let mut rows = weak_prior();
        for pair in headings.windows(2) {
            add_turn(&mut rows, pair[0], pair[1], &bias);
        }
        // Single precision over the observability.
        prop_assert!((rows.solve().cast() - bias).norm() < 1e-5);
        // The information of each bias is that of (8).
        prop_assert!((f64::from(rows.variance(0)) * observability - 1.0).abs() < 1e-4);
    }
}

fn weak_prior() -> LeastSquares<2, 3> {
    LeastSquares::from_prior(&Vector2::repeat(1e6))
}

/// `C_B^L` of a level vehicle: right is (cos H, -sin H), forward (sin H, cos H).
fn level(heading_rad: f64) -> Matrix3<f64> {
    let (s, c) = heading_rad.sin_cos();
    Matrix3::new(c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0)
}

/// Rotation by the controls in the quasi-steady state, (6): they hold `g Phi_N = df_E` and
/// `g Phi_E = -df_N`, so they follow a change of `C df`.
fn add_turn(rows: &mut LeastSquares<2, 3>, from_rad: f64, to_rad: f64, bias: &Vector2<f64>) {
    let change: Matrix2<f64> = (level(to_rad) - level(from_rad))
        .fixed_view::<2, 2>(0, 0)
        .into();
    let change_enu = change * bias;
    let controls_rad = Vector2::new(-change_enu.y, change_enu.x) / G;
    let _ = level_accels(rows, &change, &controls_rad, &Vector2::zeros());
}

#[test]
fn a_full_turn_observes_no_accelerometer() {
    let bias = Vector2::new(0.02, -0.01);
    for (turn, sigma) in [(PI, 0.5), (FRAC_PI_2, FRAC_PI_2.sin() / 2.0_f64.sqrt())] {
        let mut rows = weak_prior();
        add_turn(&mut rows, 0.3, 0.3 + turn, &bias);
        let found = f64::from(rows.variance(0)).sqrt();
        assert!((found - sigma).abs() < 1e-5, "{turn}");
        assert!((rows.solve().cast() - bias).norm() < 1e-6);
    }
    let mut rows = weak_prior();
    add_turn(&mut rows, 0.3, 0.3 + TAU, &bias);
    // Value and sigma remain those of the prior.
    assert!((f64::from(rows.variance(0)).sqrt() / 1e6 - 1.0).abs() < 1e-6);
    assert!(rows.solve().norm() < 1e-6);
}

#[test]
fn compensated_bias_is_added() {
    let (bias, known) = (Vector2::new(0.02, -0.01), Vector2::new(0.015, 0.003));
    let mut rows = weak_prior();
    let change: Matrix2<f64> = (level(2.0) - level(0.0)).fixed_view::<2, 2>(0, 0).into();
    // The controls show only the residual bias.
    let residual = change * (bias - known);
    let controls_rad = Vector2::new(-residual.y, residual.x) / G;
    let misfit = level_accels(&mut rows, &change, &controls_rad, &known);
    // Two rows for two unknowns leave no residual.
    assert!(misfit < 1e-9);
    assert!((rows.solve().cast() - bias).norm() < 1e-6);
}

/// Numerical integration of the loops of (1) with their controls: the input of (7), (9), (11).
struct Loop {
    velocity: Vector2<f64>,
    tilt: Vector2<f64>,
    controls_rad: Vector2<f64>,
}

const K1: f64 = 2.0 * 0.7 * 0.5;
const K2: f64 = 0.25 / G;

impl Loop {
    fn new() -> Self {
        Self {
            velocity: Vector2::zeros(),
            tilt: Vector2::zeros(),
            controls_rad: Vector2::zeros(),
        }
    }

    /// `tilt` is `(Phi_E, Phi_N)`; (1) without 1/R, as in (6).
    fn run(&mut self, seconds: u32, accel: &Vector2<f64>, azimuth_rad: f64, drift: &Vector2<f64>) {
        let dt = 1e-3;
        for _ in 0..1000 * seconds {
            let dv = self.velocity;
            let control = Vector2::new(-K2 * dv.y, K2 * dv.x);
            let accel_error = Vector2::new(
                -G * self.tilt.y + accel.y * azimuth_rad,
                G * self.tilt.x - accel.x * azimuth_rad,
            );
            self.velocity += dt * (accel_error - K1 * dv);
            self.tilt += dt * (control - drift);
            self.controls_rad += dt * control;
        }
    }
}

#[test]
fn a_long_acceleration_observes_the_azimuth() {
    // 30 s are 15 / w0: the loop has settled to exp(-0.7 * 15), 3e-5.
    let (phi, accel) = (0.02, Vector2::new(1.2, -0.8));
    let mut loops = Loop::new();
    loops.run(30, &accel, phi, &Vector2::zeros());
    let (numerator, denominator) = azimuth(&accel, &loops.controls_rad);
    assert!(
        (numerator / denominator - phi).abs() < 1e-4 * phi,
        "{}",
        numerator / denominator
    );
    assert!((denominator - accel.norm_squared()).abs() < 1e-12);
}

#[test]
fn settled_controls_observe_the_gyros_at_any_heading() {
    for heading_rad in [0.0, 1.0, -2.5] {
        let bias = Vector3::new(3e-6, -5e-6, 0.0);
        let c = level(heading_rad);
        let mut loops = Loop::new();
        loops.run(40, &Vector2::zeros(), 0.0, &(c * bias).xy());
        let before = loops.controls_rad;
        loops.run(20, &Vector2::zeros(), 0.0, &(c * bias).xy());
        let mean = (loops.controls_rad - before) / 20.0;
        let found = level_gyros(&c, &mean.push(0.0));
        // (9) as printed.
        let (s, co) = heading_rad.sin_cos();
        let printed = Vector2::new(mean.x * co - mean.y * s, mean.x * s + mean.y * co);
        assert!((found - printed).norm() < 1e-20);
        assert!((found - bias.xy()).norm() < 1e-3 * bias.norm(), "{found}");
    }
}

#[test]
fn latency_from_differences() {
    // (5): the difference is a tau; any accelerations add up.
    let (tau, mut numerator, mut denominator) = (-0.07, 0.0, 0.0);
    for accel in [
        Vector2::new(2.0, 0.5),
        Vector2::new(-1.0, 1.5),
        Vector2::new(0.1, -0.2),
    ] {
        let (t, b) = latency(&accel, &(accel * tau));
        numerator += t;
        denominator += b;
    }
    assert!((numerator / denominator - tau).abs() < 1e-15);
    assert_eq!(vertical(-0.03, 2e-6), (0.03, 2e-6));
}
