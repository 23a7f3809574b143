//! Preintegrated inertial data: nodes of tenths of a second, kept until the fixes of their time have come.
//!
//! A fix arrives up to a second after its stamp and shows the motion of up to a second before or after it,
//! so the search runs some seconds behind the sensors.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::attitude::{matrix, renormalized, small_rotation};
use crate::increments::Interval;
use crate::math::{self, single};

/// Length of a node, s: manoeuvres of a small quadrotor last half a second.
const NODE_S: f64 = 0.1;
/// Nodes kept.
const KEPT: u32 = 32;
/// Nodes that may wait for fixes; the rest is room for work that is spread over calls. Enough for one fix a
/// second that comes a second late and shows the motion of most of a second before.
const WAIT: u32 = 28;

/// Motion over a node, in the body axes of its start, uncompensated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Node {
    /// Duration, microseconds: stamps add up exactly.
    pub(crate) micros: u32,
    /// Rotation vector, rad.
    pub(crate) rotation_rad: Vector3<f32>,
    /// Velocity gained from specific force, m/s.
    pub(crate) velocity_mps: Vector3<f32>,
}

impl Node {
    pub(crate) fn seconds(&self) -> f64 {
        1e-6 * f64::from(self.micros)
    }

    /// Rotation and velocity gained, compensated for a constant gyro bias, which turns the axes of the
    /// force by half of its angle on average.
    pub(crate) fn without_bias(&self, gyro_radps: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let seconds = self.seconds();
        let velocity = self.velocity_mps.map(f64::from);
        let turned = 0.5 * seconds * gyro_radps;
        (
            self.rotation_rad.map(f64::from) - seconds * gyro_radps,
            velocity - turned.cross(&velocity),
        )
    }
}

/// The last nodes, numbered from the first one, and the present one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Nodes {
    kept: [Node; KEPT as usize],
    count: u32,
    seconds: f64,
    rotation: UnitQuaternion<f64>,
    velocity_mps: Vector3<f64>,
}

impl Nodes {
    /// A node by its number, while it is kept.
    pub(crate) fn get(&self, number: u32) -> Option<&Node> {
        let age = self.count.checked_sub(number)?;
        if age == 0 || age > KEPT {
            return None;
        }
        self.kept.get((number % KEPT) as usize)
    }

    /// Whether node `number` must not wait any longer for a fix.
    pub(crate) fn must_advance(&self, number: u32) -> bool {
        self.count.saturating_sub(number) > WAIT
    }

    /// Adds an interval; true if a node has ended with it.
    pub(crate) fn add(&mut self, interval: &Interval) -> bool {
        self.velocity_mps += matrix(&self.rotation) * interval.velocity_mps();
        let turned = self.rotation.as_ref() * small_rotation(&interval.rotation_rad());
        self.rotation = renormalized(turned);
        self.seconds += interval.seconds;
        if self.seconds < NODE_S - 0.25 * interval.seconds {
            return false;
        }
        self.close();
        true
    }

    /// Ends a node at a microsecond; the rest belongs to the next.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    fn close(&mut self) {
        let micros = math::round(self.seconds * 1e6) as u32;
        let node = Node {
            micros,
            rotation_rad: rotation_vector(&self.rotation).map(single),
            velocity_mps: self.velocity_mps.map(single),
        };
        if let Some(place) = self.kept.get_mut((self.count % KEPT) as usize) {
            *place = node;
        }
        self.count += 1;
        self.seconds -= 1e-6 * f64::from(micros);
        self.rotation = UnitQuaternion::identity();
        self.velocity_mps = Vector3::zeros();
    }
}

/// Rotation vector of a quaternion, for angles below a turn.
fn rotation_vector(q: &Quaternion<f64>) -> Vector3<f64> {
    let axis = Vector3::new(q.i, q.j, q.k);
    let sin = math::sqrt(axis.norm_squared());
    if sin < 1e-6 {
        return 2.0 * axis;
    }
    2.0 * math::atan2(sin, q.w) / sin * axis
}
