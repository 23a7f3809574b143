//! What a vehicle model owes the sensor model.

use nalgebra::{UnitQuaternion, Vector3};

/// The motion of a vehicle against its local East-North-Up frame at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kinematics {
    /// Velocity against the Earth.
    pub velocity_enu_mps: Vector3<f64>,
    /// Time derivatives of the three components of `velocity_enu_mps`.
    pub acceleration_enu_mps2: Vector3<f64>,
    /// Rotation from body (right-forward-up) to ENU.
    pub attitude: UnitQuaternion<f64>,
    /// Angular rate of the body against the ENU frame, in body axes.
    pub angular_rate_lb_b_radps: Vector3<f64>,
}

/// A vehicle's motion as a function of time.
pub trait Motion {
    /// The motion at `time_s`. Called at times that do not decrease.
    ///
    /// The acceleration must be the derivative of the velocity, and the angular rate that of the
    /// attitude: the ideal sensors read the derivatives, the truth the functions.
    fn kinematics(&mut self, time_s: f64) -> Kinematics;
}

impl<M: Motion + ?Sized> Motion for Box<M> {
    fn kinematics(&mut self, time_s: f64) -> Kinematics {
        (**self).kinematics(time_s)
    }
}
