//! INS error over a span, against exact rotations of the platform and numerical integration of (1)-(2).
#![allow(clippy::cast_precision_loss)]
#![allow(clippy::disallowed_methods)] // Reference values.

use crate::earth::GRAVITY_EQUATOR_MPS2;
use crate::error_model::{Forcing, InsError, SCHULER_PER_S2, Transition, VERTICAL_PER_S2};
use crate::history::Span;
use crate::parameters::{COUNT, Parameters, index};
use nalgebra::{Matrix3, SVector, UnitQuaternion, Vector3};
use proptest::prelude::*;

/// Tilts before alignment is complete, and damping controls.
const LARGEST_RAD: f64 = 0.1;
/// Third-order terms for rotation vectors up to 0.17 rad: the double commutators of Baker, Campbell and
/// Hausdorff, each up to 0.17^3 / 12, and the omitted cube in the force, 0.17^3 / 6.
const THIRD_ORDER_RAD: f64 = 1e-3;

fn vector(largest: f64) -> impl Strategy<Value = Vector3<f64>> {
    let number = || -largest..largest;
    (number(), number(), number()).prop_map(|(x, y, z)| Vector3::new(x, y, z))
}

/// A second on a level body.
fn span(force_mps: Vector3<f64>, control_tilt_rad: Vector3<f64>) -> Span {
    Span {
        seconds: 1.0,
        force_mps,
        force_position_m: 0.5 * force_mps,
        attitude_s: Matrix3::identity(),
        control_tilt_rad,
        ..Span::default()
    }
}

fn with_gyro_bias(bias_radps: &Vector3<f64>) -> Parameters {
    let mut parameters = Parameters {
        value: SVector::zeros(),
        sigma: SVector::repeat(1.0),
    };
    for (axis, bias) in bias_radps.iter().enumerate() {
        parameters.set(index::GYRO + axis, *bias, 1.0);
    }
    parameters
}

fn tilted(tilt_rad: Vector3<f64>) -> InsError {
    InsError {
        tilt_rad,
        ..InsError::default()
    }
}

/// Rotation from `C'` to `C`: the platform is levelled, then rotated about the vertical.
fn misalignment(phi: &Vector3<f64>) -> UnitQuaternion<f64> {
    let level = Vector3::new(phi.x, phi.y, 0.0);
    UnitQuaternion::new(Vector3::z() * phi.z) * UnitQuaternion::new(level)
}

/// A rotation of the platform by `turn` is applied to `C'` from the left.
fn rotated(phi: &Vector3<f64>, turn: &Vector3<f64>) -> Vector3<f64> {
    let error = misalignment(phi) * UnitQuaternion::new(*turn);
    let azimuth = Vector3::z() * (2.0 * crate::math::atan2(error.k, error.w));
    (UnitQuaternion::new(-azimuth) * error).scaled_axis() + azimuth
}

proptest! {
    /// By controls or gyros, in level or azimuth; likewise the sensitivities.
    #[test]
    fn tilt_propagation_matches_exact_rotations(
        phi in vector(LARGEST_RAD),
        controls in vector(LARGEST_RAD / 2.0),
        drift in vector(LARGEST_RAD / 2.0),
    ) {
        let span = span(Vector3::zeros(), controls);
        let forcing = Forcing::over(&span, &Vector3::zeros(), &with_gyro_bias(&-drift), &Vector3::zeros());
        let transition = Transition::over(&span, &Vector3::zeros(), &forcing, &phi);
        let after = tilted(phi).propagated(&span, &transition, &forcing).tilt_rad;
        let exact = rotated(&phi, &(controls + drift));
        prop_assert!((after - exact).norm() < THIRD_ORDER_RAD, "{after} {exact}");

        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            let increment = axis * 1e-4;
            let mut sensitivity = tilted(increment);
            sensitivity.propagate(&transition);
            let exact = rotated(&(phi + increment), &(controls + drift)) - exact;
            // Derivative of the third-order terms: 3 * 0.17^2 / 6.
            let error = (sensitivity.tilt_rad - exact).norm() / 1e-4;
            prop_assert!(error < 0.015, "{error}");
        }
    }

    #[test]
    fn velocity_error_of_a_tilted_platform_matches_the_rotated_force(
        phi in vector(LARGEST_RAD),
        force in vector(10.0),
    ) {
        let span = span(force, Vector3::zeros());
        let forcing = Forcing::over(&span, &Vector3::zeros(), &with_gyro_bias(&Vector3::zeros()), &Vector3::zeros());
        let transition = Transition::over(&span, &Vector3::zeros(), &forcing, &phi);
        let after = tilted(phi).propagated(&span, &transition, &forcing).velocity_mps;
        let exact = force - misalignment(&phi) * force;
        prop_assert!((after - exact).norm() < THIRD_ORDER_RAD * force.norm(), "{after} {exact}");
    }

    /// At any misalignment.
    #[test]
    fn a_compensated_bias_causes_no_error(
        phi in vector(LARGEST_RAD),
        (force, bias) in (vector(10.0), vector(0.3)),
    ) {
        let mut parameters = with_gyro_bias(&Vector3::zeros());
        for (axis, bias) in bias.iter().enumerate() {
            parameters.set(index::ACCEL + axis, *bias, 1.0);
        }
        let span = Span {
            control_velocity_mps: -bias,
            control_position_m: -0.5 * bias,
            ..span(force, Vector3::zeros())
        };
        let forcing = Forcing::over(&span, &Vector3::zeros(), &parameters, &bias);
        let transition = Transition::over(&span, &Vector3::zeros(), &forcing, &phi);
        let after = tilted(phi).propagated(&span, &transition, &forcing);
        let exact = force - misalignment(&phi) * force;
        let error = (after.velocity_mps - exact).norm();
        prop_assert!(error < THIRD_ORDER_RAD * force.norm(), "{error}");
        let error = (after.position_m - 0.5 * exact).norm();
        prop_assert!(error < force.norm() * phi.norm_squared(), "{error}");
    }
}

/// Tilts whose squares are negligible.
const SMALL_RAD: f64 = 1e-4;
/// Longest step of the observer, s.
const SECONDS: f64 = 0.3;

/// Constant force, attitude, rates and controls.
#[derive(Clone, Copy, Debug)]
struct ConstantMotion {
    force_mps2: Vector3<f64>,
    attitude: Matrix3<f64>,
    frame_radps: Vector3<f64>,
    control_radps: Vector3<f64>,
    control_mps2: Vector3<f64>,
    control_mps: Vector3<f64>,
    level_force_mps2: Vector3<f64>,
    rate_radps: Vector3<f64>,
}

fn any_constant_motion() -> impl Strategy<Value = ConstantMotion> {
    let controls = (vector(SMALL_RAD), vector(0.1), vector(0.1));
    let force = vector(3.0).prop_map(|f| f + Vector3::z() * 9.8);
    let attitude = vector(1.0).prop_map(|v| UnitQuaternion::new(v).to_rotation_matrix().into());
    let body = (vector(1.0), vector(0.3));
    (controls, force, attitude, vector(1e-4), body).prop_map(
        |(controls, force_mps2, attitude, frame_radps, (level, rate_radps))| {
            let (control_radps, control_mps2, control_mps) = controls;
            ConstantMotion {
                force_mps2,
                attitude,
                frame_radps,
                control_radps,
                control_mps2,
                control_mps,
                level_force_mps2: level + Vector3::z() * 9.8,
                rate_radps,
            }
        },
    )
}

impl ConstantMotion {
    /// About the vertical.
    fn turn_radps(&self) -> f64 {
        (self.attitude * self.rate_radps).z
    }

    /// Concatenation of single samples.
    fn span(&self) -> Span {
        let samples = 30;
        let dt = SECONDS / f64::from(samples);
        let (force, tilt) = (self.force_mps2 * dt, self.control_radps * dt);
        let (gained, curvature) = (self.control_mps2 * dt, force.cross(&tilt));
        let step = Span {
            seconds: dt,
            force_mps: force,
            force_position_m: 0.5 * dt * force,
            attitude_s: self.attitude * dt,
            angle_rad: self.rate_radps * dt,
            turn_rad: self.turn_radps() * dt,
            control_tilt_rad: tilt,
            control_velocity_mps: gained + 0.5 * curvature,
            control_position_m: dt * (self.control_mps + 0.5 * gained + curvature / 6.0),
            ..Span::default()
        };
        (0..samples).fold(Span::default(), |span, _| span.then(&step))
    }

    /// Integration of (1)-(2) in short steps; the attitude is the platform's, which may be misaligned.
    fn integrated(&self, start: &InsError, parameters: &Parameters) -> InsError {
        let c = self.attitude;
        let force_change = c.tr_mul(&self.force_mps2) - self.level_force_mps2;
        let scaled = parameters
            .vector(index::ACCEL_SCALE)
            .component_mul(&force_change);
        let bias = c * (parameters.vector(index::ACCEL) + scaled);
        let up = self.level_force_mps2 / GRAVITY_EQUATOR_MPS2;
        let non_turn_rate = self.rate_radps - up * self.turn_radps();
        let turn_error = up * (parameters.value(index::TURN_SCALE) * self.turn_radps())
            + parameters
                .vector(index::GYRO_SCALE)
                .component_mul(&non_turn_rate);
        let misalignment_error = parameters
            .vector(index::GYRO_MISALIGNMENT)
            .dot(&non_turn_rate);
        let drift = self.control_radps
            - c * (parameters.vector(index::GYRO) + turn_error)
            - Vector3::z() * misalignment_error;
        let steps = 3000;
        let dt = SECONDS / f64::from(steps);
        let mut error = *start;
        for _ in 0..steps {
            let phi = error.tilt_rad;
            let phi_rate = drift - self.frame_radps.cross(&phi);
            let gained = bias + Vector3::z().cross(&bias) * phi.z + self.control_mps2;
            let gravity = Vector3::new(SCHULER_PER_S2, SCHULER_PER_S2, VERTICAL_PER_S2)
                .component_mul(&error.position_m);
            let accel = self.force_mps2.cross(&(phi + 0.5 * dt * phi_rate)) + gained + gravity;
            error.position_m += dt * (error.velocity_mps + 0.5 * dt * accel + self.control_mps);
            error.velocity_mps += dt * accel;
            error.tilt_rad += dt * phi_rate;
        }
        error
    }
}

fn any_parameters() -> impl Strategy<Value = Parameters> {
    let biases = (vector(SMALL_RAD), vector(0.1));
    let scales = (vector(0.01), vector(1e-3), vector(1e-3), -1e-3..1e-3);
    (biases, scales).prop_map(
        |((gyro, accel), (accel_scale, gyro_scale, misalignment_error, turn))| {
            let mut parameters = Parameters {
                value: SVector::<f64, COUNT>::zeros(),
                sigma: SVector::repeat(1.0),
            };
            for (first, values) in [
                (index::GYRO, gyro),
                (index::ACCEL, accel),
                (index::ACCEL_SCALE, accel_scale),
                (index::GYRO_SCALE, gyro_scale),
                (index::GYRO_MISALIGNMENT, misalignment_error),
            ] {
                for (axis, value) in values.iter().enumerate() {
                    parameters.set(first + axis, *value, 1.0);
                }
            }
            parameters.set(index::TURN_SCALE, turn, 1.0);
            parameters
        },
    )
}

proptest! {
    #[test]
    fn propagation_matches_the_integrated_error_equations(
        motion in any_constant_motion(),
        parameters in any_parameters(),
        (position_m, velocity_mps, tilt_rad) in (vector(100.0), vector(1.0), vector(SMALL_RAD)),
    ) {
        let start = InsError { position_m, velocity_mps, tilt_rad };
        let span = motion.span();
        let forcing = Forcing::over(&span, &motion.level_force_mps2, &parameters, &Vector3::zeros());
        let transition = Transition::over(&span, &motion.frame_radps, &forcing, &tilt_rad);
        let after = start.propagated(&span, &transition, &forcing);
        let exact = motion.integrated(&start, &parameters);
        // Omitted: squares of tilts of 3e-4 and frame rotations of 3e-5, times 3 m/s of force and half a
        // metre of its integral.
        let position = (after.position_m - exact.position_m).norm();
        // And gravity due to the position error within the span, half of which is applied in the next.
        let late_m = 0.5 * VERTICAL_PER_S2 * position_m.norm() * SECONDS * SECONDS;
        prop_assert!(position < 3e-7 + late_m, "{position}");
        let velocity = (after.velocity_mps - exact.velocity_mps).norm();
        prop_assert!(velocity < 1e-6, "{velocity}");
        let tilt = (after.tilt_rad - exact.tilt_rad).norm();
        prop_assert!(tilt < 1e-7, "{tilt}");
    }
}

/// An unaided INS at rest and level.
fn coast(start: InsError, seconds: f64) -> InsError {
    let span = Span {
        seconds: 1.0,
        force_mps: Vector3::z() * GRAVITY_EQUATOR_MPS2,
        force_position_m: Vector3::z() * (0.5 * GRAVITY_EQUATOR_MPS2),
        attitude_s: Matrix3::identity(),
        ..Span::default()
    };
    let none = Parameters::NONE;
    let forcing = Forcing::over(&span, &span.force_mps, &none, &Vector3::zeros());
    let transition = Transition::over(&span, &Vector3::zeros(), &forcing, &start.tilt_rad);
    let mut error = start;
    let mut elapsed_s = 0.0;
    while elapsed_s < seconds {
        error = error.propagated(&span, &transition, &forcing);
        elapsed_s += span.seconds;
    }
    error
}

#[test]
fn level_errors_oscillate_and_vertical_errors_diverge() {
    let tilt_rad = 1e-4;
    let tilted = InsError {
        tilt_rad: Vector3::new(0.0, tilt_rad, 0.0),
        position_m: Vector3::z() * 1000.0,
        ..InsError::default()
    };
    let radius_m = GRAVITY_EQUATOR_MPS2 / -SCHULER_PER_S2;
    for minutes in [10.0, 42.0, 84.0] {
        let seconds = 60.0 * minutes;
        let error = coast(tilted, seconds);
        // R times the tilt times 1 - cos of Schuler's 84.4 min; steps of a second cause errors of 2e-4.
        let position_factor = 1.0 - (seconds * (-SCHULER_PER_S2).sqrt()).cos();
        let east_m = -radius_m * tilt_rad * position_factor;
        let relative_error = (error.position_m.x - east_m).abs() / (radius_m * tilt_rad);
        assert!(
            relative_error < 2e-3,
            "{minutes} min: {} of {east_m} m",
            error.position_m.x
        );
        let exponential = (seconds * VERTICAL_PER_S2.sqrt()).exp();
        let up_m = 500.0 * (exponential + 1.0 / exponential);
        let relative_error = (error.position_m.z / up_m - 1.0).abs();
        assert!(
            relative_error < 5e-3,
            "{minutes} min: {} of {up_m} m",
            error.position_m.z
        );
    }
}
