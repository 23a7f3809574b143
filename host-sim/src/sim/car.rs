//! A car and its driver.
//!
//! Speed and heading are smooth functions of time, grade of the distance travelled, so that every
//! derivative is exact. A stationary car is exactly at rest.

use ins_core::attitude::Euler;

use super::motion::{Kinematics, Motion, Path, kinematics};
use super::noise::Random;
use super::profile::Profile;
use crate::log::GRAVITY_MPS2;

/// Pitch, nose up, by acceleration, and roll, outwards, by lateral acceleration. Typical of a family car
/// (1.5 and 4 degrees per g).
const PITCH_RAD_PER_MPS2: f64 = 0.0027;
const ROLL_RAD_PER_MPS2: f64 = 0.007;

/// Bounds between which the driver's choices are drawn.
mod limits {
    pub const ACCELERATION_MPS2: [f64; 2] = [1.5, 2.5];
    pub const PEDAL_S: [f64; 2] = [0.8, 1.4];
    pub const CRUISE_MPS: [f64; 2] = [9.0, 20.0];
    pub const FAST_MPS: [f64; 2] = [20.0, 25.0];
    pub const CRUISE_S: [f64; 2] = [3.0, 16.0];
    pub const STOP_S: [f64; 2] = [5.0, 25.0];
    pub const CORNER_MPS: [f64; 2] = [5.0, 9.0];
    pub const U_TURN_MPS: [f64; 2] = [4.0, 6.0];
    pub const CORNER_MPS2: [f64; 2] = [1.5, 3.0];
    pub const BEND_MPS2: [f64; 2] = [0.4, 1.5];
    pub const BEND_RAD: [f64; 2] = [0.05, 0.5];
    pub const RAMP_RAD: [f64; 2] = [1.5, 4.5];
    pub const RAMP_MPS2: [f64; 2] = [1.5, 3.0];
    pub const MOTORWAY_MPS: [f64; 2] = [25.0, 36.0];
    pub const STRAIGHT_S: [f64; 2] = [25.0, 60.0];
    pub const LANE_RAD: [f64; 2] = [0.02, 0.05];
    pub const STEERING_S: [f64; 2] = [1.0, 1.6];
    /// Overlap of consecutive manoeuvres.
    pub const OVERLAP_S: f64 = 0.4;
    pub const GRADE_RAD: [f64; 2] = [-0.04, 0.04];
    pub const GRADE_PER_M: f64 = 8e-4;
    pub const GRADE_ROUNDING_M: [f64; 2] = [40.0, 100.0];
    pub const SLOPE_LENGTH_M: [f64; 2] = [100.0, 500.0];
}

/// Bounds of a route of straights and turns, the same over its whole length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RouteBounds {
    pub rest_s: [f64; 2],
    pub speed_mps: [f64; 2],
    pub straight_s: [f64; 2],
    /// Stops at the ends of straights, s, where there are any.
    pub stop_s: Option<[f64; 2]>,
    pub turn_rad: [f64; 2],
    /// Lateral acceleration in turns, m/s^2.
    pub lateral_mps2: [f64; 2],
    /// Roll, inwards, by that, rad/(m/s^2).
    pub roll_rad_per_mps2: f64,
    /// Factor on the grade of roads for cars, which is 4 % at most.
    pub steep: f64,
}

impl RouteBounds {
    /// A family car on country roads.
    pub const ROAD: Self = Self {
        rest_s: [30.0, 60.0],
        speed_mps: [8.0, 20.0],
        straight_s: [5.0, 25.0],
        stop_s: None,
        turn_rad: [0.2, 1.5],
        lateral_mps2: [0.5, 2.0],
        roll_rad_per_mps2: -ROLL_RAD_PER_MPS2,
        steep: 1.0,
    };
    /// Roll of vehicles that balance: the specific force is along their up axis.
    pub const BALANCED: f64 = 1.0 / GRAVITY_MPS2;
}

#[derive(Clone, Debug)]
pub struct Car {
    speed: Profile,
    heading: Profile,
    grade: Profile,
    lean: f64,
    /// Inwards.
    roll_rad_per_mps2: f64,
}

impl Car {
    /// A drive of at least `duration_s`, chosen by `seed`; it begins at rest for a time within
    /// the bounds given, or in motion.
    pub fn new(seed: u64, duration_s: f64, initial_rest_s: Option<[f64; 2]>) -> Self {
        let mut driver = Driver::new(seed, initial_rest_s);
        while driver.course.now_s < duration_s {
            driver.leg();
        }
        Self::on_road(driver, seed, duration_s, 1.0)
    }

    /// At least `duration_s` of a route, chosen by `seed`.
    pub fn on_route(seed: u64, duration_s: f64, bounds: &RouteBounds) -> Self {
        let mut driver = Driver::new(seed, Some(bounds.rest_s));
        while driver.course.now_s < duration_s {
            driver.straight_and_turn(bounds);
        }
        Self {
            roll_rad_per_mps2: bounds.roll_rad_per_mps2,
            ..Self::on_road(driver, seed, duration_s, bounds.steep)
        }
    }

    /// At least `duration_s` on a motorway, chosen by `seed`: it begins in motion in the bend of a
    /// ramp, and changes lane and speed every minute or two.
    pub fn on_motorway(seed: u64, duration_s: f64) -> Self {
        let mut driver = Driver::new(seed, None);
        driver.course.now_s = 0.0;
        let ramp = driver.random.uniform(limits::RAMP_RAD) * driver.random.sign();
        driver.turn(ramp, limits::RAMP_MPS2);
        while driver.course.now_s < duration_s {
            let speed = driver.random.uniform(limits::MOTORWAY_MPS);
            driver.change_speed(speed);
            driver.course.now_s += driver.random.uniform(limits::STRAIGHT_S);
            let lane = driver.random.uniform(limits::LANE_RAD) * driver.random.sign();
            driver.turn(lane, limits::BEND_MPS2);
            driver.turn(-lane, limits::BEND_MPS2);
            driver.course.now_s += driver.random.uniform(limits::STRAIGHT_S);
        }
        Self::on_road(driver, seed, duration_s, 1.0)
    }

    /// A drive on a road with a factor on its grade.
    fn on_road(driver: Driver, seed: u64, duration_s: f64, steep: f64) -> Self {
        let mut car = Self::on_profile(driver.course);
        let length_m = car.speed.at(duration_s).integral;
        car.grade = road(seed, length_m, steep);
        car
    }

    /// A given drive.
    pub(crate) fn on_profile(course: DriveProfile) -> Self {
        let DriveProfile {
            speed,
            heading,
            grade,
            ..
        } = course;
        Self {
            speed,
            heading,
            grade,
            lean: 1.0,
            roll_rad_per_mps2: -ROLL_RAD_PER_MPS2,
        }
    }

    /// The same drive in a car with a factor on roll and pitch.
    #[must_use]
    pub fn leaning(self, lean: f64) -> Self {
        Self {
            lean,
            roll_rad_per_mps2: -lean * ROLL_RAD_PER_MPS2,
            ..self
        }
    }
}

impl Motion for Car {
    fn kinematics(&mut self, time_s: f64) -> Kinematics {
        let along = self.speed.at(time_s);
        let heading = self.heading.at(time_s);
        let grade = self.grade.at(along.integral);

        let grade_rate = grade.slope * along.value;
        let path = Path::new(&along, &heading, grade.value, grade_rate);
        let angles = Euler {
            roll_rad: self.roll_rad_per_mps2 * path.lateral_mps2,
            pitch_rad: grade.value + self.lean * PITCH_RAD_PER_MPS2 * along.slope,
            heading_rad: heading.value,
        };
        let rates = Euler {
            roll_rad: self.roll_rad_per_mps2 * path.lateral_rate_mps3,
            pitch_rad: grade_rate + self.lean * PITCH_RAD_PER_MPS2 * along.curvature,
            heading_rad: heading.slope,
        };
        kinematics(path.velocity_mps, path.acceleration_mps2, &angles, &rates)
    }
}

/// Grade along a road of some length.
fn road(seed: u64, length_m: f64, steep: f64) -> Profile {
    let mut random = Random::stream(seed, "road");
    let mut profile = Profile::new(steep * random.uniform(limits::GRADE_RAD));
    let mut at_m = 0.0;
    while at_m < length_m {
        at_m += random.uniform(limits::SLOPE_LENGTH_M);
        let grade = steep * random.uniform(limits::GRADE_RAD);
        let rounding_m = random.uniform(limits::GRADE_ROUNDING_M);
        at_m = profile.step_to(grade, at_m, steep * limits::GRADE_PER_M, rounding_m);
    }
    profile
}

/// Speed, heading and grade of a drive, built manoeuvre by manoeuvre.
#[derive(Clone, Debug)]
pub(crate) struct DriveProfile {
    speed: Profile,
    heading: Profile,
    grade: Profile,
    /// Its end so far.
    pub(crate) now_s: f64,
}

impl DriveProfile {
    /// At a speed in a heading, on a level road.
    pub(crate) fn new(speed_mps: f64, heading_rad: f64) -> Self {
        Self {
            speed: Profile::new(speed_mps),
            heading: Profile::new(heading_rad),
            grade: Profile::new(0.0),
            now_s: 0.0,
        }
    }

    pub(crate) fn speed_mps(&self) -> f64 {
        self.speed.last_value()
    }

    /// Changes speed; the pedal takes a time to go down and up.
    pub(crate) fn change_speed(&mut self, to_mps: f64, acceleration_mps2: f64, pedal_s: f64) {
        self.now_s = (self.speed).step_to(to_mps, self.now_s, acceleration_mps2, pedal_s);
    }

    /// Turns, clockwise positive, at a rate; the steering wheel takes a time to turn and return.
    pub(crate) fn turn(&mut self, angle_rad: f64, rate_radps: f64, steering_s: f64) {
        let heading = self.heading.last_value() + angle_rad;
        self.now_s = (self.heading).step_to(heading, self.now_s, rate_radps, steering_s);
    }

    /// Changes the grade over a transition of `rounding_m` or more, and keeps it for a length.
    pub(crate) fn change_grade(&mut self, to_rad: f64, rounding_m: f64, length_m: f64) {
        let along = self.speed.at(self.now_s);
        let start_m = along.integral;
        let end_m = (self.grade).step_to(to_rad, start_m, limits::GRADE_PER_M, rounding_m);
        self.now_s += (end_m + length_m - start_m) / along.value;
    }
}

/// Plans the drive, manoeuvre after manoeuvre.
struct Driver {
    random: Random,
    course: DriveProfile,
}

impl Driver {
    fn new(seed: u64, initial_rest_s: Option<[f64; 2]>) -> Self {
        let mut random = Random::stream(seed, "driver");
        let heading_rad = core::f64::consts::PI * random.uniform([-1.0, 1.0]);
        let speed_mps = if initial_rest_s.is_some() {
            0.0
        } else {
            random.uniform(limits::CRUISE_MPS)
        };
        let mut course = DriveProfile::new(speed_mps, heading_rad);
        course.now_s = random.uniform(initial_rest_s.unwrap_or(limits::CRUISE_S));
        Self { random, course }
    }

    /// Gain speed, cruise, then stop, turn, or change speed.
    fn leg(&mut self) {
        let fast = self.random.chance(0.1);
        let cruise = self.random.uniform(if fast {
            limits::FAST_MPS
        } else {
            limits::CRUISE_MPS
        });
        self.change_speed(cruise);
        self.cruise();
        let choice = self.random.unit();
        if choice < 0.4 {
            self.change_speed(0.0);
            self.course.now_s += self.random.uniform(limits::STOP_S);
        } else if choice < 0.9 {
            let u_turn = choice < 0.55;
            let (speeds, degrees) = if u_turn {
                (limits::U_TURN_MPS, 180.0_f64)
            } else {
                (limits::CORNER_MPS, 90.0)
            };
            let corner = self.random.uniform(speeds);
            self.change_speed(corner);
            self.course.now_s -= limits::OVERLAP_S;
            let angle = degrees.to_radians() * self.random.sign();
            self.turn(angle, limits::CORNER_MPS2);
            self.course.now_s -= limits::OVERLAP_S;
        }
    }

    /// A straight, a stop if there are any, and a turn.
    fn straight_and_turn(&mut self, bounds: &RouteBounds) {
        let speed = self.random.uniform(bounds.speed_mps);
        self.change_speed(speed);
        self.course.now_s += self.random.uniform(bounds.straight_s);
        if let Some(stop_s) = bounds.stop_s {
            self.change_speed(0.0);
            self.course.now_s += self.random.uniform(stop_s);
            self.change_speed(speed);
        }
        let angle = self.random.uniform(bounds.turn_rad) * self.random.sign();
        self.turn(angle, bounds.lateral_mps2);
    }

    fn cruise(&mut self) {
        self.course.now_s += self.random.uniform(limits::CRUISE_S);
        if self.random.chance(0.5) {
            let angle = self.random.uniform(limits::BEND_RAD) * self.random.sign();
            self.turn(angle, limits::BEND_MPS2);
            self.course.now_s += self.random.uniform(limits::CRUISE_S);
        }
    }

    fn change_speed(&mut self, to_mps: f64) {
        let acceleration = self.random.uniform(limits::ACCELERATION_MPS2);
        let pedal_s = self.random.uniform(limits::PEDAL_S);
        self.course.change_speed(to_mps, acceleration, pedal_s);
    }

    fn turn(&mut self, angle_rad: f64, lateral_mps2: [f64; 2]) {
        let rate = self.random.uniform(lateral_mps2) / self.course.speed_mps();
        let steering_s = self.random.uniform(limits::STEERING_S);
        self.course.turn(angle_rad, rate, steering_s);
    }
}
