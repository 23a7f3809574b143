//! Transcendental functions, from `libm` on every platform.
//!
//! `f64::sin` and friends call the platform's mathematics library, whose last bits differ; these
//! do not. `core/clippy.toml` forbids the methods.

use nalgebra::Vector3;

pub(crate) use libm::{atan2, fabs as abs, round, sqrt};

/// Sine and cosine of an angle in radians.
pub(crate) fn sin_cos(angle_rad: f64) -> (f64, f64) {
    // `libm::sincos` makes room for the largest angles on the stack of every call.
    (libm::sin(angle_rad), libm::cos(angle_rad))
}

/// The larger of two numbers; `b` if they do not compare (`f64::max` differs on signed zeros).
pub(crate) fn max<T: PartialOrd>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

/// The smaller of two numbers; `b` if they do not compare.
pub(crate) fn min<T: PartialOrd>(a: T, b: T) -> T {
    if a < b { a } else { b }
}

/// A number, clamped to the least and the most.
pub(crate) fn clamp(x: f64, [least, most]: [f64; 2]) -> f64 {
    max(min(x, most), least)
}

/// A ratio of variances, clamped to the squares of these ratios of standard deviations.
pub(crate) fn clamp_variance(ratio: f64, [least, most]: [f64; 2]) -> f64 {
    clamp(ratio, [least * least, most * most])
}

/// Decay after so many time constants, not negative: `exp(-x)` to second order, between 0 and 1 for any of
/// them.
pub(crate) fn decayed(x: f64) -> f64 {
    1.0 / (1.0 + x + 0.5 * x * x)
}

/// Magnitude of the largest component, of which none may be NaN.
pub(crate) fn largest(v: &Vector3<f64>) -> f64 {
    max(max(abs(v.x), abs(v.y)), abs(v.z))
}

/// Whether every component is finite: zero times what is not is NaN.
pub(crate) fn all_finite(v: &Vector3<f64>) -> bool {
    !(0.0 * v.x + 0.0 * v.y + 0.0 * v.z).is_nan()
}

#[inline]
#[allow(clippy::cast_possible_truncation)]
pub(crate) fn single(x: f64) -> f32 {
    x as f32
}

pub(crate) fn singles(v: &Vector3<f64>) -> Vector3<f32> {
    v.map(single)
}
