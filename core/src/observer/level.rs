//! The level attitude of the mount, by which accelerometers and their scales are told apart.

use super::{Observer, row};
use crate::math::{self, singles};
use crate::parameters::index;

/// Time over which the level attitude of the mount is averaged at most, s: for some minutes a mount
/// stays as it is.
const LEVEL_MEMORY_S: f64 = 600.0;

impl Observer {
    /// Makes the biases of the accelerometers those of the mean attitude so far, where their
    /// scale errors have moved them: the first level was that of the biased accelerometers.
    #[inline(never)]
    pub fn level_anew(&mut self) {
        self.levelled_s = math::min(self.levelled_s + self.elapsed_s, LEVEL_MEMORY_S);
        let part = math::min(self.elapsed_s / self.levelled_s, 1.0);
        let level = self.level_force_mps2 / self.gravity_mps2;
        // The mean of directions is shorter than each, and gravity is not.
        let Some(mean) = level.lerp(&self.up, part).try_normalize(0.5) else {
            return;
        };
        let step = mean * self.gravity_mps2 - self.level_force_mps2;
        self.level_force_mps2 += step;
        let felt = singles(&(self.felt - self.level_force_mps2));
        self.beyond_mps2 -= singles(&step);
        self.beyond_mps2 += (felt - self.beyond_mps2) * math::single(part);
        for (axis, step) in step.iter().enumerate() {
            let (bias, scale) = (index::ACCEL + axis, index::ACCEL_SCALE + axis);
            self.carry_forward(bias, &row([(scale, math::single(*step))]));
            self.parameters
                .shift(bias, step * self.parameters.value(scale));
        }
    }
}
