//! A quadrotor of small, quick manoeuvres: it tilts to accelerate.

use core::f64::consts::PI;

use ins_core::attitude::Euler;
use nalgebra::Vector3;

use super::motion::{Kinematics, Motion, kinematics};
use super::noise::Random;
use super::profile::{Local, Profile};

const GRAVITY_MPS2: f64 = 9.81;
/// Drag of a small frame, m/s^2 per m/s.
const DRAG_PER_S: f64 = 0.3;

/// Bounds between which the pilot chooses.
mod habits {
    pub const LEVEL_MPS: [f64; 2] = [-4.0, 4.0];
    /// Acceleration, m/s^2, and the time of a tilt to it, s.
    pub const LEVEL: [[f64; 2]; 2] = [[1.0, 4.0], [0.3, 0.7]];
    pub const UP_MPS: [f64; 2] = [-1.0, 1.0];
    pub const UP: [[f64; 2]; 2] = [[0.5, 2.0], [0.3, 0.7]];
    pub const PAUSE_S: [f64; 2] = [0.5, 5.0];
    pub const TURN_RAD: [f64; 2] = [-1.6, 1.6];
    /// Rate of turn, rad/s, and the time in which it builds up, s.
    pub const TURN: [[f64; 2]; 2] = [[0.4, 1.5], [0.3, 0.6]];
    pub const STEADY_S: [f64; 2] = [4.0, 20.0];
    pub const TAKE_OFF_MPS: f64 = 1.5;
}

#[derive(Clone, Debug)]
pub struct Quadrotor {
    east: Profile,
    north: Profile,
    up: Profile,
    heading: Profile,
}

impl Quadrotor {
    /// A flight of at least `duration_s`, chosen by `seed`, after a time on the ground; without
    /// one it begins in the air, under way.
    pub fn new(seed: u64, duration_s: f64, ground_s: Option<f64>) -> Self {
        let mut random = Random::stream(seed, "quadrotor");
        let heading = Profile::new(PI * random.uniform([-1.0, 1.0]));
        let start = |random: &mut Random| match ground_s {
            Some(_) => Profile::new(0.0),
            None => Profile::new(random.uniform(habits::LEVEL_MPS)),
        };
        let mut quadrotor = Self {
            east: start(&mut random),
            north: start(&mut random),
            up: Profile::new(0.0),
            heading,
        };
        let mut free_s = 0.0;
        if let Some(ground_s) = ground_s {
            let up_s = quadrotor
                .up
                .step_to(habits::TAKE_OFF_MPS, ground_s, 1.0, 0.7);
            free_s = quadrotor.up.step_to(0.0, up_s + 4.0, 1.0, 0.7);
        }
        for (profile, speeds, tilt) in [
            (&mut quadrotor.east, habits::LEVEL_MPS, habits::LEVEL),
            (&mut quadrotor.north, habits::LEVEL_MPS, habits::LEVEL),
            (&mut quadrotor.up, habits::UP_MPS, habits::UP),
        ] {
            let mut now_s = free_s;
            while now_s < duration_s {
                now_s += random.uniform(habits::PAUSE_S);
                let speed = random.uniform(speeds);
                now_s = profile.step_drawn(&mut random, speed, now_s, tilt);
            }
        }
        let mut now_s = free_s;
        while now_s < duration_s {
            now_s += random.uniform(habits::STEADY_S);
            let to = quadrotor.heading.last_value() + random.uniform(habits::TURN_RAD);
            now_s = (quadrotor.heading).step_drawn(&mut random, to, now_s, habits::TURN);
        }
        quadrotor
    }
}

impl Motion for Quadrotor {
    fn kinematics(&mut self, time_s: f64) -> Kinematics {
        let [e, n, u] = [&mut self.east, &mut self.north, &mut self.up].map(|p| p.at(time_s));
        let heading = self.heading.at(time_s);
        let three = |of: fn(&Local) -> f64| Vector3::new(of(&e), of(&n), of(&u));
        let (velocity, acceleration) = (three(|x| x.value), three(|x| x.slope));
        // Thrust holds gravity and drag and gives the acceleration; the rotors push along up.
        let thrust = acceleration + DRAG_PER_S * velocity + Vector3::new(0.0, 0.0, GRAVITY_MPS2);
        let thrust_rate = three(|x| x.curvature) + DRAG_PER_S * acceleration;
        let (angles, rates) = leaned(&thrust, &thrust_rate, &heading);
        kinematics(velocity, acceleration, &angles, &rates)
    }
}

/// Angles that put the up axis along a thrust, and their rates.
fn leaned(thrust: &Vector3<f64>, rate: &Vector3<f64>, heading: &Local) -> (Euler, Euler) {
    let (sin, cos) = libm::sincos(heading.value);
    // Right and ahead of the heading; these axes turn with it.
    let (f_right, f_ahead) = (
        cos * thrust.x - sin * thrust.y,
        sin * thrust.x + cos * thrust.y,
    );
    let d_right = cos * rate.x - sin * rate.y - heading.slope * f_ahead;
    let d_ahead = sin * rate.x + cos * rate.y + heading.slope * f_right;
    let upright = libm::hypot(f_ahead, thrust.z);
    let upright_rate = (f_ahead * d_ahead + thrust.z * rate.z) / upright;
    let all2 = f_right * f_right + upright * upright;
    let angles = Euler {
        roll_rad: libm::atan2(f_right, upright),
        pitch_rad: -libm::atan2(f_ahead, thrust.z),
        heading_rad: heading.value,
    };
    let rates = Euler {
        roll_rad: (d_right * upright - f_right * upright_rate) / all2,
        pitch_rad: -(d_ahead * thrust.z - f_ahead * rate.z) / (upright * upright),
        heading_rad: heading.slope,
    };
    (angles, rates)
}
