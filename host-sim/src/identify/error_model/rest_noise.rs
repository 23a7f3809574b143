//! Noise at rest: of all three axes, and how it is shared among them.

use ins_core::rest::RestBlock;
use nalgebra::Vector3;

use super::interval::{Interval, NORMAL_95, sigma_of_squares};
use super::record::Record;
use crate::sim::noise::Random;

/// White noise that readings at rest scatter with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestNoise {
    /// Root of its density, of all axes together: the root of their mean square.
    pub density: Interval,
    /// That of each axis over it; none if an axis does not scatter at all.
    pub times: Option<[Interval; 3]>,
}

impl RestNoise {
    /// From how block means differ from the next, so that biases may move meanwhile; none without
    /// two blocks of one rest.
    pub fn new(records: &[Record], value: fn(&RestBlock) -> Vector3<f64>) -> Option<Self> {
        let (mut squares, mut pairs, mut doubt) = (Vector3::zeros(), 0.0, 0.0);
        for blocks in records.iter().flat_map(|record| &record.rest) {
            for pair in blocks.windows(2) {
                let off = value(&pair[1]) - value(&pair[0]);
                squares += 0.5 * pair[1].seconds * off.component_mul(&off);
                pairs += 1.0;
            }
            // Variance of the sum in that of a reading: differences with one in common correlate.
            doubt += (3.0 * blocks.len() as f64 - 4.0).max(0.0);
        }
        let freedom = 2.0 * pairs * pairs / doubt;
        let sums = squares * (freedom / pairs);
        (pairs > 0.0).then(|| Self {
            density: sigma_of_squares(sums.sum(), 3.0 * freedom),
            times: (sums.min() > 0.0).then(|| times(&sums, freedom)),
        })
    }

    pub(super) fn drawn(&self, random: &mut Random) -> Self {
        Self {
            density: self.density.drawn(random),
            times: (self.times).map(|times| times.map(|axis| axis.drawn(random))),
        }
    }

    /// The times of a model, whose noise in motion may be so many times that at rest: what motion
    /// adds is taken for alike. One each unless it is known that they differ.
    pub fn model_times(&self, motion_over_rest: f64) -> [f64; 3] {
        let differ = |times: &[Interval; 3]| times.iter().any(|axis| !axis.holds(1.0));
        let Some(times) = self.times.filter(differ) else {
            return [1.0; 3];
        };
        let part = 1.0 / (motion_over_rest * motion_over_rest).max(1.0);
        times.map(|axis| (1.0 + part * (axis.value * axis.value - 1.0)).sqrt())
    }
}

/// Normal in the logarithm, each sum of squares chi-square of so many degrees of freedom.
fn times(sums: &Vector3<f64>, freedom: f64) -> [Interval; 3] {
    let shares = sums / sums.sum();
    core::array::from_fn(|axis| {
        let share = shares[axis];
        let variance = (1.0 - 2.0 * share + shares.norm_squared()) / (2.0 * freedom);
        let value = (3.0 * share).sqrt();
        let factor = libm::exp(NORMAL_95 * variance.sqrt());
        [value, value / factor, value * factor].into()
    })
}
