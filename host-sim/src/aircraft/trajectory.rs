//! The flight as a function of time, between the nodes of the integrator.
//!
//! Velocity is the Hermite cubic of velocities and accelerations of two nodes; attitude is that of the first
//! rotated by a rotation vector, the Hermite cubic of the rotation and the rates of both. Sensors measure
//! the exact derivatives of these, so the trajectory is consistent for any step of the integrator; the step
//! only determines how accurately it follows the forces.

use ins_core::attitude;
use nalgebra::{Quaternion, Unit, UnitQuaternion, Vector3};

use super::dynamics::State;
use crate::sim::Kinematics;
use crate::sim::ideal::Cubic;

#[derive(Clone, Copy, Debug)]
pub struct Node {
    pub time_s: f64,
    pub state: State,
    pub acceleration_enu_mps2: Vector3<f64>,
}

#[derive(Clone, Copy, Debug)]
pub struct Segment {
    start_s: f64,
    step_s: f64,
    velocity: Cubic,
    attitude: Quaternion<f64>,
    rotation: Cubic,
}

impl Segment {
    pub fn between(from: &Node, to: &Node) -> Self {
        let step_s = to.time_s - from.time_s;
        let turned = rotation_vector(&(from.state.attitude.conjugate() * to.state.attitude));
        Self {
            start_s: from.time_s,
            step_s,
            velocity: Cubic::between(
                [
                    from.state.velocity_enu_mps,
                    from.acceleration_enu_mps2 * step_s,
                ],
                [to.state.velocity_enu_mps, to.acceleration_enu_mps2 * step_s],
            ),
            attitude: from.state.attitude,
            rotation: Cubic::between(
                [Vector3::zeros(), from.state.rate_radps * step_s],
                [
                    turned,
                    rotation_rate(&turned, &to.state.rate_radps) * step_s,
                ],
            ),
        }
    }

    pub fn end_s(&self) -> f64 {
        self.start_s + self.step_s
    }

    pub fn kinematics(&self, time_s: f64) -> Kinematics {
        let u = (time_s - self.start_s) / self.step_s;
        let (velocity_enu_mps, change) = self.velocity.at(u);
        let (rotation, rotation_change) = self.rotation.at(u);
        Kinematics {
            velocity_enu_mps,
            acceleration_enu_mps2: change / self.step_s,
            attitude: UnitQuaternion::new_unchecked(self.attitude * rotation_by(&rotation)),
            angular_rate_lb_b_radps: body_rate(&rotation, &(rotation_change / self.step_s)),
        }
    }

    pub fn displacement_enu_m(&self) -> Vector3<f64> {
        self.step_s * self.velocity.integral()
    }
}

// The series below are for the rotation of one step, some hundredths of a radian: their error is
// below 1e-16 for 0.05 rad and 1e-9 for 0.5 rad, faster than any aircraft here rolls.

fn rotation_by(v: &Vector3<f64>) -> Quaternion<f64> {
    let h2 = 0.25 * v.norm_squared();
    let sinc = 0.5 * (1.0 - h2 / 6.0 * (1.0 - h2 / 20.0 * (1.0 - h2 / 42.0)));
    let cos = 1.0 - h2 / 2.0 * (1.0 - h2 / 12.0 * (1.0 - h2 / 30.0));
    Quaternion::from_parts(cos, v * sinc)
}

/// Rotation vector of a quaternion near unity.
fn rotation_vector(q: &Quaternion<f64>) -> Vector3<f64> {
    let v = q.imag();
    let s = v.norm();
    if s < 1e-12 {
        return 2.0 * v / q.w;
    }
    v * (2.0 * libm::atan2(s, q.w) / s)
}

/// Body rate while the rotation vector is `v` and changes at `rate`:
/// `(I - (1 - cos a)/a^2 [v x] + (a - sin a)/a^3 [v x]^2) rate` (Bortz, solved for the rate).
fn body_rate(v: &Vector3<f64>, rate: &Vector3<f64>) -> Vector3<f64> {
    let a2 = v.norm_squared();
    let first = 0.5 * (1.0 - a2 / 12.0 * (1.0 - a2 / 30.0));
    let second = 1.0 / 6.0 * (1.0 - a2 / 20.0 * (1.0 - a2 / 42.0));
    let cross = v.cross(rate);
    rate - first * cross + second * v.cross(&cross)
}

/// The change of a rotation vector at a body rate (Bortz):
/// `rate + v x rate / 2 + (1/12 + a^2/720) v x (v x rate)`.
fn rotation_rate(v: &Vector3<f64>, body: &Vector3<f64>) -> Vector3<f64> {
    let a2 = v.norm_squared();
    let cross = v.cross(body);
    body + 0.5 * cross + (1.0 / 12.0 + a2 / 720.0) * v.cross(&cross)
}

pub fn euler(state: &State) -> attitude::Euler {
    attitude::euler(&Unit::new_unchecked(state.attitude))
}
