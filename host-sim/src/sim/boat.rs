//! A boat that swings at anchor, then sails. Waves are a [`super::shaken::Shaken`] on top.

use core::f64::consts::{PI, TAU};

use nalgebra::Vector3;

use super::motion::{Kinematics, Motion, Path, kinematics, level};
use super::noise::Random;
use super::profile::{Local, Profile};

/// Bounds of what the boat does under way.
mod habits {
    pub const SPEED_MPS: [f64; 2] = [2.5, 7.0];
    /// Acceleration, m/s^2, and the time in which it builds up, s.
    pub const THROTTLE: [[f64; 2]; 2] = [[0.1, 0.4], [2.0, 5.0]];
    pub const STEADY_S: [f64; 2] = [10.0, 50.0];
    pub const TURN_RAD: [f64; 2] = [0.5, 2.5];
    /// Rate of turn, rad/s, and the time in which it builds up, s.
    pub const HELM: [[f64; 2]; 2] = [[0.05, 0.15], [3.0, 5.0]];
    /// From the anchor to the bow, m.
    pub const RODE_M: [f64; 2] = [15.0, 40.0];
    /// Time in which the swinging dies away under way.
    pub const FADE_S: f64 = 15.0;
}

/// How it swings at anchor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchored {
    /// When it sails, s.
    pub until_s: f64,
    /// From one end to the same end, s.
    pub period_s: f64,
    pub peak_radps: f64,
}

#[derive(Clone, Debug)]
pub struct Boat {
    speed: Profile,
    course: Profile,
    fade: Profile,
    anchored: Anchored,
    rode_m: f64,
    phase_rad: f64,
}

impl Boat {
    /// At least `duration_s` of it, chosen by `seed`.
    pub fn new(seed: u64, duration_s: f64, anchored: Anchored) -> Self {
        let mut random = Random::stream(seed, "helmsman");
        let mut fade = Profile::new(1.0);
        fade.step_to(0.0, anchored.until_s, 1.0, habits::FADE_S);
        let mut boat = Self {
            speed: Profile::new(0.0),
            course: Profile::new(PI * random.uniform([-1.0, 1.0])),
            fade,
            anchored,
            rode_m: random.uniform(habits::RODE_M),
            phase_rad: random.uniform([0.0, TAU]),
        };
        let mut now_s = anchored.until_s;
        while now_s < duration_s {
            now_s = boat.leg(&mut random, now_s);
        }
        boat
    }

    fn leg(&mut self, random: &mut Random, start_s: f64) -> f64 {
        let speed = random.uniform(habits::SPEED_MPS);
        let fast_s = (self.speed).step_drawn(random, speed, start_s, habits::THROTTLE);
        let turn_s = fast_s + random.uniform(habits::STEADY_S);
        let to = self.course.last_value() + random.uniform(habits::TURN_RAD) * random.sign();
        let turned_s = (self.course).step_drawn(random, to, turn_s, habits::HELM);
        turned_s + random.uniform(habits::STEADY_S)
    }

    /// The swing of the heading, with two derivatives.
    fn swing(&mut self, time_s: f64) -> Local {
        let omega = TAU / self.anchored.period_s;
        let amplitude = self.anchored.peak_radps / omega;
        let (sin, cos) = libm::sincos(omega * time_s + self.phase_rad);
        let fade = self.fade.at(time_s);
        Local {
            integral: 0.0,
            value: amplitude * fade.value * sin,
            slope: amplitude * (fade.slope * sin + fade.value * omega * cos),
            curvature: amplitude
                * (fade.curvature * sin + 2.0 * fade.slope * omega * cos
                    - fade.value * omega * omega * sin),
        }
    }
}

impl Motion for Boat {
    fn kinematics(&mut self, time_s: f64) -> Kinematics {
        let along = self.speed.at(time_s);
        let course = self.course.at(time_s);
        let swing = self.swing(time_s);
        let heading = Local {
            integral: 0.0,
            value: course.value + swing.value,
            slope: course.slope + swing.slope,
            curvature: course.curvature + swing.curvature,
        };
        let path = Path::new(&along, &heading, 0.0, 0.0);
        // The bow points at the anchor: the boat goes round it.
        let (sin, cos) = libm::sincos(heading.value);
        let (ahead, right) = (Vector3::new(sin, cos, 0.0), Vector3::new(cos, -sin, 0.0));
        let round = -self.rode_m * swing.slope * right;
        let round_rate =
            self.rode_m * (swing.slope * heading.slope * ahead - swing.curvature * right);
        let [angles, rates] = level(&heading);
        let velocity = path.velocity_mps + round;
        let acceleration = path.acceleration_mps2 + round_rate;
        kinematics(velocity, acceleration, &angles, &rates)
    }
}
