//! Third-order term of a receiver that smooths, which no parameter describes.

use nalgebra::Vector3;

use crate::math;
use crate::parameters::{COUNT, index};

/// Most that is known of an arm, as many fixes' noise over its sigma, 1/s.
const MOST_SHOWN: f64 = 1e15;

/// Lever arm that the term passes for: in a swing both are in phase, so that the arm grows more certain with
/// each fix, and the error stays.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SkewedArm {
    /// Sums over what is known before and the fixes, for each component of the arm: size of the product of its
    /// effect with the term, and square of its effect.
    sums: [[f32; 2]; 3],
}

impl SkewedArm {
    /// An arm known to a sigma, m, before fixes of this noise, m/s: as if as many fixes had shown it without
    /// the term.
    pub fn known(sigma_m: &Vector3<f64>, noise_mps: f64) -> Self {
        // An arm known exactly is no infinity, which JSON could not hold.
        let shown = sigma_m.map(|sigma| math::min(noise_mps / sigma, MOST_SHOWN));
        Self {
            sums: [shown.x, shown.y, shown.z].map(|shown| [0.0, math::single(shown * shown)]),
        }
    }

    /// A fix of level velocities with these partials, in which the term may be `skew_mps`.
    pub fn add(&mut self, partials: &[[f32; 2]; COUNT], skew_mps: &Vector3<f32>) {
        let effects = partials.iter().skip(index::LEVER_ARM);
        for ([product, square], [east, north]) in self.sums.iter_mut().zip(effects) {
            *product += (east * skew_mps.x + north * skew_mps.y).abs();
            *square += east * east + north * north;
        }
    }

    /// Variance of each component, m^2.
    pub fn variances(&self) -> [f32; 3] {
        self.sums.map(|[product, square]| {
            let arm_m = if square > 0.0 { product / square } else { 0.0 };
            arm_m * arm_m
        })
    }
}

/// The term in a velocity of these derivatives, m/s, with a smoothing as long as its sigma, but no more than
/// all of a swing can be smoothed away.
pub fn skew_mps(
    accel_mps2: &Vector3<f64>,
    snap_mps4: &Vector3<f64>,
    smoothing_s2: f64,
    sigma_s2: f64,
) -> Vector3<f64> {
    let all = 4.0 * accel_mps2.norm_squared() / (snap_mps4.norm_squared() + 1e-9);
    let square = math::min(smoothing_s2 * smoothing_s2 + sigma_s2 * sigma_s2, all);
    snap_mps4 * math::sqrt(skew_variance(math::sqrt(square), 1.0))
}

/// Square of the term, of delays distributed exponentially with variance `s2`, in a quantity of squared third
/// derivative `third2`: they have a third moment of `2 s2^1.5`, a sixth of which is the coefficient. In a turn
/// the term is a constant lateral velocity, like that of an accelerometer bias: it counts once per manoeuvre
/// and not per fix, and lies all in one direction.
pub fn skew_variance(s2: f64, third2: f64) -> f64 {
    s2 * s2 * s2 / 9.0 * third2
}

#[cfg(test)]
#[path = "../../tests/unit/skew.rs"]
mod tests;
