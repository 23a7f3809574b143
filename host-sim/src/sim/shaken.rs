//! What swings on top of a motion: engine, waves, steps.

use core::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::motion::{Kinematics, Motion};
use super::noise::Random;

/// One frequency of a shaking, body axes; amplitudes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Swing {
    pub hz: f64,
    pub velocity_mps: [f64; 3],
    pub rotation_rad: [f64; 3],
}

/// When it shakes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum When {
    Always,
    /// The more, the faster; half at this speed, m/s.
    Moving(f64),
    /// The less, the faster; half at this speed, m/s.
    Standing(f64),
}

#[derive(Clone, Debug)]
pub struct Shaken<M> {
    motion: M,
    swings: Vec<Phased>,
    when: When,
}

#[derive(Clone, Copy, Debug)]
struct Phased {
    swing: Swing,
    phase_rad: f64,
}

impl<M: Motion> Shaken<M> {
    /// Shakes a motion; phases are those of run `seed`.
    pub fn new(motion: M, swings: &[Swing], when: When, seed: u64) -> Self {
        let mut random = Random::stream(seed, "phases");
        let swings = swings.iter().map(|swing| Phased {
            swing: *swing,
            phase_rad: random.uniform([0.0, TAU]),
        });
        Self {
            motion,
            swings: swings.collect(),
            when,
        }
    }

    /// How much of the amplitudes there is, and the rate at which that changes, 1/s.
    fn envelope(&self, k: &Kinematics) -> (f64, f64) {
        let share = |half_mps: f64| {
            let half2 = half_mps * half_mps;
            let all = k.velocity_enu_mps.norm_squared() + half2;
            let along = k.velocity_enu_mps.dot(&k.acceleration_enu_mps2);
            (1.0 - half2 / all, 2.0 * along * half2 / (all * all))
        };
        match self.when {
            When::Always => (1.0, 0.0),
            When::Moving(half_mps) => share(half_mps),
            When::Standing(half_mps) => {
                let (moving, rate) = share(half_mps);
                (1.0 - moving, -rate)
            }
        }
    }
}

impl<M: Motion> Motion for Shaken<M> {
    fn kinematics(&mut self, time_s: f64) -> Kinematics {
        let k = self.motion.kinematics(time_s);
        let (share, share_rate) = self.envelope(&k);
        let (mut velocity, mut acceleration) = (Vector3::zeros(), Vector3::zeros());
        let (mut rotation, mut rate) = (Vector3::zeros(), Vector3::zeros());
        for Phased { swing, phase_rad } in &self.swings {
            let omega = TAU * swing.hz;
            // A quarter turn between the axes: the unit describes ellipses, not lines.
            for axis in 0..3 {
                let phase = omega * time_s + phase_rad + FRAC_PI_2 * axis as f64;
                let (sin, cos) = libm::sincos(phase);
                let (v, r) = (swing.velocity_mps[axis], swing.rotation_rad[axis]);
                velocity[axis] += v * share * cos;
                acceleration[axis] += v * (share_rate * cos - share * omega * sin);
                rotation[axis] += r * share * sin;
                rate[axis] += r * (share_rate * sin + share * omega * cos);
            }
        }
        swung(&k, [velocity, acceleration], [rotation, rate])
    }
}

/// A motion on top of another: velocity and acceleration, Rodrigues' vector and its rate, all in
/// the body axes of the one below.
pub(crate) fn swung(
    k: &Kinematics,
    [velocity, acceleration]: [Vector3<f64>; 2],
    [rotation, rate]: [Vector3<f64>; 2],
) -> Kinematics {
    let body = &k.angular_rate_lb_b_radps;
    let turned = UnitQuaternion::from_quaternion(Quaternion::from_parts(1.0, 0.5 * rotation));
    // The quaternion (1, r/2) normalised is the rotation by Rodrigues' vector r: its body rate
    // is (r' - r x r' / 2) / (1 + r^2/4).
    let own_rate = (rate - 0.5 * rotation.cross(&rate)) / (1.0 + 0.25 * rotation.norm_squared());
    Kinematics {
        velocity_enu_mps: k.velocity_enu_mps + k.attitude * velocity,
        acceleration_enu_mps2: k.acceleration_enu_mps2
            + k.attitude * (acceleration + body.cross(&velocity)),
        attitude: k.attitude * turned,
        angular_rate_lb_b_radps: turned.inverse() * body + own_rate,
    }
}
