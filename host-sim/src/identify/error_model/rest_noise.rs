//! Noise at rest: of all three axes, and of each over that.

use ins_core::rest::RestBlock;
use nalgebra::Vector3;

use super::interval::{Interval, NORMAL_95, sigma_of_squares};
use super::record::Record;
use crate::sim::noise::Random;

/// White noise of readings at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestNoise {
    /// Root of its density, of all axes together: the root of their mean square.
    pub density: Interval,
    /// That of each axis over it; none if an axis has no scatter at all.
    pub times: Option<[Interval; 3]>,
}

impl RestNoise {
    /// From differences of successive block means (Allan variance), so that biases may drift; none
    /// without two blocks of one rest.
    pub fn new(records: &[Record], value: fn(&RestBlock) -> Vector3<f64>) -> Option<Self> {
        let (mut squares, mut pairs, mut covariance_sum) = (Vector3::zeros(), 0.0, 0.0);
        for blocks in records.iter().flat_map(|record| &record.rest) {
            for pair in blocks.windows(2) {
                let off = value(&pair[1]) - value(&pair[0]);
                squares += 0.5 * pair[1].seconds * off.component_mul(&off);
                pairs += 1.0;
            }
            // Variance of the sum, over that of a mean: differences that share a block are correlated.
            covariance_sum += (3.0 * blocks.len() as f64 - 4.0).max(0.0);
        }
        let dof = 2.0 * pairs * pairs / covariance_sum;
        let sums = squares * (dof / pairs);
        (pairs > 0.0).then(|| Self {
            density: sigma_of_squares(sums.sum(), 3.0 * dof),
            times: (sums.min() > 0.0).then(|| times(&sums, dof)),
        })
    }

    pub(super) fn drawn(&self, random: &mut Random) -> Self {
        Self {
            density: self.density.drawn(random),
            times: (self.times).map(|times| times.map(|axis| axis.drawn(random))),
        }
    }

    /// `noise_times` of a model, whose noise in motion may exceed that at rest by a factor: what motion
    /// adds is taken as equal on all axes. One each unless they differ significantly.
    pub fn model_times(&self, motion_over_rest: f64) -> [f64; 3] {
        let differ = |times: &[Interval; 3]| times.iter().any(|axis| !axis.holds(1.0));
        let Some(times) = self.times.filter(differ) else {
            return [1.0; 3];
        };
        let part = 1.0 / (motion_over_rest * motion_over_rest).max(1.0);
        times.map(|axis| (1.0 + part * (axis.value * axis.value - 1.0)).sqrt())
    }
}

/// Normal in the logarithm, each sum of squares chi-square of `dof` degrees of freedom.
fn times(sums: &Vector3<f64>, dof: f64) -> [Interval; 3] {
    let shares = sums / sums.sum();
    core::array::from_fn(|axis| {
        let share = shares[axis];
        let variance = (1.0 - 2.0 * share + shares.norm_squared()) / (2.0 * dof);
        let value = (3.0 * share).sqrt();
        let factor = libm::exp(NORMAL_95 * variance.sqrt());
        [value, value / factor, value * factor].into()
    })
}
