//! Level attitude of the mount, at which accelerometer biases are separate from scale errors.

use super::{Observer, row};
use crate::math::{self, singles};
use crate::parameters::index;

/// Longest averaging time of the level attitude, s: a mount stays for some minutes.
const LEVEL_MEMORY_S: f64 = 600.0;

impl Observer {
    /// Refers the accelerometer biases to the mean attitude so far, by their scale errors: the first level
    /// was that of the biased accelerometers.
    #[inline(never)]
    pub fn update_mount_level(&mut self) {
        self.level_averaged_s = math::min(self.level_averaged_s + self.elapsed_s, LEVEL_MEMORY_S);
        let part = math::min(self.elapsed_s / self.level_averaged_s, 1.0);
        let level = self.level_force_mps2 / self.gravity_mps2;
        // A mean of unit vectors is shorter than one.
        let Some(mean) = level.lerp(&self.up, part).try_normalize(0.5) else {
            return;
        };
        let step = mean * self.gravity_mps2 - self.level_force_mps2;
        self.level_force_mps2 += step;
        let excess = singles(&(self.force_mps2 - self.level_force_mps2));
        self.excess_mps2 -= singles(&step);
        self.excess_mps2 += (excess - self.excess_mps2) * math::single(part);
        for (axis, step) in step.iter().enumerate() {
            let (bias, scale) = (index::ACCEL + axis, index::ACCEL_SCALE + axis);
            self.redefine(bias, &row([(scale, math::single(*step))]));
            self.parameters
                .shift(bias, step * self.parameters.value(scale));
        }
    }
}
