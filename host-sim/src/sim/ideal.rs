//! Sensors without error: any motion on the rotating WGS-84 ellipsoid.

use ins_core::Solution;
use ins_core::Time;
use ins_core::earth::{Geodetic, LocalEarth, wrap_pi};
use nalgebra::Vector3;

use super::motion::{Kinematics, Motion};

/// Inner nodes of the four-point Gauss-Lobatto rule on [0, 1], `(1 -+ 1/sqrt 5) / 2`.
///
/// As exact as three-point Gauss-Legendre (degree 5), but the ends of the interval are nodes,
/// which the truth needs anyway.
const INNER_NODES: [f64; 2] = [0.276_393_202_250_021, 0.723_606_797_749_979];
const END_WEIGHT: f64 = 1.0 / 12.0;
const INNER_WEIGHT: f64 = 5.0 / 12.0;

/// What integrating sensors gain over an interval, in the rotating body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Increments {
    /// Integral of the angular rate of the body against inertial space.
    pub angle_b_rad: Vector3<f64>,
    /// Integral of the specific force.
    pub velocity_b_mps: Vector3<f64>,
}

/// What sensors would read at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// Angular rate of the body against inertial space.
    pub angular_rate_ib_b_radps: Vector3<f64>,
    /// Specific force: at rest +g upwards.
    pub specific_force_b_mps2: Vector3<f64>,
}

impl Rates {
    fn at(kinematics: &Kinematics, earth: &LocalEarth) -> Self {
        let velocity = &kinematics.velocity_enu_mps;
        let earth_rate = earth.earth_rate();
        let transport_rate = earth.transport_rate(velocity);
        let to_body = kinematics.attitude.inverse();
        let coriolis = (2.0 * earth_rate + transport_rate).cross(velocity);
        let gravity_reaction = Vector3::new(0.0, 0.0, earth.gravity_mps2);
        Self {
            angular_rate_ib_b_radps: kinematics.angular_rate_lb_b_radps
                + to_body * (earth_rate + transport_rate),
            specific_force_b_mps2: to_body
                * (kinematics.acceleration_enu_mps2 + coriolis + gravity_reaction),
        }
    }
}

/// The exact state of the vehicle at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueState {
    /// Position, velocity, attitude.
    pub solution: Solution,
    /// Time derivative of the velocity components.
    pub acceleration_enu_mps2: Vector3<f64>,
    /// Instantaneous readings.
    pub rates: Rates,
}

/// Position and velocity between two states one sampling interval or less apart.
///
/// Velocity is the cubic with the states' velocities and accelerations at its ends (error
/// h^4/384 of its fourth derivative: below 1e-9 m/s for a car at 100 Hz), position its integral.
pub fn between(from: &TrueState, to: &TrueState, time_s: f64) -> (Geodetic, Vector3<f64>) {
    let start_s = from.solution.time.as_seconds();
    let h = to.solution.time.seconds_since(from.solution.time);
    let u = (time_s - start_s) / h;
    let (v0, v1) = (from.solution.velocity_enu_mps, to.solution.velocity_enu_mps);
    let (a0, a1) = (from.acceleration_enu_mps2 * h, to.acceleration_enu_mps2 * h);
    let cubic = 2.0 * (v0 - v1) + a0 + a1;
    let square = 3.0 * (v1 - v0) - 2.0 * a0 - a1;
    let velocity = v0 + u * (a0 + u * (square + u * cubic));
    let moved = h * u * (v0 + u * (a0 / 2.0 + u * (square / 3.0 + u * cubic / 4.0)));
    let at = &from.solution.position;
    (displaced(at, &moved), velocity)
}

/// The point some metres from another.
pub(super) fn displaced(from: &Geodetic, moved_enu_m: &Vector3<f64>) -> Geodetic {
    displaced_on(
        &LocalEarth::at(from.latitude_rad, from.height_m),
        from,
        moved_enu_m,
    )
}

fn displaced_on(earth: &LocalEarth, from: &Geodetic, moved_enu_m: &Vector3<f64>) -> Geodetic {
    let east_rad = moved_enu_m.x / (earth.east_radius_m * earth.cos_latitude);
    Geodetic {
        latitude_rad: from.latitude_rad + moved_enu_m.y / earth.north_radius_m,
        longitude_rad: wrap_pi(from.longitude_rad + east_rad),
        height_m: from.height_m + moved_enu_m.z,
    }
}

/// A motion with ideal inertial sensors on it.
#[derive(Clone, Debug)]
pub struct IdealSensors<M> {
    motion: M,
    state: TrueState,
    kinematics: Kinematics,
    earth: LocalEarth,
}

impl<M: Motion> IdealSensors<M> {
    /// Places a motion at `origin` at the instant `start`.
    pub fn new(mut motion: M, origin: Geodetic, start: Time) -> Self {
        let kinematics = motion.kinematics(start.as_seconds());
        let earth = LocalEarth::at(origin.latitude_rad, origin.height_m);
        let state = true_state(start, origin, &kinematics, &earth);
        Self {
            motion,
            state,
            kinematics,
            earth,
        }
    }

    /// The state reached.
    pub fn state(&self) -> &TrueState {
        &self.state
    }

    /// Moves on to a later instant; returns what the sensors gained on the way.
    pub fn advance(&mut self, to: Time) -> Increments {
        let from = self.state.solution;
        let start_s = from.time.as_seconds();
        let h = to.seconds_since(from.time);
        let [early, late] = INNER_NODES.map(|node| self.motion.kinematics(start_s + node * h));
        let end = self.motion.kinematics(to.as_seconds());

        // The Earth changes so slowly along the way that its mid-interval values serve the inner
        // nodes and the radii: what is left is of third order in the interval.
        let halfway = displaced_on(
            &self.earth,
            &from.position,
            &(0.5 * h * from.velocity_enu_mps),
        );
        let mid_earth = LocalEarth::at(halfway.latitude_rad, halfway.height_m);
        let moved = integral(
            h,
            &[self.kinematics, early, late, end].map(|k| k.velocity_enu_mps),
        );
        let position = displaced_on(&mid_earth, &from.position, &moved);

        let start_rates = self.state.rates;
        self.earth = LocalEarth::at(position.latitude_rad, position.height_m);
        self.state = true_state(to, position, &end, &self.earth);
        self.kinematics = end;
        let rates = [
            start_rates,
            Rates::at(&early, &mid_earth),
            Rates::at(&late, &mid_earth),
            self.state.rates,
        ];
        Increments {
            angle_b_rad: integral(h, &rates.map(|r| r.angular_rate_ib_b_radps)),
            velocity_b_mps: integral(h, &rates.map(|r| r.specific_force_b_mps2)),
        }
    }
}

fn true_state(
    time: Time,
    position: Geodetic,
    kinematics: &Kinematics,
    earth: &LocalEarth,
) -> TrueState {
    TrueState {
        solution: Solution {
            time,
            position,
            velocity_enu_mps: kinematics.velocity_enu_mps,
            attitude: kinematics.attitude,
        },
        acceleration_enu_mps2: kinematics.acceleration_enu_mps2,
        rates: Rates::at(kinematics, earth),
    }
}

fn integral(h: f64, [start, early, late, end]: &[Vector3<f64>; 4]) -> Vector3<f64> {
    h * (END_WEIGHT * (start + end) + INNER_WEIGHT * (early + late))
}
