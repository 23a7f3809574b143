//! The level attitude of the mount, by which accelerometers and their scales are told apart.

use nalgebra::Vector3;

use super::{FIRST_LEVEL_S, Observer, row};
use crate::config::Config;
use crate::math::{self, singles};
use crate::parameters::index;

/// Time over which the level attitude of the mount is averaged at most, s: for some minutes a mount
/// stays as it is.
const LEVEL_MEMORY_S: f64 = 600.0;
/// Angle beyond which up and what is felt as up, on the mean of some manoeuvres, show that the mount
/// has slipped: a bank tips the one, a long start the other, and a climb both by less.
const SLIPPED_RAD: f64 = 0.25;

impl Observer {
    /// Makes the biases of the accelerometers those of the mean attitude so far, where their
    /// scale errors have moved them: the first level was that of the biased accelerometers. Of a
    /// mount that has slipped it is the mean attitude since, and what their misalignments have
    /// moved them by is not known.
    #[inline(never)]
    pub fn level_anew(&mut self, config: &Config) {
        let slipped = self.slips();
        self.levelled_s = math::min(self.levelled_s + self.elapsed_s, LEVEL_MEMORY_S);
        let part = math::min(self.elapsed_s / self.levelled_s, 1.0);
        let level = self.level_force_mps2 / self.gravity_mps2;
        let mean = slipped.unwrap_or_else(|| level.lerp(&self.up, part));
        // The mean of directions is shorter than each, and gravity is not.
        let Some(mean) = mean.try_normalize(0.5) else {
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
        if slipped.is_some() {
            self.levelled_s = FIRST_LEVEL_S;
            self.lately = [Vector3::zeros(); 2];
            self.beyond_mps2 = Vector3::zeros();
            let moved = config.sensors.cross_axis_variance() * step.norm_squared();
            for which in index::ACCEL..index::ACCEL + 3 {
                self.let_walk(which, math::single(moved));
            }
        }
    }

    /// The level attitude of the mount after it has slipped, if it has.
    fn slips(&mut self) -> Option<Vector3<f64>> {
        let part = math::min(self.elapsed_s / FIRST_LEVEL_S, 1.0);
        let level = self.level_force_mps2 / self.gravity_mps2;
        let mut off = true;
        let felt = self.felt.try_normalize(0.5 * self.gravity_mps2);
        for (lately, now) in (self.lately.iter_mut()).zip([self.up, felt.unwrap_or(level)]) {
            *lately += (now - level - *lately) * part;
            off &= lately.norm_squared() > SLIPPED_RAD * SLIPPED_RAD;
        }
        let [up, _] = self.lately;
        off.then(|| level + up)
    }
}
