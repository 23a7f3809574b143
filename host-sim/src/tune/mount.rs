//! How the unit stands on a vehicle that goes where it points.
//!
//! Every second of straight motion shows the unit's attitude against the course, level across. A car
//! goes where it points. So does an aircraft but for the wind, which comes from all sides once it
//! has flown all ways, and for its angle of attack. A multicopter goes anywhere.

use ins_core::attitude::{self, Euler};
use ins_core::earth::{GRAVITY_EQUATOR_MPS2, wrap_pi};
use ins_core::{Estimates, Solution};
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use super::found::Found;
use crate::identify::free_inertial::known;
use crate::identify::row::Row;
use crate::log;

/// Slower than this the course is noise, m/s.
const SLOW_MPS: f64 = 4.0;
/// Turns of the course: below straight, above turning, rad/s; and seconds of either that are enough.
const STRAIGHT_RADPS: f64 = 0.03;
const TURNING_RADPS: f64 = 0.1;
const ENOUGH: [usize; 2] = [30, 10];
/// Seconds apart at which the scatter is new.
const INDEPENDENT_S: f64 = 10.0;
/// Scatter about the course beyond which a car, or an aircraft, does not go where it points, rad.
const SCATTER_RAD: [f64; 2] = [0.06, 0.12];
/// Bank, of what a coordinated turn takes: at most of a car, at least of an aircraft.
const BANK: [f64; 2] = [0.4, 0.6];
/// Roads fall to their side, rad.
const CROSSFALL_RAD: f64 = 0.01;

const NO_COURSE: &str = "drive or fly straight at 20 km/h and more for a minute, with some turns \
    between, a fixed wing in three directions, for the wind; what does not go where it points \
    (multicopter, boat, hand) has to be measured";
const NO_LEVEL: &str = "turn by 90 degrees and more, both ways, which shows the tilt";
const ATTACK: &str = "the angle of attack is part of it in flight: measure it on the ground";
const NO_WIND: &str = "fly straight legs in at least three directions, for the wind";

/// How it moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Vehicle {
    /// Drives where it points, level across.
    Car,
    /// Banks into turns, and flies where it points but for the wind.
    Aircraft,
    /// Neither.
    Other,
}

/// Attitude of the unit against the vehicle, rad: right side down, nose up, clockwise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Mount {
    pub vehicle: Vehicle,
    /// About the forward axis.
    pub roll_rad: Found,
    /// About the right axis.
    pub pitch_rad: Found,
    /// About the vertical.
    pub heading_rad: Found,
    /// Robust standard deviation of single seconds about roll, pitch and heading; none without.
    pub spread_rad: Option<[f64; 3]>,
}

/// The unit against the course at one second.
struct Second {
    course_rad: f64,
    turn_radps: f64,
    speed_mps: f64,
    against: Euler,
}

/// Median of angles, and the standard deviation that their median deviation is of.
struct Middle {
    value: f64,
    spread: f64,
}

impl Mount {
    pub fn new(history: &[Row], end: &Estimates) -> Self {
        let mut mount = Self {
            vehicle: Vehicle::Other,
            roll_rad: Found::unknown(NO_COURSE),
            pitch_rad: Found::unknown(NO_COURSE),
            heading_rad: Found::unknown(NO_COURSE),
            spread_rad: None,
        };
        let seconds: Vec<Second> = history.windows(3).filter_map(second).collect();
        let (straight, rest): (Vec<&Second>, Vec<&Second>) =
            (seconds.iter()).partition(|second| second.turn_radps.abs() < STRAIGHT_RADPS);
        if straight.len() < ENOUGH[0] {
            return mount;
        }
        let all = |angle: fn(&Euler) -> f64| -> Vec<f64> {
            let angles = straight.iter().map(|second| angle(&second.against));
            angles.collect()
        };
        let (roll, pitch) = (middle(&all(|e| e.roll_rad)), middle(&all(|e| e.pitch_rad)));
        let heading = all(|e| e.heading_rad);
        let (plain, windless) = (middle(&heading), without_wind(&straight, &heading));
        mount.spread_rad = Some([roll.spread, pitch.spread, plain.spread]);
        let bank = bank(&rest, roll.value);
        let worst = |heading: &Middle| heading.spread.max(pitch.spread);
        let along = worst(windless.as_ref().unwrap_or(&pitch)) < SCATTER_RAD[1];
        mount.vehicle = match bank {
            Some(bank) if bank < BANK[0] && worst(&plain) < SCATTER_RAD[0] => Vehicle::Car,
            Some(bank) if bank > BANK[1] && along => Vehicle::Aircraft,
            _ => return mount,
        };
        let biases = &end.accel_bias_mps2[..2];
        let tilt = biases[0].sigma.hypot(biases[1].sigma) / GRAVITY_EQUATOR_MPS2;
        let no_level = (!biases.iter().all(known)).then_some(NO_LEVEL);
        let times = (straight.len() as f64 / INDEPENDENT_S).sqrt();
        let found = |middle: &Middle, systematic: f64| {
            let sigma = systematic.hypot(middle.spread / times);
            Found::known(wrap_pi(middle.value), sigma)
        };
        let azimuth = end.azimuth_error_rad.sigma;
        let is_car = mount.vehicle == Vehicle::Car;
        let fall = if is_car { CROSSFALL_RAD } else { 0.0 };
        mount.roll_rad = found(&roll, tilt.hypot(fall)).unless(no_level);
        mount.pitch_rad = found(&pitch, tilt)
            .unless((!is_car).then_some(ATTACK))
            .unless(no_level);
        let heading = if is_car { Some(plain) } else { windless };
        mount.heading_rad =
            heading.map_or(Found::unknown(NO_WIND), |heading| found(&heading, azimuth));
        mount
    }
}

/// The middle one of three rows a second apart; none if slow, or before the azimuth is known.
fn second(rows: &[Row]) -> Option<Second> {
    let [before, now, after] = [rows[0].solution?, rows[1].solution?, rows[2].solution?];
    let speed = |solution: &Solution| solution.velocity_enu_mps.xy().norm();
    let course = |s: &Solution| libm::atan2(s.velocity_enu_mps.x, s.velocity_enu_mps.y);
    let speeds = [&before, &now, &after].map(speed);
    let fast = speeds.iter().all(|mps| *mps > SLOW_MPS);
    let seconds = after.time.seconds_since(before.time);
    if !known(&rows[1].estimates.azimuth_error_rad) || !fast || seconds > 3.0 {
        return None;
    }
    let ahead = attitude::from_euler(&Euler {
        roll_rad: 0.0,
        pitch_rad: libm::atan2(now.velocity_enu_mps.z, speed(&now)),
        heading_rad: course(&now),
    });
    Some(Second {
        course_rad: course(&now),
        turn_radps: wrap_pi(course(&after) - course(&before)) / seconds,
        speed_mps: speed(&now),
        against: attitude::euler(&(ahead.inverse() * now.attitude)),
    })
}

/// On a circle, which has no ends.
fn middle(angles: &[f64]) -> Middle {
    let sum = |of: fn(f64) -> f64| angles.iter().copied().map(of).sum::<f64>();
    let about = libm::atan2(sum(libm::sin), sum(libm::cos));
    let off: Vec<f64> = angles.iter().map(|angle| wrap_pi(angle - about)).collect();
    let median = log::median(off.iter().copied());
    Middle {
        value: about + median,
        spread: 1.4826 * log::median(off.iter().map(|off| (off - median).abs())),
    }
}

/// Heading against the course with what a steady wind does to it, `a sin + b cos` of the course,
/// taken out by least squares; none if the courses do not tell it apart.
fn without_wind(straight: &[&Second], heading: &[f64]) -> Option<Middle> {
    let about = middle(heading).value;
    let shares = |s: &Second| Vector3::new(1.0, libm::sin(s.course_rad), libm::cos(s.course_rad));
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (second, angle) in straight.iter().zip(heading) {
        normal += shares(second) * shares(second).transpose();
        right += shares(second) * wrap_pi(angle - about);
    }
    // Of courses all around the least eigenvalue is half of their number.
    if normal.symmetric_eigenvalues().min() < 0.1 * straight.len() as f64 {
        return None;
    }
    let wind = (normal.try_inverse()? * right).component_mul(&Vector3::new(0.0, 1.0, 1.0));
    let pairs = straight.iter().zip(heading);
    let left: Vec<f64> = pairs
        .map(|(second, angle)| angle - shares(second).dot(&wind))
        .collect();
    Some(middle(&left))
}

/// Roll in turns against what a coordinated turn takes; none without turns.
fn bank(rest: &[&Second], level_rad: f64) -> Option<f64> {
    let turning = rest
        .iter()
        .filter(|second| second.turn_radps.abs() > TURNING_RADPS);
    let (mut felt, mut taken, mut count) = (0.0, 0.0, 0);
    for second in turning {
        let coordinated = libm::atan(second.speed_mps * second.turn_radps / GRAVITY_EQUATOR_MPS2);
        felt += coordinated * wrap_pi(second.against.roll_rad - level_rad);
        taken += coordinated * coordinated;
        count += 1;
    }
    (count >= ENOUGH[1]).then(|| felt / taken)
}
