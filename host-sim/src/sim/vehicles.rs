//! Kinematic models of other vehicles: a boat that swings at anchor, then sails; a pedestrian; a small
//! aircraft with steep turns, and a quadrotor with small, quick manoeuvres. Waves and steps are added by
//! [`super::motion::Oscillating`]; for forces on an aircraft see `crate::aircraft`.

use core::f64::consts::{PI, TAU};

use ins_core::attitude::Euler;
use nalgebra::Vector3;

use super::motion::{Kinematics, Motion, Path, kinematics, level};
use super::noise::Random;
use super::profile::{Point, Profile};
use crate::log::GRAVITY_MPS2;

/// Angle of attack at one g and its increase per further g: that of a light wing, rad.
const ATTACK_RAD: f64 = 0.05;
const ATTACK_RAD_PER_G: f64 = 0.07;
/// Drag of a small frame, m/s^2 per m/s.
const DRAG_PER_S: f64 = 0.3;

/// Swing at anchor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchored {
    /// Time of departure, s.
    pub until_s: f64,
    /// Period of the swing, s.
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
    const SPEED_MPS: [f64; 2] = [2.5, 7.0];
    /// Acceleration, m/s^2, and the time in which it builds up, s.
    const THROTTLE: [[f64; 2]; 2] = [[0.1, 0.4], [2.0, 5.0]];
    const STEADY_S: [f64; 2] = [10.0, 50.0];
    const TURN_RAD: [f64; 2] = [0.5, 2.5];
    /// Rate of turn, rad/s, and the time in which it builds up, s.
    const HELM: [[f64; 2]; 2] = [[0.05, 0.15], [3.0, 5.0]];
    /// From the anchor to the bow, m.
    const RODE_M: [f64; 2] = [15.0, 40.0];
    /// Time in which the swing decays under way.
    const FADE_S: f64 = 15.0;

    /// At least `duration_s` of it, chosen by `seed`.
    pub fn new(seed: u64, duration_s: f64, anchored: Anchored) -> Self {
        let mut random = Random::stream(seed, "helmsman");
        let mut fade = Profile::new(1.0);
        fade.step_to(0.0, anchored.until_s, 1.0, Self::FADE_S);
        let mut boat = Self {
            speed: Profile::new(0.0),
            course: Profile::new(PI * random.uniform([-1.0, 1.0])),
            fade,
            anchored,
            rode_m: random.uniform(Self::RODE_M),
            phase_rad: random.uniform([0.0, TAU]),
        };
        let mut now_s = anchored.until_s;
        while now_s < duration_s {
            now_s = boat.leg(&mut random, now_s);
        }
        boat
    }

    fn leg(&mut self, random: &mut Random, start_s: f64) -> f64 {
        let speed = random.uniform(Self::SPEED_MPS);
        let fast_s = (self.speed).step_drawn(random, speed, start_s, Self::THROTTLE);
        let turn_s = fast_s + random.uniform(Self::STEADY_S);
        let to = self.course.last_value() + random.uniform(Self::TURN_RAD) * random.sign();
        let turned_s = (self.course).step_drawn(random, to, turn_s, Self::HELM);
        turned_s + random.uniform(Self::STEADY_S)
    }

    /// The swing of the heading, with two derivatives.
    fn swing(&mut self, time_s: f64) -> Point {
        let omega = TAU / self.anchored.period_s;
        let amplitude = self.anchored.peak_radps / omega;
        let (sin, cos) = libm::sincos(omega * time_s + self.phase_rad);
        let fade = self.fade.at(time_s);
        Point {
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
        let heading = Point {
            integral: 0.0,
            value: course.value + swing.value,
            slope: course.slope + swing.slope,
            curvature: course.curvature + swing.curvature,
        };
        let path = Path::new(&along, &heading, 0.0, 0.0);
        // The bow points at the anchor: the boat moves on a circle about it.
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

#[derive(Clone, Debug)]
pub struct Walker {
    speed: Profile,
    heading: Profile,
}

impl Walker {
    const SPEED_MPS: [f64; 2] = [0.8, 1.8];
    /// Acceleration, m/s^2, and the time in which it builds up, s.
    const PACE: [[f64; 2]; 2] = [[0.5, 1.2], [0.4, 0.8]];
    const STEADY_S: [f64; 2] = [4.0, 25.0];
    const STOP_S: [f64; 2] = [2.0, 15.0];
    const TURN_RAD: [f64; 2] = [0.3, 1.8];
    /// Rate of turn, rad/s, and the time in which it builds up, s.
    const TURN: [[f64; 2]; 2] = [[0.5, 1.2], [0.4, 0.8]];

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
        let mut now_s = self.pace(random, Self::SPEED_MPS, start_s);
        now_s += random.uniform(Self::STEADY_S);
        let to = self.heading.last_value() + random.uniform(Self::TURN_RAD) * random.sign();
        now_s = (self.heading).step_drawn(random, to, now_s, Self::TURN);
        now_s += random.uniform(Self::STEADY_S);
        if random.chance(0.3) {
            now_s = self.pace(random, [0.0; 2], now_s) + random.uniform(Self::STOP_S);
        }
        now_s
    }

    fn pace(&mut self, random: &mut Random, speed_mps: [f64; 2], start_s: f64) -> f64 {
        let speed = random.uniform(speed_mps);
        (self.speed).step_drawn(random, speed, start_s, Self::PACE)
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

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Begin {
    /// Half a minute on the ground, then take-off.
    OnGround,
    InFlight,
}

/// An aircraft in coordinated turns and a constant wind.
#[derive(Clone, Debug)]
pub struct Plane {
    speed: Profile,
    heading: Profile,
    climb: Profile,
    wind_mps: Vector3<f64>,
}

impl Plane {
    const SPEED_MPS: [f64; 2] = [18.0, 28.0];
    /// Acceleration, m/s^2, and the time in which it builds up, s.
    const THROTTLE: [[f64; 2]; 2] = [[1.0, 2.0], [1.5, 3.0]];
    const TAKE_OFF_MPS2: f64 = 3.0;
    const STRAIGHT_S: [f64; 2] = [4.0, 20.0];
    const TURN_RAD: [f64; 2] = [0.8, 7.0];
    /// Time in which a bank builds up.
    const ROLL_IN_S: [f64; 2] = [1.5, 2.5];
    const CLIMB_RAD: [f64; 2] = [-0.1, 0.12];
    const CLIMB_RATE_RADPS: f64 = 0.05;
    const ROUND_OUT_S: f64 = 1.5;
    const WIND_MPS: f64 = 3.0;

    /// A flight of at least `duration_s`, chosen by `seed`, its turns banked between two angles.
    pub fn new(seed: u64, duration_s: f64, bank_rad: [f64; 2], begin: Begin) -> Self {
        let mut random = Random::stream(seed, "pilot");
        let heading = Profile::new(PI * random.uniform([-1.0, 1.0]));
        let wind = Vector3::new(random.normal(), random.normal(), 0.0);
        let in_flight = begin == Begin::InFlight;
        let cruise = random.uniform(Self::SPEED_MPS);
        let mut plane = Self {
            speed: Profile::new(if in_flight { cruise } else { 0.0 }),
            heading,
            climb: Profile::new(0.0),
            // A start on the ground is without wind, which would move the aircraft.
            wind_mps: Self::WIND_MPS * if in_flight { wind } else { Vector3::zeros() },
        };
        let mut now_s = random.uniform(Self::STRAIGHT_S);
        if !in_flight {
            now_s += 30.0;
            let [_, [_, throttle_s]] = Self::THROTTLE;
            now_s = (plane.speed).step_to(cruise, now_s, Self::TAKE_OFF_MPS2, throttle_s);
            now_s = plane.change_climb(Self::CLIMB_RAD[1], now_s);
        }
        while now_s < duration_s {
            now_s = plane.leg(&mut random, now_s, bank_rad);
        }
        plane
    }

    /// A straight, a change of speed or of climb, and a turn.
    fn leg(&mut self, random: &mut Random, start_s: f64, bank_rad: [f64; 2]) -> f64 {
        let mut now_s = start_s + random.uniform(Self::STRAIGHT_S);
        if random.chance(0.5) {
            let climb = random.uniform(Self::CLIMB_RAD);
            now_s = self.change_climb(climb, now_s);
        } else {
            let speed = random.uniform(Self::SPEED_MPS);
            now_s = (self.speed).step_drawn(random, speed, now_s, Self::THROTTLE);
        }
        now_s += random.uniform(Self::STRAIGHT_S);
        let angle = random.uniform(Self::TURN_RAD) * random.sign();
        let bank = random.uniform(bank_rad);
        let rate = GRAVITY_MPS2 * libm::tan(bank) / self.speed.last_value();
        let to = self.heading.last_value() + angle;
        self.heading
            .step_to(to, now_s, rate, random.uniform(Self::ROLL_IN_S))
    }

    fn change_climb(&mut self, to_rad: f64, start_s: f64) -> f64 {
        let (rate, round_s) = (Self::CLIMB_RATE_RADPS, Self::ROUND_OUT_S);
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

#[derive(Clone, Debug)]
pub struct Quadrotor {
    east: Profile,
    north: Profile,
    up: Profile,
    heading: Profile,
}

impl Quadrotor {
    const LEVEL_MPS: [f64; 2] = [-4.0, 4.0];
    /// Acceleration, m/s^2, and the time of a tilt to it, s.
    const LEVEL: [[f64; 2]; 2] = [[1.0, 4.0], [0.3, 0.7]];
    const UP_MPS: [f64; 2] = [-1.0, 1.0];
    const UP: [[f64; 2]; 2] = [[0.5, 2.0], [0.3, 0.7]];
    const PAUSE_S: [f64; 2] = [0.5, 5.0];
    const TURN_RAD: [f64; 2] = [-1.6, 1.6];
    /// Rate of turn, rad/s, and the time in which it builds up, s.
    const TURN: [[f64; 2]; 2] = [[0.4, 1.5], [0.3, 0.6]];
    const STEADY_S: [f64; 2] = [4.0, 20.0];
    const TAKE_OFF_MPS: f64 = 1.5;

    /// A flight of at least `duration_s`, chosen by `seed`, after a time on the ground; without
    /// one it begins in the air, under way.
    pub fn new(seed: u64, duration_s: f64, ground_s: Option<f64>) -> Self {
        let mut random = Random::stream(seed, "quadrotor");
        let heading = Profile::new(PI * random.uniform([-1.0, 1.0]));
        let start = |random: &mut Random| match ground_s {
            Some(_) => Profile::new(0.0),
            None => Profile::new(random.uniform(Self::LEVEL_MPS)),
        };
        let mut quadrotor = Self {
            east: start(&mut random),
            north: start(&mut random),
            up: Profile::new(0.0),
            heading,
        };
        let mut free_s = 0.0;
        if let Some(ground_s) = ground_s {
            let up_s = quadrotor.up.step_to(Self::TAKE_OFF_MPS, ground_s, 1.0, 0.7);
            free_s = quadrotor.up.step_to(0.0, up_s + 4.0, 1.0, 0.7);
        }
        for (profile, speeds, tilt) in [
            (&mut quadrotor.east, Self::LEVEL_MPS, Self::LEVEL),
            (&mut quadrotor.north, Self::LEVEL_MPS, Self::LEVEL),
            (&mut quadrotor.up, Self::UP_MPS, Self::UP),
        ] {
            let mut now_s = free_s;
            while now_s < duration_s {
                now_s += random.uniform(Self::PAUSE_S);
                let speed = random.uniform(speeds);
                now_s = profile.step_drawn(&mut random, speed, now_s, tilt);
            }
        }
        let mut now_s = free_s;
        while now_s < duration_s {
            now_s += random.uniform(Self::STEADY_S);
            let to = quadrotor.heading.last_value() + random.uniform(Self::TURN_RAD);
            now_s = (quadrotor.heading).step_drawn(&mut random, to, now_s, Self::TURN);
        }
        quadrotor
    }
}

impl Motion for Quadrotor {
    fn kinematics(&mut self, time_s: f64) -> Kinematics {
        let [e, n, u] = [&mut self.east, &mut self.north, &mut self.up].map(|p| p.at(time_s));
        let heading = self.heading.at(time_s);
        let three = |of: fn(&Point) -> f64| Vector3::new(of(&e), of(&n), of(&u));
        let (velocity, acceleration) = (three(|x| x.value), three(|x| x.slope));
        // Thrust balances gravity and drag and gives the acceleration; it is along the up axis.
        let thrust = acceleration + DRAG_PER_S * velocity + Vector3::new(0.0, 0.0, GRAVITY_MPS2);
        let thrust_rate = three(|x| x.curvature) + DRAG_PER_S * acceleration;
        let (angles, rates) = thrust_angles(&thrust, &thrust_rate, &heading);
        kinematics(velocity, acceleration, &angles, &rates)
    }
}

/// Angles that put the up axis along a thrust, and their rates.
fn thrust_angles(thrust: &Vector3<f64>, rate: &Vector3<f64>, heading: &Point) -> (Euler, Euler) {
    let (sin, cos) = libm::sincos(heading.value);
    // Right and ahead of the heading; these axes turn with it.
    let (f_right, f_ahead) = (
        cos * thrust.x - sin * thrust.y,
        sin * thrust.x + cos * thrust.y,
    );
    let d_right = cos * rate.x - sin * rate.y - heading.slope * f_ahead;
    let d_ahead = sin * rate.x + cos * rate.y + heading.slope * f_right;
    let ahead_up = libm::hypot(f_ahead, thrust.z);
    let ahead_up_rate = (f_ahead * d_ahead + thrust.z * rate.z) / ahead_up;
    let all2 = f_right * f_right + ahead_up * ahead_up;
    let angles = Euler {
        roll_rad: libm::atan2(f_right, ahead_up),
        pitch_rad: -libm::atan2(f_ahead, thrust.z),
        heading_rad: heading.value,
    };
    let rates = Euler {
        roll_rad: (d_right * ahead_up - f_right * ahead_up_rate) / all2,
        pitch_rad: -(d_ahead * thrust.z - f_ahead * rate.z) / (ahead_up * ahead_up),
        heading_rad: heading.slope,
    };
    (angles, rates)
}
