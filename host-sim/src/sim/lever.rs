//! An antenna some way from the inertial sensors.

use ins_core::earth::{Geodetic, LocalEarth};
use nalgebra::Vector3;

use super::ideal::{TrueState, between, displaced};

/// Where the antenna is and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Antenna {
    /// Place.
    pub position: Geodetic,
    /// Velocity against the Earth.
    pub velocity_enu_mps: Vector3<f64>,
}

impl Antenna {
    /// Between two states one sampling interval or less apart.
    ///
    /// Sensors and arm are interpolated apart, each by the cubic through its values and
    /// derivatives at the two states: arm and its velocity are good to h^3 of the turn's fourth
    /// derivative.
    pub fn between(from: &TrueState, to: &TrueState, time_s: f64, arm_m: &[f64; 3]) -> Self {
        let (position, velocity) = between(from, to, time_s);
        let arm = Vector3::from(*arm_m);
        if arm.norm_squared() == 0.0 {
            return Self {
                position,
                velocity_enu_mps: velocity,
            };
        }
        let h = to.solution.time.seconds_since(from.solution.time);
        let u = (time_s - from.solution.time.as_seconds()) / h;
        let (r0, v0) = arm_enu(from, &arm);
        let (r1, v1) = arm_enu(to, &arm);
        let (d0, d1) = (h * v0, h * v1);
        let (square, cube) = (3.0 * (r1 - r0) - 2.0 * d0 - d1, 2.0 * (r0 - r1) + d0 + d1);
        let reach = r0 + u * (d0 + u * (square + u * cube));
        let swing = (d0 + u * (2.0 * square + 3.0 * u * cube)) / h;
        Self {
            position: displaced(&position, &reach),
            velocity_enu_mps: velocity + swing,
        }
    }
}

/// The arm and its velocity against the Earth, ENU.
fn arm_enu(state: &TrueState, arm: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let at = &state.solution.position;
    let attitude = state.solution.attitude;
    let earth_rate = LocalEarth::at(at.latitude_rad, at.height_m).earth_rate();
    let rate = attitude * state.rates.angular_rate_ib_b_radps - earth_rate;
    let reach = attitude * arm;
    (reach, rate.cross(&reach))
}
