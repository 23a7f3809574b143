//! The error of the INS over a span, against exact rotations of the platform.

use ins_core::estimators::ins_error::{Forcing, InsError, Passage};
use ins_core::estimators::parameters::{Parameters, index};
use ins_core::history::Span;
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
        attitude_s: Matrix3::identity(),
        turn_rad: 0.0,
        control_tilt_rad,
        control_velocity_mps: Vector3::zeros(),
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
        ..InsError::zero()
    }
}

/// `C' = exp(-Phi) C`: a turn of the platform by `turn` comes from the left.
fn rotated(phi: &Vector3<f64>, turn: &Vector3<f64>) -> Vector3<f64> {
    (UnitQuaternion::new(*phi) * UnitQuaternion::new(*turn)).scaled_axis()
}

proptest! {
    /// By controls or by gyros, in level or in azimuth; and so does the response to an azimuth.
    #[test]
    fn a_tilted_platform_turns_as_rotations_do(
        phi in vector(LARGEST_RAD),
        controls in vector(LARGEST_RAD / 2.0),
        drift in vector(LARGEST_RAD / 2.0),
    ) {
        let span = span(Vector3::zeros(), controls);
        let forcing = Forcing::over(&span, &with_gyro_bias(&-drift));
        let passage = Passage::over(&span, &Vector3::zeros(), &forcing);
        let after = tilted(phi).after(&passage, &forcing).tilt_rad;
        let exact = rotated(&phi, &(controls + drift));
        prop_assert!((after - exact).norm() < THIRD_ORDER_RAD, "{after} {exact}");

        let azimuth = Vector3::z() * 1e-4;
        let mut response = tilted(azimuth);
        response.carry(&passage);
        let exact = rotated(&(phi + azimuth), &(controls + drift)) - exact;
        // The derivative of the third order: 3 * 0.17^2 / 6.
        let off = (response.tilt_rad - exact).norm() / 1e-4;
        prop_assert!(off < 0.015, "{off}");
    }

    /// What a tilted platform makes of a force is the force of the true one, turned.
    #[test]
    fn a_tilted_platform_feels_the_force_turned(
        phi in vector(LARGEST_RAD),
        force in vector(10.0),
    ) {
        let span = span(force, Vector3::zeros());
        let forcing = Forcing::over(&span, &with_gyro_bias(&Vector3::zeros()));
        let passage = Passage::over(&span, &Vector3::zeros(), &forcing);
        let after = tilted(phi).after(&passage, &forcing).velocity_mps;
        let exact = force - UnitQuaternion::new(phi) * force;
        prop_assert!((after - exact).norm() < THIRD_ORDER_RAD * force.norm(), "{after} {exact}");
    }
}
