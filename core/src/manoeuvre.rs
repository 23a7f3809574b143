//! Classification of manoeuvres.

use crate::history::PastState;
use crate::math;

/// Least acceleration along or across the track, m/s^2.
const ACCEL_MPS2: f64 = 0.5;
/// Largest speed at rest, m/s.
const REST_MPS: f64 = 0.3;
/// Least rate of turn, rad/s.
const TURN_RADPS: f64 = 0.05;

/// What the vehicle is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Manoeuvre {
    /// Standing.
    #[default]
    Rest,
    /// Moving steadily.
    Steady,
    /// Gaining speed.
    Accelerating,
    /// Losing speed.
    Braking,
    /// Changing heading.
    Turning,
}

impl Manoeuvre {
    /// The manoeuvre of an INS state.
    pub(crate) fn of(past: &PastState) -> Self {
        let velocity = past.velocity_mps.xy();
        let accel = past.accel_mps2.xy();
        let speed = velocity.norm();
        if speed < REST_MPS && accel.norm() < ACCEL_MPS2 {
            return Self::Rest;
        }
        let along = velocity.dot(&accel) / math::max(speed, REST_MPS);
        let turn_radps = velocity.perp(&accel) / math::max(speed * speed, 1.0);
        if math::abs(turn_radps) > TURN_RADPS {
            Self::Turning
        } else if along > ACCEL_MPS2 {
            Self::Accelerating
        } else if along < -ACCEL_MPS2 {
            Self::Braking
        } else {
            Self::Steady
        }
    }
}
