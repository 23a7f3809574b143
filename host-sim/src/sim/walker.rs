//! A person on foot. The bobbing of the steps is a [`super::shaken::Shaken`] on top.

use core::f64::consts::PI;

use super::motion::{Kinematics, Motion, Path, kinematics, level};
use super::noise::Random;
use super::profile::Profile;

mod habits {
    pub const SPEED_MPS: [f64; 2] = [0.8, 1.8];
    /// Acceleration, m/s^2, and the time in which it builds up, s.
    pub const PACE: [[f64; 2]; 2] = [[0.5, 1.2], [0.4, 0.8]];
    pub const STEADY_S: [f64; 2] = [4.0, 25.0];
    pub const STOP_S: [f64; 2] = [2.0, 15.0];
    pub const TURN_RAD: [f64; 2] = [0.3, 1.8];
    /// Rate of turn, rad/s, and the time in which it builds up, s.
    pub const TURN: [[f64; 2]; 2] = [[0.5, 1.2], [0.4, 0.8]];
}

#[derive(Clone, Debug)]
pub struct Walker {
    speed: Profile,
    heading: Profile,
}

impl Walker {
    /// At least `duration_s` of a walk, chosen by `seed`, after standing for `rest_s`.
    pub fn new(seed: u64, duration_s: f64, rest_s: f64) -> Self {
        let mut random = Random::stream(seed, "walker");
        let mut walker = Self {
            speed: Profile::new(0.0),
            heading: Profile::new(PI * random.uniform([-1.0, 1.0])),
        };
        let mut now_s = rest_s;
        while now_s < duration_s {
            now_s = walker.leg(&mut random, now_s);
        }
        walker
    }

    fn leg(&mut self, random: &mut Random, start_s: f64) -> f64 {
        let mut now_s = self.pace(random, habits::SPEED_MPS, start_s);
        now_s += random.uniform(habits::STEADY_S);
        let to = self.heading.last_value() + random.uniform(habits::TURN_RAD) * random.sign();
        now_s = (self.heading).step_drawn(random, to, now_s, habits::TURN);
        now_s += random.uniform(habits::STEADY_S);
        if random.chance(0.3) {
            now_s = self.pace(random, [0.0; 2], now_s) + random.uniform(habits::STOP_S);
        }
        now_s
    }

    fn pace(&mut self, random: &mut Random, speed_mps: [f64; 2], start_s: f64) -> f64 {
        let speed = random.uniform(speed_mps);
        (self.speed).step_drawn(random, speed, start_s, habits::PACE)
    }
}

impl Motion for Walker {
    fn kinematics(&mut self, time_s: f64) -> Kinematics {
        let along = self.speed.at(time_s);
        let heading = self.heading.at(time_s);
        let path = Path::new(&along, &heading, 0.0, 0.0);
        let [angles, rates] = level(&heading);
        kinematics(path.velocity_mps, path.acceleration_mps2, &angles, &rates)
    }
}
