//! Attitude: rotation from body (right-forward-up) to East-North-Up.

use nalgebra::{Matrix3, Quaternion, Unit, UnitQuaternion, Vector3};

use crate::math;

/// Attitude angles, rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Euler {
    /// Right side down positive.
    pub roll_rad: f64,
    /// Nose up positive.
    pub pitch_rad: f64,
    /// Clockwise from north, in [-pi, pi].
    pub heading_rad: f64,
}

/// Attitude from roll, pitch and heading: first heading, then pitch, then roll.
pub fn from_euler(e: &Euler) -> UnitQuaternion<f64> {
    let about = |x: f64, y: f64, z: f64, angle: f64| {
        let (s, c) = math::sin_cos(0.5 * angle);
        Quaternion::new(c, x * s, y * s, z * s)
    };
    Unit::new_unchecked(
        about(0.0, 0.0, 1.0, -e.heading_rad)
            * about(1.0, 0.0, 0.0, e.pitch_rad)
            * about(0.0, 1.0, 0.0, e.roll_rad),
    )
}

/// Roll, pitch and heading of an attitude. At 90 degrees of pitch heading takes all the rotation.
pub fn euler(attitude: &UnitQuaternion<f64>) -> Euler {
    let c = matrix(attitude);
    let horizontal = math::sqrt(c.m12 * c.m12 + c.m22 * c.m22);
    Euler {
        roll_rad: math::atan2(-c.m31, c.m33),
        pitch_rad: math::atan2(c.m32, horizontal),
        heading_rad: math::atan2(c.m12, c.m22),
    }
}

/// The vertical, upward, in the body.
pub fn up(attitude: &UnitQuaternion<f64>) -> Vector3<f64> {
    matrix(attitude).row(2).transpose()
}

/// Direction cosine matrix `C_B^L` of an attitude.
pub fn matrix(attitude: &UnitQuaternion<f64>) -> Matrix3<f64> {
    let q = attitude.as_ref();
    let (w, x, y, z) = (q.w, q.i, q.j, q.k);
    Matrix3::new(
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )
}

/// The same attitude with `by_rad` added to its heading, an angle of any size.
pub fn turned(attitude: &UnitQuaternion<f64>, by_rad: f64) -> UnitQuaternion<f64> {
    let turn = from_euler(&Euler {
        heading_rad: by_rad,
        ..Euler::default()
    });
    renormalized(turn.as_ref() * attitude.as_ref())
}

/// The rotation by a vector, as a quaternion.
///
/// Up to 0.2 rad by Taylor series to the sixth power, with an error below 1e-12.
pub(crate) fn small_rotation(v: &Vector3<f64>) -> Quaternion<f64> {
    let h2 = 0.25 * v.norm_squared();
    if h2 > 0.01 {
        let half = math::sqrt(h2);
        let (sin, cos) = math::sin_cos(half);
        let sinc = 0.5 * sin / half;
        return Quaternion::new(cos, sinc * v.x, sinc * v.y, sinc * v.z);
    }
    let sinc = 0.5 * (1.0 - h2 * (1.0 / 6.0 - h2 * (1.0 / 120.0 - h2 / 5040.0)));
    let cos = 1.0 - h2 * (0.5 - h2 * (1.0 / 24.0 - h2 / 720.0));
    Quaternion::new(cos, sinc * v.x, sinc * v.y, sinc * v.z)
}

/// One Newton step towards unit length: exact to second order, enough at every update.
pub(crate) fn renormalized(q: Quaternion<f64>) -> UnitQuaternion<f64> {
    let n2 = q.w * q.w + q.i * q.i + q.j * q.j + q.k * q.k;
    Unit::new_unchecked(q * (1.5 - 0.5 * n2))
}
