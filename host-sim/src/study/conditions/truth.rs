//! What an estimator should find, where several errors are one number.
//!
//! A vehicle that stays about level shows of accelerometers only what they read there. With the
//! matrix `A` of their scale errors and misalignments, `u` the mean up direction in the axes of the
//! unit and `g` gravity, a bias `b` is felt as `b + g A u`.
//!
//! Gyros with such a matrix `G`, turning at a rate `w` about `u`, read `w G u` too much. Let `p` be
//! the part of `G u` across `u`, and `C' = C (I + [e x])` the attitude that they carry on, `C` the
//! true one: `e' = w p - w u x e` stands still at `e = -u x p`, for `u x (-u x p) = p`. Whatever
//! turns there are about the vertical, an INS that starts at this tilt `e` keeps it: gyros cannot
//! be told from ones without error in axes that are turned by `e`. In these axes the true specific
//! force is `f - e x f`, so accelerometers that read `f` read `e x f` too much, which is
//! `-(u x p) x g u = g u x (u x p) = -g p`. The bias felt in all is `b + g A u - g p`, and the
//! attitude that belongs to it is `C (I + [e x])`.

use ins_core::Solution;
use ins_core::earth::LocalEarth;
use nalgebra::{UnitQuaternion, Vector3};

use super::World;
use crate::sim::{SensorErrors, SimulatedDrive};

/// The truth of one run, body axes of the unit, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// As felt by the level vehicle.
    pub accel_bias_mps2: Vector3<f64>,
    /// At the end.
    pub gyro_bias_radps: Vector3<f64>,
    /// At the end. A receiver that smooths lags by what depends on the motion, and one whose fixes
    /// are logged several times shows several: anything between is right.
    pub latency_s: [f64; 2],
    /// Antenna from the unit.
    pub lever_arm_m: Vector3<f64>,
    /// Up on the whole.
    pub up: Vector3<f64>,
    /// From the axes that gyros and accelerometers agree on to those of the unit.
    pub axes: UnitQuaternion<f64>,
}

impl Truth {
    /// Of a world that was simulated.
    pub fn new(world: &World, drive: &SimulatedDrive) -> Self {
        Self::at(world, &drive.errors, &mean_up(&drive.truth))
    }

    /// Of a vehicle whose up direction is on the whole this one, in the axes of the unit.
    fn at(world: &World, errors: &SensorErrors, up: &Vector3<f64>) -> Self {
        let at = &world.origin;
        let gravity = LocalEarth::at(at.latitude_rad, at.height_m).gravity_mps2;
        let turn = errors.gyro_matrix * up;
        let across = turn - up * up.dot(&turn);
        let latency_s = errors.gnss_latency_end_s;
        let proportional = gravity * (errors.accel_matrix * up - across);
        Self {
            accel_bias_mps2: Vector3::from(errors.accel_bias_mps2) + proportional,
            gyro_bias_radps: errors.gyro_bias_radps.into(),
            latency_s: [latency_s, latency_s + errors.gnss_lag_s],
            lever_arm_m: world.lever_arm_m(),
            up: *up,
            axes: UnitQuaternion::from_scaled_axis(-up.cross(&across)),
        }
    }
}

/// An aircraft flies nose up, a road rises and falls.
fn mean_up(truth: &[Solution]) -> Vector3<f64> {
    let ups = truth.iter().map(|s| s.attitude.inverse() * Vector3::z());
    ups.sum::<Vector3<f64>>().normalize()
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;

    use super::*;
    use crate::sim::Grade;

    #[test]
    fn misaligned_sensors_that_turn_about_the_vertical_are_aligned_ones_with_another_bias() {
        let mut world = World::plain(Grade::Mems, 1, 10.0, "test");
        world.tilt_mount([30.0, 60.0]);
        let (mount, up) = (world.mount, world.mount.inverse() * Vector3::z());
        #[rustfmt::skip]
        let gyro_matrix = 1e-3 * Matrix3::new(3.0, -5.0, 2.0, 4.0, 1.0, -6.0, 2.0, 7.0, -4.0);
        #[rustfmt::skip]
        let accel_matrix = 1e-3 * Matrix3::new(8.0, 2.0, -3.0, 2.0, -9.0, 1.0, -3.0, 1.0, 5.0);
        let errors = SensorErrors {
            accel_bias_mps2: [0.1, -0.2, 0.05],
            gyro_bias_radps: [0.0; 3],
            accel_scale: [0.0; 3],
            gyro_scale: [0.0; 3],
            accel_matrix,
            gyro_matrix,
            gnss_latency_s: 0.0,
            gnss_latency_end_s: 0.0,
            gnss_lag_s: 0.0,
        };
        let truth = Truth::at(&world, &errors, &up);
        let at = &world.origin;
        let gravity = LocalEarth::at(at.latitude_rad, at.height_m).gravity_mps2;
        // Three turns to the right and one to the left, from the tilt that belongs to it.
        let mut carried = mount * truth.axes;
        let mut heading = 0.0_f64;
        for (rate, steps) in [(-0.5_f64, 3770), (0.3, 2094)] {
            for _ in 0..steps {
                let angle = 0.01 * rate * (up + gyro_matrix * up);
                carried *= UnitQuaternion::from_scaled_axis(angle);
                heading += 0.01 * rate;
                let level = carried
                    * (gravity * up
                        + gravity * accel_matrix * up
                        + Vector3::from(errors.accel_bias_mps2)
                        - truth.accel_bias_mps2);
                // What is left is of second order, 1e-5 rad; uncorrected it were 0.3 m/s^2.
                assert!(level.xy().norm() < 2e-3, "{level}");
            }
        }
        let heading = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, heading));
        let off = carried * (heading * mount * truth.axes).inverse();
        // About the vertical gyros have a scale error; level axes are kept.
        assert!(off.scaled_axis().xy().norm() < 1e-3);
    }
}
