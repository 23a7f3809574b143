//! A unit that does not stand along the axes of its vehicle.

use nalgebra::{UnitQuaternion, Vector3};

use super::motion::{Kinematics, Motion};

/// A unit that comes loose, and holds again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slip {
    pub start_s: f64,
    pub duration_s: f64,
    pub turn_rad: Vector3<f64>,
}

impl Slip {
    /// What it has turned by at a time, and its rate, body: without a jolt at either end.
    fn at(&self, time_s: f64) -> (UnitQuaternion<f64>, Vector3<f64>) {
        let part = ((time_s - self.start_s) / self.duration_s).clamp(0.0, 1.0);
        let turned = part * part * (3.0 - 2.0 * part);
        let rate = 6.0 * part * (1.0 - part) / self.duration_s;
        (
            UnitQuaternion::from_scaled_axis(self.turn_rad * turned),
            self.turn_rad * rate,
        )
    }
}

/// The motion of a unit fixed to a vehicle.
#[derive(Clone, Debug)]
pub struct Mounted<M> {
    vehicle: M,
    /// From the axes of the unit to those of the vehicle.
    mount: UnitQuaternion<f64>,
    slip: Option<Slip>,
}

impl<M: Motion> Mounted<M> {
    /// Fixes a unit, whose axes `mount` turns into those of the vehicle.
    pub fn new(vehicle: M, mount: UnitQuaternion<f64>) -> Self {
        Self {
            vehicle,
            mount,
            slip: None,
        }
    }

    /// The same, with a mount that slips once.
    #[must_use]
    pub fn slipping(self, slip: Option<Slip>) -> Self {
        Self { slip, ..self }
    }
}

impl<M: Motion> Motion for Mounted<M> {
    fn kinematics(&mut self, time_s: f64) -> Kinematics {
        let vehicle = self.vehicle.kinematics(time_s);
        let still = (UnitQuaternion::identity(), Vector3::zeros());
        let (turned, rate_radps) = self.slip.map_or(still, |slip| slip.at(time_s));
        let mount = self.mount * turned;
        let turning = mount.inverse() * vehicle.angular_rate_lb_b_radps;
        Kinematics {
            attitude: vehicle.attitude * mount,
            angular_rate_lb_b_radps: turning + rate_radps,
            ..vehicle
        }
    }
}
