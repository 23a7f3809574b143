//! What a vehicle model owes the sensor model, and what vehicles share that move along their heading.

use ins_core::attitude::{Euler, from_euler};
use nalgebra::{UnitQuaternion, Vector3};

use super::profile::Local;

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

/// Motion along a path over the local frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Path {
    /// ENU, m/s.
    pub velocity_mps: Vector3<f64>,
    /// Its derivative, m/s^2.
    pub acceleration_mps2: Vector3<f64>,
    /// Speed times rate of heading: to the right, m/s^2.
    pub lateral_mps2: f64,
    /// Its derivative, m/s^3.
    pub lateral_rate_mps3: f64,
}

impl Path {
    /// At a speed, in a heading, under an angle of climb, all with their derivatives by time.
    pub(super) fn new(along: &Local, heading: &Local, climb_rad: f64, climb_radps: f64) -> Self {
        let (speed, acceleration) = (along.value, along.slope);
        let (sin_h, cos_h) = libm::sincos(heading.value);
        let (sin_g, cos_g) = libm::sincos(climb_rad);
        let forward = Vector3::new(cos_g * sin_h, cos_g * cos_h, sin_g);
        let forward_rate = Vector3::new(
            cos_g * cos_h * heading.slope - sin_g * sin_h * climb_radps,
            -cos_g * sin_h * heading.slope - sin_g * cos_h * climb_radps,
            cos_g * climb_radps,
        );
        Self {
            velocity_mps: speed * forward,
            acceleration_mps2: acceleration * forward + speed * forward_rate,
            lateral_mps2: speed * heading.slope,
            lateral_rate_mps3: acceleration * heading.slope + speed * heading.curvature,
        }
    }
}

/// The motion of a vehicle from its velocity, roll, pitch and heading and their derivatives.
pub(super) fn kinematics(
    velocity_enu_mps: Vector3<f64>,
    acceleration_enu_mps2: Vector3<f64>,
    angles: &Euler,
    rates: &Euler,
) -> Kinematics {
    Kinematics {
        velocity_enu_mps,
        acceleration_enu_mps2,
        attitude: from_euler(angles),
        angular_rate_lb_b_radps: body_rate(angles, rates),
    }
}

/// Level in a heading: angles, and their rates.
pub(super) fn level(heading: &Local) -> [Euler; 2] {
    [heading.value, heading.slope].map(|heading_rad| Euler {
        heading_rad,
        ..Euler::default()
    })
}

/// Angular rate in body axes from the rates of roll, pitch and heading.
fn body_rate(angles: &Euler, rates: &Euler) -> Vector3<f64> {
    let (sin_p, cos_p) = libm::sincos(angles.pitch_rad);
    let (sin_r, cos_r) = libm::sincos(angles.roll_rad);
    let turn = rates.heading_rad * cos_p;
    Vector3::new(
        cos_r * rates.pitch_rad + sin_r * turn,
        rates.roll_rad - rates.heading_rad * sin_p,
        sin_r * rates.pitch_rad - cos_r * turn,
    )
}
