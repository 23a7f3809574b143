//! A recorded drive as a motion for simulation, without its noise.

use ins_core::Solution;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::aircraft::dynamics::State;
use crate::aircraft::trajectory::{Node, Segment};
use crate::sim::{Kinematics, Motion};

/// Acceleration at the end of a rest, m/s^2.
const DRIVE_OFF_MPS2: f64 = 1.5;

/// Motion through the solutions of a navigator; before them a rest, if there was one, and a straight
/// start from it.
#[derive(Clone, Debug)]
pub struct Replay {
    before_s: f64,
    nodes: Vec<Node>,
    at: usize,
    segment: Segment,
}

impl Replay {
    /// None of fewer than three solutions; `before_s` is the time of rest and start before the first.
    pub fn new(solutions: &[Solution], before_s: f64) -> Option<Self> {
        let nodes = nodes(solutions);
        let (first, second) = (nodes.first()?, nodes.get(1)?);
        let segment = Segment::between(first, second);
        Some(Self {
            before_s,
            nodes,
            at: 0,
            segment,
        })
    }

    pub fn duration_s(&self) -> f64 {
        self.before_s + self.nodes.last().map_or(0.0, |node| node.time_s)
    }

    fn driving_off(&self, seconds_left: f64) -> Kinematics {
        let first = &self.nodes[0].state;
        let velocity = first.velocity_enu_mps;
        let lasts_s = velocity.norm() / DRIVE_OFF_MPS2;
        let gone = 1.0 - seconds_left / lasts_s;
        let (gone, acceleration_enu_mps2) = if gone > 0.0 {
            (gone, velocity / lasts_s)
        } else {
            (0.0, Vector3::zeros())
        };
        Kinematics {
            velocity_enu_mps: gone * velocity,
            acceleration_enu_mps2,
            attitude: UnitQuaternion::new_normalize(first.attitude),
            angular_rate_lb_b_radps: Vector3::zeros(),
        }
    }
}

/// Accelerations and rates are those of the parabola through three solutions in a row.
fn nodes(solutions: &[Solution]) -> Vec<Node> {
    let Some(start) = solutions.get(1).map(|solution| solution.time) else {
        return Vec::new();
    };
    let mut last: Option<Quaternion<f64>> = None;
    let node = |three: &[Solution]| {
        let [before, now, after] = [&three[0], &three[1], &three[2]];
        let seconds = after.time.seconds_since(before.time);
        let attitude = *now.attitude;
        // A quaternion and its negative are one attitude: the sign is chosen for continuity.
        let attitude = match last {
            Some(last) if last.dot(&attitude) < 0.0 => -attitude,
            _ => attitude,
        };
        last = Some(attitude);
        let change: Vector3<f64> = after.velocity_enu_mps - before.velocity_enu_mps;
        Node {
            time_s: now.time.seconds_since(start),
            state: State {
                velocity_enu_mps: now.velocity_enu_mps,
                attitude,
                rate_radps: (before.attitude.inverse() * after.attitude).scaled_axis() / seconds,
                height_m: now.position.height_m,
                engine_rps: 0.0,
            },
            acceleration_enu_mps2: change / seconds,
        }
    };
    solutions.windows(3).map(node).collect()
}

impl Motion for Replay {
    fn kinematics(&mut self, time_s: f64) -> Kinematics {
        if time_s < self.before_s {
            return self.driving_off(self.before_s - time_s);
        }
        let time_s = time_s - self.before_s;
        while time_s > self.segment.end_s() && self.at + 2 < self.nodes.len() {
            self.at += 1;
            self.segment = Segment::between(&self.nodes[self.at], &self.nodes[self.at + 1]);
        }
        self.segment.kinematics(time_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::{DriveConfig, simulate};

    #[test]
    fn a_simulated_drive_is_driven_again() {
        let truth = simulate(&DriveConfig::ideal(3, 3.0)).truth;
        let mut replay = Replay::new(&truth, 5.0).unwrap();
        assert!((replay.duration_s() - 184.8).abs() < 0.11);
        assert!(replay.kinematics(1.0).velocity_enu_mps.norm() == 0.0);
        for (count, solution) in truth[1..truth.len() - 1].iter().enumerate() {
            let shown = replay.kinematics(5.0 + 0.1 * count as f64);
            assert!((shown.velocity_enu_mps - solution.velocity_enu_mps).norm() < 1e-9);
            assert!(shown.attitude.angle_to(&solution.attitude) < 1e-7);
        }
    }
}
