//! An antenna some way from the inertial sensors.

use ins_core::earth::{Geodetic, LocalEarth};
use nalgebra::Vector3;

use super::cubic::Cubic;
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
        let end = |state: &TrueState| {
            let (reach, swing) = arm_enu(state, &arm);
            [reach, h * swing]
        };
        let (reach, swing) = Cubic::between(end(from), end(to)).at(u);
        Self {
            position: displaced(&position, &reach),
            velocity_enu_mps: velocity + swing / h,
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
