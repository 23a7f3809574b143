//! Attitude: angles, matrix, and the signs of rotations.
#![allow(clippy::cast_precision_loss)]
#![allow(clippy::disallowed_methods)]

use core::f64::consts::PI;

use ins_core::attitude::{Euler, euler, from_euler, matrix};
use ins_core::earth::{Geodetic, wrap_pi};
use ins_core::mechanization::Mechanization;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use proptest::prelude::*;

fn ins_with(attitude: &Euler) -> Mechanization {
    Mechanization::new(Geodetic::default(), Vector3::zeros(), from_euler(attitude))
}

#[test]
fn axes_of_the_euler_angles() {
    let c = |roll_deg: f64, pitch_deg: f64, heading_deg: f64| {
        matrix(&from_euler(&Euler {
            roll_rad: roll_deg.to_radians(),
            pitch_rad: pitch_deg.to_radians(),
            heading_rad: heading_deg.to_radians(),
        }))
    };
    let assert_near =
        |a: Vector3<f64>, b: [f64; 3]| assert!((a - Vector3::from(b)).norm() < 1e-15, "{a}");
    // Heading east: forward points east, right south.
    assert_near(c(0.0, 0.0, 90.0) * Vector3::y(), [1.0, 0.0, 0.0]);
    assert_near(c(0.0, 0.0, 90.0) * Vector3::x(), [0.0, -1.0, 0.0]);
    // Nose up: forward points up.
    assert_near(c(0.0, 90.0, 0.0) * Vector3::y(), [0.0, 0.0, 1.0]);
    // Right side down: right points down.
    assert_near(c(90.0, 0.0, 0.0) * Vector3::x(), [0.0, 0.0, -1.0]);
}

proptest! {
    #[test]
    fn euler_angles_round_trip(
        roll_rad in -PI..PI,
        pitch_rad in -1.56..1.56_f64,
        heading_rad in -PI..PI,
    ) {
        let angles = Euler { roll_rad, pitch_rad, heading_rad };
        let attitude = from_euler(&angles);
        let back = euler(&attitude);
        // Near the vertical roll and heading are 100 times as sensitive.
        for (a, b) in [
            (back.roll_rad, roll_rad),
            (back.pitch_rad, pitch_rad),
            (back.heading_rad, heading_rad),
        ] {
            prop_assert!(wrap_pi(a - b).abs() < 1e-13);
        }
        let c = matrix(&attitude);
        prop_assert!((c * c.transpose() - Matrix3::identity()).norm() < 1e-14);
        prop_assert!((c.determinant() - 1.0).abs() < 1e-14);
        let same = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(c));
        prop_assert!(same.angle_to(&attitude) < 1e-14);
    }

    #[test]
    fn turn_heading_adds_to_the_heading(
        pitch_rad in -1.0..1.0_f64,
        heading_rad in -PI..PI,
        by_rad in -7.0..7.0_f64,
    ) {
        let angles = Euler { roll_rad: 0.3, pitch_rad, heading_rad };
        let mut ins = ins_with(&angles);
        ins.turn_heading(by_rad);
        let turned = euler(&ins.attitude);
        prop_assert!(wrap_pi(turned.heading_rad - heading_rad - by_rad).abs() < 1e-13);
        prop_assert!((turned.pitch_rad - pitch_rad).abs() < 1e-13);
    }

    /// `C' = (I - [Phi x]) C`, up to the second order of `Phi`.
    #[test]
    fn turn_platform_rotates_by_minus_phi(
        phi in [-1e-4..1e-4_f64, -1e-4..1e-4, -1e-4..1e-4],
        heading_rad in -PI..PI,
    ) {
        let phi = Vector3::from(phi);
        let angles = Euler { roll_rad: -0.2, pitch_rad: 0.4, heading_rad };
        let mut ins = ins_with(&angles);
        let before = matrix(&ins.attitude);
        ins.turn_platform(&phi);
        let expected = (Matrix3::identity() - phi.cross_matrix()) * before;
        prop_assert!((matrix(&ins.attitude) - expected).norm() < 2.0 * phi.norm_squared() + 1e-15);
        prop_assert!((ins.attitude.norm() - 1.0).abs() < 1e-15);
    }
}
