//! Mount angles of the unit on a vehicle that moves along its forward axis.
//!
//! Every second of straight motion gives the attitude of the unit relative to the course, at zero roll. A car
//! moves along its forward axis. So does an aircraft except for the wind, which averages out over all courses,
//! and for its angle of attack. A multicopter moves in any direction.

use ins_core::attitude::{self, Euler};
use ins_core::earth::{GRAVITY_EQUATOR_MPS2, wrap_pi};
use ins_core::{Estimates, Solution};
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use super::found::Found;
use crate::identify::free_inertial::known;
use crate::identify::row::Row;
use crate::log;

/// Least speed for a usable course, m/s.
const MIN_SPEED_MPS: f64 = 4.0;
/// Course rates: below straight, above turning, rad/s; and the seconds of either that are needed.
const STRAIGHT_RADPS: f64 = 0.03;
const TURNING_RADPS: f64 = 0.1;
const MIN_SECONDS: [usize; 2] = [30, 10];
/// Interval of independent scatter, s.
const INDEPENDENT_S: f64 = 10.0;
/// Largest scatter about the course of a car and of an aircraft, rad.
const SCATTER_RAD: [f64; 2] = [0.06, 0.12];
/// Bank over that of a coordinated turn: at most of a car, at least of an aircraft.
const BANK_RATIO: [f64; 2] = [0.4, 0.6];
/// Crossfall of roads, rad.
const CROSSFALL_RAD: f64 = 0.01;

const NO_COURSE: &str = "drive or fly straight at 20 km/h and more for a minute, with some turns \
    between, a fixed wing in three directions, for the wind; what does not go where it points \
    (multicopter, boat, hand) has to be measured";
const NO_LEVEL: &str = "turn by 90 degrees and more, both ways, which shows the tilt";
const ATTACK: &str = "the angle of attack is part of it in flight: measure it on the ground";
const NO_WIND: &str = "fly straight legs in at least three directions, for the wind";

/// Kind of motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Vehicle {
    /// Moves along its forward axis, at zero roll.
    Car,
    /// Banks into turns, and flies along its forward axis except for the wind.
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
    /// Robust standard deviation of single seconds about roll, pitch and heading.
    pub spread_rad: Option<[f64; 3]>,
}

/// Attitude relative to the course over one second.
struct Second {
    course_rad: f64,
    turn_radps: f64,
    speed_mps: f64,
    relative: Euler,
}

/// Median of angles, and the standard deviation from their median absolute deviation.
struct RobustMean {
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
        if straight.len() < MIN_SECONDS[0] {
            return mount;
        }
        let all = |angle: fn(&Euler) -> f64| -> Vec<f64> {
            let angles = straight.iter().map(|second| angle(&second.relative));
            angles.collect()
        };
        let (roll, pitch) = (robust(&all(|e| e.roll_rad)), robust(&all(|e| e.pitch_rad)));
        let heading = all(|e| e.heading_rad);
        let (plain, windless) = (robust(&heading), without_wind(&straight, &heading));
        mount.spread_rad = Some([roll.spread, pitch.spread, plain.spread]);
        let bank = bank(&rest, roll.value);
        let worst = |heading: &RobustMean| heading.spread.max(pitch.spread);
        let along = worst(windless.as_ref().unwrap_or(&pitch)) < SCATTER_RAD[1];
        mount.vehicle = match bank {
            Some(bank) if bank < BANK_RATIO[0] && worst(&plain) < SCATTER_RAD[0] => Vehicle::Car,
            Some(bank) if bank > BANK_RATIO[1] && along => Vehicle::Aircraft,
            _ => return mount,
        };
        let biases = &end.accel_bias_mps2[..2];
        let tilt = biases[0].sigma.hypot(biases[1].sigma) / GRAVITY_EQUATOR_MPS2;
        let no_level = (!biases.iter().all(known)).then_some(NO_LEVEL);
        let times = (straight.len() as f64 / INDEPENDENT_S).sqrt();
        let found = |robust: &RobustMean, systematic: f64| {
            let sigma = systematic.hypot(robust.spread / times);
            Found::known(wrap_pi(robust.value), sigma)
        };
        let azimuth = end.azimuth_error_rad.sigma;
        let is_car = mount.vehicle == Vehicle::Car;
        let crossfall = if is_car { CROSSFALL_RAD } else { 0.0 };
        mount.roll_rad = found(&roll, tilt.hypot(crossfall)).unless(no_level);
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
    let fast = speeds.iter().all(|mps| *mps > MIN_SPEED_MPS);
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
        relative: attitude::euler(&(ahead.inverse() * now.attitude)),
    })
}

/// Median on a circle, by deviations from the mean direction.
fn robust(angles: &[f64]) -> RobustMean {
    let sum = |of: fn(f64) -> f64| angles.iter().copied().map(of).sum::<f64>();
    let about = libm::atan2(sum(libm::sin), sum(libm::cos));
    let deviations: Vec<f64> = angles.iter().map(|angle| wrap_pi(angle - about)).collect();
    let median = log::median(deviations.iter().copied());
    RobustMean {
        value: about + median,
        spread: 1.4826 * log::median(deviations.iter().map(|d| (d - median).abs())),
    }
}

/// Heading relative to the course, with the effect of a steady wind, `a sin + b cos` of the course, removed by
/// least squares; none if the courses do not separate it.
fn without_wind(straight: &[&Second], heading: &[f64]) -> Option<RobustMean> {
    let about = robust(heading).value;
    let terms = |s: &Second| Vector3::new(1.0, libm::sin(s.course_rad), libm::cos(s.course_rad));
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (second, angle) in straight.iter().zip(heading) {
        normal += terms(second) * terms(second).transpose();
        right += terms(second) * wrap_pi(angle - about);
    }
    // With courses in all directions the least eigenvalue is half of their number.
    if normal.symmetric_eigenvalues().min() < 0.1 * straight.len() as f64 {
        return None;
    }
    let wind = (normal.try_inverse()? * right).component_mul(&Vector3::new(0.0, 1.0, 1.0));
    let pairs = straight.iter().zip(heading);
    let left: Vec<f64> = pairs
        .map(|(second, angle)| angle - terms(second).dot(&wind))
        .collect();
    Some(robust(&left))
}

/// Roll in turns over that of coordinated turns; none without turns.
fn bank(rest: &[&Second], level_rad: f64) -> Option<f64> {
    let turning = rest
        .iter()
        .filter(|second| second.turn_radps.abs() > TURNING_RADPS);
    let (mut product, mut square, mut count) = (0.0, 0.0, 0);
    for second in turning {
        let coordinated = libm::atan(second.speed_mps * second.turn_radps / GRAVITY_EQUATOR_MPS2);
        product += coordinated * wrap_pi(second.relative.roll_rad - level_rad);
        square += coordinated * coordinated;
        count += 1;
    }
    (count >= MIN_SECONDS[1]).then(|| product / square)
}
