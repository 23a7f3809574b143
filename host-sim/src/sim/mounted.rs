//! A unit that does not stand along the axes of its vehicle.

use nalgebra::UnitQuaternion;

use super::motion::{Kinematics, Motion};

/// The motion of a unit fixed to a vehicle.
#[derive(Clone, Debug)]
pub struct Mounted<M> {
    vehicle: M,
    /// From the axes of the unit to those of the vehicle.
    mount: UnitQuaternion<f64>,
}

impl<M: Motion> Mounted<M> {
    /// Fixes a unit, whose axes `mount` turns into those of the vehicle.
    pub fn new(vehicle: M, mount: UnitQuaternion<f64>) -> Self {
        Self { vehicle, mount }
    }
}

impl<M: Motion> Motion for Mounted<M> {
    fn kinematics(&mut self, time_s: f64) -> Kinematics {
        let vehicle = self.vehicle.kinematics(time_s);
        Kinematics {
            attitude: vehicle.attitude * self.mount,
            angular_rate_lb_b_radps: self.mount.inverse() * vehicle.angular_rate_lb_b_radps,
            ..vehicle
        }
    }
}
