//! The error of the INS over a span, against exact rotations of the platform and against (1)-(2)
//! integrated finely.
#![allow(clippy::cast_precision_loss)]
#![allow(clippy::disallowed_methods)] // Reference values.

use crate::earth::GRAVITY_EQUATOR_MPS2;
use crate::error_model::{Forcing, InsError, SCHULER_PER_S2, Transition, VERTICAL_PER_S2};
use crate::history::Span;
use crate::parameters::{COUNT, Parameters, index};
use nalgebra::{Matrix3, SVector, UnitQuaternion, Vector3};
use proptest::prelude::*;

/// Of an INS whose heading is still to be found, and of its damping controls.
const LARGEST_RAD: f64 = 0.1;
/// Third order of vectors of up to 0.17 rad: the two double commutators of Baker, Campbell and
/// Hausdorff, each up to 0.17^3 / 12, and the cube that a force leaves out, 0.17^3 / 6.
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

/// What turns `C'` into `C`: the platform is levelled, then turned about the vertical.
fn off(phi: &Vector3<f64>) -> UnitQuaternion<f64> {
    let level = Vector3::new(phi.x, phi.y, 0.0);
    UnitQuaternion::new(Vector3::z() * phi.z) * UnitQuaternion::new(level)
}

/// A turn of the platform by `turn` comes from the left of `C'`.
fn rotated(phi: &Vector3<f64>, turn: &Vector3<f64>) -> Vector3<f64> {
    let off = off(phi) * UnitQuaternion::new(*turn);
    let azimuth = Vector3::z() * (2.0 * crate::math::atan2(off.k, off.w));
    (UnitQuaternion::new(-azimuth) * off).scaled_axis() + azimuth
}

proptest! {
    /// By controls or by gyros, in level or in azimuth; and so do the sensitivities to either.
    #[test]
    fn a_tilted_platform_turns_as_rotations_do(
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
            let more = axis * 1e-4;
            let mut sensitivity = tilted(more);
            sensitivity.propagate(&transition);
            let exact = rotated(&(phi + more), &(controls + drift)) - exact;
            // The derivative of the third order: 3 * 0.17^2 / 6.
            let off = (sensitivity.tilt_rad - exact).norm() / 1e-4;
            prop_assert!(off < 0.015, "{off}");
        }
    }

    /// What a platform that is tilted and points elsewhere makes of a force is that of the true one,
    /// turned.
    #[test]
    fn a_tilted_platform_feels_the_force_turned(
        phi in vector(LARGEST_RAD),
        force in vector(10.0),
    ) {
        let span = span(force, Vector3::zeros());
        let forcing = Forcing::over(&span, &Vector3::zeros(), &with_gyro_bias(&Vector3::zeros()), &Vector3::zeros());
        let transition = Transition::over(&span, &Vector3::zeros(), &forcing, &phi);
        let after = tilted(phi).propagated(&span, &transition, &forcing).velocity_mps;
        let exact = force - off(&phi) * force;
        prop_assert!((after - exact).norm() < THIRD_ORDER_RAD * force.norm(), "{after} {exact}");
    }

    /// A bias that has been taken out is none, wherever the platform points.
    #[test]
    fn what_is_taken_out_pushes_no_platform(
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
        let exact = force - off(&phi) * force;
        let off = (after.velocity_mps - exact).norm();
        prop_assert!(off < THIRD_ORDER_RAD * force.norm(), "{off}");
        let off = (after.position_m - 0.5 * exact).norm();
        prop_assert!(off < force.norm() * phi.norm_squared(), "{off}");
    }
}

/// Tilts so small that squares of them are nothing.
const SMALL_RAD: f64 = 1e-4;
/// As long as the observer ever steps at once, s.
const SECONDS: f64 = 0.3;

/// What goes on evenly, and what acts on the INS meanwhile.
#[derive(Clone, Copy, Debug)]
struct Steady {
    force_mps2: Vector3<f64>,
    attitude: Matrix3<f64>,
    frame_radps: Vector3<f64>,
    control_radps: Vector3<f64>,
    control_mps2: Vector3<f64>,
    control_mps: Vector3<f64>,
    level_force_mps2: Vector3<f64>,
    rate_radps: Vector3<f64>,
}

fn steady() -> impl Strategy<Value = Steady> {
    let controls = (vector(SMALL_RAD), vector(0.1), vector(0.1));
    let force = vector(3.0).prop_map(|f| f + Vector3::z() * 9.8);
    let attitude = vector(1.0).prop_map(|v| UnitQuaternion::new(v).to_rotation_matrix().into());
    let body = (vector(1.0), vector(0.3));
    (controls, force, attitude, vector(1e-4), body).prop_map(
        |(controls, force_mps2, attitude, frame_radps, (level, rate_radps))| {
            let (control_radps, control_mps2, control_mps) = controls;
            Steady {
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

impl Steady {
    /// About the vertical.
    fn turn_radps(&self) -> f64 {
        (self.attitude * self.rate_radps).z
    }

    /// Put together of steps of a sample, each by its definition.
    fn span(&self) -> Span {
        let samples = 30;
        let dt = SECONDS / f64::from(samples);
        let (force, tilt) = (self.force_mps2 * dt, self.control_radps * dt);
        let (push, bent) = (self.control_mps2 * dt, force.cross(&tilt));
        let one = Span {
            seconds: dt,
            force_mps: force,
            force_position_m: 0.5 * dt * force,
            attitude_s: self.attitude * dt,
            angle_rad: self.rate_radps * dt,
            turn_rad: self.turn_radps() * dt,
            control_tilt_rad: tilt,
            control_velocity_mps: push + 0.5 * bent,
            control_position_m: dt * (self.control_mps + 0.5 * push + bent / 6.0),
            ..Span::default()
        };
        (0..samples).fold(Span::default(), |span, _| span.then(&one))
    }

    /// (1)-(2) as they stand, in short steps; the attitude is the platform's, which may point elsewhere
    /// than the body.
    fn integrated(&self, start: &InsError, parameters: &Parameters) -> InsError {
        let c = self.attitude;
        let beyond_level = c.tr_mul(&self.force_mps2) - self.level_force_mps2;
        let scaled = parameters
            .vector(index::ACCEL_SCALE)
            .component_mul(&beyond_level);
        let bias = c * (parameters.vector(index::ACCEL) + scaled);
        let up = self.level_force_mps2 / GRAVITY_EQUATOR_MPS2;
        let tipped = self.rate_radps - up * self.turn_radps();
        let turned = up * (parameters.value(index::TURN_SCALE) * self.turn_radps())
            + parameters.vector(index::GYRO_SCALE).component_mul(&tipped);
        let askew = parameters.vector(index::GYRO_MISALIGNMENT).dot(&tipped);
        let drift = self.control_radps
            - c * (parameters.vector(index::GYRO) + turned)
            - Vector3::z() * askew;
        let steps = 3000;
        let dt = SECONDS / f64::from(steps);
        let mut error = *start;
        for _ in 0..steps {
            let phi = error.tilt_rad;
            let phi_rate = drift - self.frame_radps.cross(&phi);
            let push = bias + Vector3::z().cross(&bias) * phi.z + self.control_mps2;
            let gravity = Vector3::new(SCHULER_PER_S2, SCHULER_PER_S2, VERTICAL_PER_S2)
                .component_mul(&error.position_m);
            let accel = self.force_mps2.cross(&(phi + 0.5 * dt * phi_rate)) + push + gravity;
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
    (biases, scales).prop_map(|((gyro, accel), (accel_scale, gyro_scale, askew, turn))| {
        let mut parameters = Parameters {
            value: SVector::<f64, COUNT>::zeros(),
            sigma: SVector::repeat(1.0),
        };
        for (first, values) in [
            (index::GYRO, gyro),
            (index::ACCEL, accel),
            (index::ACCEL_SCALE, accel_scale),
            (index::GYRO_SCALE, gyro_scale),
            (index::GYRO_MISALIGNMENT, askew),
        ] {
            for (axis, value) in values.iter().enumerate() {
                parameters.set(first + axis, *value, 1.0);
            }
        }
        parameters.set(index::TURN_SCALE, turn, 1.0);
        parameters
    })
}

proptest! {
    #[test]
    fn position_and_velocity_grow_as_the_equations_say(
        steady in steady(),
        parameters in any_parameters(),
        (position_m, velocity_mps, tilt_rad) in (vector(100.0), vector(1.0), vector(SMALL_RAD)),
    ) {
        let start = InsError { position_m, velocity_mps, tilt_rad };
        let span = steady.span();
        let forcing = Forcing::over(&span, &steady.level_force_mps2, &parameters, &Vector3::zeros());
        let transition = Transition::over(&span, &steady.frame_radps, &forcing, &tilt_rad);
        let after = start.propagated(&span, &transition, &forcing);
        let exact = steady.integrated(&start, &parameters);
        // Left out: what squares of tilts of 3e-4 and turns of the frame of 3e-5 do to 3 m/s of
        // force, and to half a metre of its way.
        let position = (after.position_m - exact.position_m).norm();
        // And what gravity does to the way within one span, half of which comes with the next.
        let late_m = 0.5 * VERTICAL_PER_S2 * position_m.norm() * SECONDS * SECONDS;
        prop_assert!(position < 3e-7 + late_m, "{position}");
        let velocity = (after.velocity_mps - exact.velocity_mps).norm();
        prop_assert!(velocity < 1e-6, "{velocity}");
        let tilt = (after.tilt_rad - exact.tilt_rad).norm();
        prop_assert!(tilt < 1e-7, "{tilt}");
    }
}

/// Of an INS at rest and level, told nothing for a time.
fn coasts(start: InsError, seconds: f64) -> InsError {
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
    let mut passed_s = 0.0;
    while passed_s < seconds {
        error = error.propagated(&span, &transition, &forcing);
        passed_s += span.seconds;
    }
    error
}

#[test]
fn a_level_error_swings_with_schuler_and_a_vertical_one_runs_away() {
    let tilt_rad = 1e-4;
    let tilted = InsError {
        tilt_rad: Vector3::new(0.0, tilt_rad, 0.0),
        position_m: Vector3::z() * 1000.0,
        ..InsError::default()
    };
    let radius_m = GRAVITY_EQUATOR_MPS2 / -SCHULER_PER_S2;
    for minutes in [10.0, 42.0, 84.0] {
        let seconds = 60.0 * minutes;
        let error = coasts(tilted, seconds);
        // R times the tilt of the true vertical: 1 - cos of Schuler's 84.4 min; steps of a second
        // are 2e-4 of that off.
        let swing = 1.0 - (seconds * (-SCHULER_PER_S2).sqrt()).cos();
        let east_m = -radius_m * tilt_rad * swing;
        let off = (error.position_m.x - east_m).abs() / (radius_m * tilt_rad);
        assert!(
            off < 2e-3,
            "{minutes} min: {} of {east_m} m",
            error.position_m.x
        );
        let grown = (seconds * VERTICAL_PER_S2.sqrt()).exp();
        let up_m = 500.0 * (grown + 1.0 / grown);
        let off = (error.position_m.z / up_m - 1.0).abs();
        assert!(
            off < 5e-3,
            "{minutes} min: {} of {up_m} m",
            error.position_m.z
        );
    }
}
