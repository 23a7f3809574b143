//! A small fixed-wing aircraft that turns in steep banks: a kinematic one, cheap. For forces see
//! `crate::aircraft`.

use ins_core::attitude::Euler;
use nalgebra::Vector3;

use super::motion::{Kinematics, Motion, Path, kinematics};
use super::noise::Random;
use super::profile::Profile;

const GRAVITY_MPS2: f64 = 9.81;
/// Angle of attack at one g and what every further g adds: that of a light wing, rad.
const ATTACK_RAD: f64 = 0.05;
const ATTACK_RAD_PER_G: f64 = 0.07;

/// Bounds between which the pilot chooses.
mod habits {
    pub const SPEED_MPS: [f64; 2] = [18.0, 28.0];
    /// Acceleration, m/s^2, and the time in which it builds up, s.
    pub const THROTTLE: [[f64; 2]; 2] = [[1.0, 2.0], [1.5, 3.0]];
    pub const TAKE_OFF_MPS2: f64 = 3.0;
    pub const STRAIGHT_S: [f64; 2] = [4.0, 20.0];
    pub const TURN_RAD: [f64; 2] = [0.8, 7.0];
    /// Time in which a bank builds up.
    pub const ROLL_IN_S: [f64; 2] = [1.5, 2.5];
    pub const CLIMB_RAD: [f64; 2] = [-0.1, 0.12];
    pub const CLIMB_RATE_RADPS: f64 = 0.05;
    pub const ROUND_OUT_S: f64 = 1.5;
    pub const WIND_MPS: f64 = 3.0;
}

/// How a flight begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Begin {
    /// Half a minute on the ground, then take-off.
    OnGround,
    InFlight,
}

/// An aircraft on its way, in coordinated turns and a steady wind.
#[derive(Clone, Debug)]
pub struct Plane {
    speed: Profile,
    heading: Profile,
    climb: Profile,
    wind_mps: Vector3<f64>,
}

impl Plane {
    /// A flight of at least `duration_s`, chosen by `seed`, its turns banked between two angles.
    pub fn new(seed: u64, duration_s: f64, bank_rad: [f64; 2], begin: Begin) -> Self {
        let mut random = Random::stream(seed, "pilot");
        let heading = Profile::new(core::f64::consts::PI * random.uniform([-1.0, 1.0]));
        let wind = Vector3::new(random.normal(), random.normal(), 0.0);
        let in_flight = begin == Begin::InFlight;
        let cruise = random.uniform(habits::SPEED_MPS);
        let mut plane = Self {
            speed: Profile::new(if in_flight { cruise } else { 0.0 }),
            heading,
            climb: Profile::new(0.0),
            // On the ground the wind does not carry it: then there is none.
            wind_mps: habits::WIND_MPS * if in_flight { wind } else { Vector3::zeros() },
        };
        let mut now_s = random.uniform(habits::STRAIGHT_S);
        if !in_flight {
            now_s += 30.0;
            let [_, [_, throttle_s]] = habits::THROTTLE;
            now_s = (plane.speed).step_to(cruise, now_s, habits::TAKE_OFF_MPS2, throttle_s);
            now_s = plane.change_climb(habits::CLIMB_RAD[1], now_s);
        }
        while now_s < duration_s {
            now_s = plane.leg(&mut random, now_s, bank_rad);
        }
        plane
    }

    /// A straight, a change of speed or of climb, and a turn.
    fn leg(&mut self, random: &mut Random, start_s: f64, bank_rad: [f64; 2]) -> f64 {
        let mut now_s = start_s + random.uniform(habits::STRAIGHT_S);
        if random.chance(0.5) {
            let climb = random.uniform(habits::CLIMB_RAD);
            now_s = self.change_climb(climb, now_s);
        } else {
            let speed = random.uniform(habits::SPEED_MPS);
            now_s = (self.speed).step_drawn(random, speed, now_s, habits::THROTTLE);
        }
        now_s += random.uniform(habits::STRAIGHT_S);
        let angle = random.uniform(habits::TURN_RAD) * random.sign();
        let bank = random.uniform(bank_rad);
        let rate = GRAVITY_MPS2 * libm::tan(bank) / self.speed.last_value();
        let to = self.heading.last_value() + angle;
        self.heading
            .step_to(to, now_s, rate, random.uniform(habits::ROLL_IN_S))
    }

    fn change_climb(&mut self, to_rad: f64, start_s: f64) -> f64 {
        let (rate, round_s) = (habits::CLIMB_RATE_RADPS, habits::ROUND_OUT_S);
        self.climb.step_to(to_rad, start_s, rate, round_s)
    }
}

impl Motion for Plane {
    fn kinematics(&mut self, time_s: f64) -> Kinematics {
        let along = self.speed.at(time_s);
        let heading = self.heading.at(time_s);
        let climb = self.climb.at(time_s);
        let path = Path::new(&along, &heading, climb.value, climb.slope);
        // Tangent of the bank, load factor.
        let tangent = path.lateral_mps2 / GRAVITY_MPS2;
        let tangent_rate = path.lateral_rate_mps3 / GRAVITY_MPS2;
        let load = libm::hypot(1.0, tangent);
        let load_rate = tangent * tangent_rate / load;
        let angles = Euler {
            roll_rad: libm::atan(tangent),
            pitch_rad: climb.value + ATTACK_RAD + ATTACK_RAD_PER_G * (load - 1.0),
            heading_rad: heading.value,
        };
        let rates = Euler {
            roll_rad: tangent_rate / (load * load),
            pitch_rad: climb.slope + ATTACK_RAD_PER_G * load_rate,
            heading_rad: heading.slope,
        };
        kinematics(
            path.velocity_mps + self.wind_mps,
            path.acceleration_mps2,
            &angles,
            &rates,
        )
    }
}
