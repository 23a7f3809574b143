//! Simulation of a planned flight: autopilot, air, dynamics; and its motion as a function of time.

use std::f64::consts::{FRAC_PI_2, TAU};

use ins_core::attitude::{self, Euler};
use ins_core::earth::Geodetic;
use nalgebra::Vector3;

use super::atmosphere::Density;
use super::autopilot::{Autopilot, Lateral, Target, Track};
use super::dynamics::{Derivative, Dynamics, Inputs, STEP_S};
use super::parameters::Parameters;
use super::performance::best_climb;
use super::plan::{Leg, Path2d, Plan, at, lead_m};
use super::trajectory::{Node, Segment, euler};
use super::trim::Condition;
use super::wind::AirMass;
use crate::sim::ideal::displaced;
use crate::sim::motion::superposed;
use crate::sim::{Kinematics, Motion};

/// Steps per guidance update.
const GUIDE_EVERY: u64 = 10;
/// Timeout of a leg: this factor on its time in still air, plus ten minutes.
const TIMEOUT_FACTOR: f64 = 3.0;

#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FlightError {
    #[error("no steady flight at the start: {airspeed_mps:.1} m/s at {height_m:.0} m")]
    NoTrim { airspeed_mps: f64, height_m: f64 },
    #[error("out of control after {time_s:.0} s, on leg {leg}: too slow for this turbulence?")]
    OutOfControl { time_s: f64, leg: usize },
    #[error("hit the ground after {time_s:.0} s, on leg {leg}")]
    Ground { time_s: f64, leg: usize },
    #[error("leg {leg} is not over {time_s:.0} s after its beginning: too much head wind?")]
    LegTimeout { time_s: f64, leg: usize },
}

#[derive(Clone, Debug)]
pub struct Flight {
    dynamics: Dynamics,
    plan: Plan,
    autopilot: Autopilot,
    air: AirMass,
    /// Lines of the vibration spectrum.
    vibration: Option<Vec<Line>>,
    steps: u64,
    /// End of the last integrator step; `inputs` are controls and wind there.
    pub node: Node,
    derivative: Derivative,
    pub inputs: Inputs,
    /// Position for guidance.
    pub position: Geodetic,
    /// From the node before, with angle and speed of the crank at both ends.
    segment: Segment,
    crank_rad: [f64; 2],
    crank_radps: [f64; 2],
    leg: usize,
    leg_start_s: f64,
    leg_timeout_s: f64,
    pub target: Target,
    finished: bool,
}

impl Flight {
    /// At the start of the plan, in steady level flight.
    pub fn new(dynamics: &Dynamics, plan: &Plan, seed: u64) -> Result<Self, FlightError> {
        let start = &plan.start;
        let position = start.position;
        let trim = Condition::level(start.airspeed_mps, position.height_m)
            .trim(dynamics)
            .ok_or(FlightError::NoTrim {
                airspeed_mps: start.airspeed_mps,
                height_m: position.height_m,
            })?;
        let mut state = trim.state;
        let heading = attitude::from_euler(&Euler {
            heading_rad: start.heading_rad,
            ..trim.euler
        });
        state.attitude = *heading;
        let (sin, cos) = libm::sincos(start.heading_rad);
        let speed = trim.state.velocity_enu_mps;
        state.velocity_enu_mps = Vector3::new(
            cos * speed.x + sin * speed.y,
            cos * speed.y - sin * speed.x,
            speed.z,
        ) + plan.wind_enu_mps;
        let mut air = AirMass::new(
            plan.wind_enu_mps,
            plan.turbulence,
            dynamics.parameters.geometry.wing_span_m,
            seed,
        );
        let wind = air.step(start.airspeed_mps, position.height_m - plan.ground_height_m);
        let inputs = Inputs {
            controls: trim.inputs.controls,
            wind,
        };
        let derivative = dynamics.derivative(&state, &inputs, &Density::around(position.height_m));
        let node = Node {
            time_s: 0.0,
            state,
            acceleration_enu_mps2: derivative.acceleration_enu_mps2,
        };
        let climb = best_climb(dynamics, position.height_m).map_or(0.0, |trim| trim.climb_rate_mps);
        let autopilot = Autopilot::new(&dynamics.parameters, &trim, plan.bank_rad, climb);
        let mut flight = Self {
            dynamics: dynamics.clone(),
            plan: plan.clone(),
            autopilot,
            air,
            vibration: plan.vibration.then(|| vibration(&dynamics.parameters)),
            steps: 0,
            node,
            derivative,
            inputs,
            position,
            segment: Segment::between(
                &node,
                &Node {
                    time_s: STEP_S,
                    ..node
                },
            ),
            crank_rad: [0.0; 2],
            crank_radps: [TAU * state.engine_rps; 2],
            leg: 0,
            leg_start_s: 0.0,
            leg_timeout_s: 0.0,
            target: Target {
                height_m: 0.0,
                airspeed_mps: 0.0,
                lateral: Lateral::Heading(0.0),
            },
            finished: false,
        };
        flight.begin_leg(0);
        flight.step();
        Ok(flight)
    }

    /// Duration of the plan with this seed, s, by a trial flight without sensors.
    pub fn duration_s(&self) -> Result<f64, FlightError> {
        let Some(given_s) = self.plan.duration_s else {
            return Ok(libm::floor(self.fly_until(|trial| trial.finished)?));
        };
        self.check_duration(given_s).map(|()| given_s)
    }

    /// Whether it can be flown for a duration; after the end of the plan the last leg continues.
    pub fn check_duration(&self, duration_s: f64) -> Result<(), FlightError> {
        self.fly_until(|trial| trial.node.time_s >= duration_s)
            .map(|_| ())
    }

    /// Time at which a trial flight without sensors meets a condition, s.
    fn fly_until(&self, done: impl Fn(&Self) -> bool) -> Result<f64, FlightError> {
        let mut trial = self.clone();
        while !done(&trial) {
            trial.step();
            trial.check()?;
        }
        Ok(trial.node.time_s)
    }

    fn check(&self) -> Result<(), FlightError> {
        let (time_s, leg) = (self.node.time_s, self.leg + 1);
        let angles = euler(&self.node.state);
        let in_control = angles.pitch_rad.abs() < 0.8 && angles.roll_rad.abs() < 1.2;
        if !in_control || !self.node.state.height_m.is_finite() {
            return Err(FlightError::OutOfControl { time_s, leg });
        }
        if self.node.state.height_m < self.plan.ground_height_m {
            return Err(FlightError::Ground { time_s, leg });
        }
        let on_leg_s = time_s - self.leg_start_s;
        if on_leg_s > self.leg_timeout_s {
            return Err(FlightError::LegTimeout {
                time_s: on_leg_s,
                leg,
            });
        }
        Ok(())
    }

    fn begin_leg(&mut self, leg: usize) {
        let Leg {
            path,
            height_m,
            airspeed_mps,
        } = self.plan.legs[leg];
        let lateral = match path {
            Path2d::Heading { heading_rad, .. } => Lateral::Heading(heading_rad),
            Path2d::Bank { bank_rad, .. } => Lateral::Bank(bank_rad),
            Path2d::To(place) => {
                // From the last waypoint if there was one, else from the current position.
                let from = match self.target.lateral {
                    Lateral::Track(track) => track.to,
                    _ => self.position,
                };
                Lateral::Track(Track::between(&from, &at(place, height_m)))
            }
        };
        self.leg_timeout_s = match &lateral {
            Lateral::Track(track) => {
                let (to_go_m, _) = track.to_go_and_cross_track(&self.position);
                600.0 + TIMEOUT_FACTOR * to_go_m.abs() / airspeed_mps
            }
            _ => f64::INFINITY,
        };
        self.leg = leg;
        self.leg_start_s = self.node.time_s;
        self.target = Target {
            height_m,
            airspeed_mps,
            lateral,
        };
    }

    /// The next leg; with a duration in the plan the first follows the last.
    fn next_leg(&self) -> Option<usize> {
        let next = self.leg + 1;
        if next < self.plan.legs.len() {
            Some(next)
        } else {
            self.plan.duration_s.map(|_| 0)
        }
    }

    fn leg_is_over(&self) -> bool {
        match (self.plan.legs[self.leg].path, &self.target.lateral) {
            (Path2d::Heading { duration_s, .. } | Path2d::Bank { duration_s, .. }, _) => {
                self.node.time_s >= self.leg_start_s + duration_s
            }
            (Path2d::To(_), Lateral::Track(track)) => {
                let (to_go_m, _) = track.to_go_and_cross_track(&self.position);
                to_go_m < self.turn_lead_m(track)
            }
            _ => true,
        }
    }

    /// Lead distance of the turn onto the next track.
    fn turn_lead_m(&self, track: &Track) -> f64 {
        let Some(next) = self.next_leg() else {
            return 0.0;
        };
        let Path2d::To(place) = self.plan.legs[next].path else {
            return 0.0;
        };
        let onward = Track::between(&track.to, &at(place, track.to.height_m)).direction;
        let ground_mps = self.node.state.velocity_enu_mps.xy().norm();
        lead_m(ground_mps, self.plan.bank_rad, track.direction, onward)
    }

    fn guide(&mut self, heading_rad: f64) {
        if self.leg_is_over() {
            match self.next_leg() {
                Some(next) => self.begin_leg(next),
                None => self.finished = true,
            }
        }
        let velocity = self.node.state.velocity_enu_mps;
        self.autopilot
            .guide(&self.target, &self.position, &velocity, heading_rad);
    }

    fn step(&mut self) {
        let state = self.node.state;
        let angles = euler(&state);
        if self.steps.is_multiple_of(GUIDE_EVERY) {
            self.guide(angles.heading_rad);
        }
        let air = state.air_data(&self.inputs.wind);
        let controls = self.autopilot.control(&self.target, &state, &angles, &air);
        let wind = self
            .air
            .step(air.airspeed_mps, state.height_m - self.plan.ground_height_m);
        let next_inputs = Inputs { controls, wind };

        let density = Density::around(state.height_m);
        let next = self.dynamics.step(
            &state,
            &self.derivative,
            &self.inputs,
            &next_inputs,
            &density,
            STEP_S,
        );
        self.derivative = self.dynamics.derivative(&next, &next_inputs, &density);
        self.inputs = next_inputs;
        self.steps += 1;
        let node = Node {
            time_s: self.steps as f64 * STEP_S,
            state: next,
            acceleration_enu_mps2: self.derivative.acceleration_enu_mps2,
        };
        self.segment = Segment::between(&self.node, &node);
        self.node = node;
        // Flat-Earth displacement applied on the ellipsoid.
        self.position = Geodetic {
            height_m: next.height_m,
            ..displaced(&self.position, &self.segment.displacement_enu_m())
        };
        self.turn_crank(TAU * next.engine_rps);
    }

    /// Crank angle over the step, with linear speed.
    fn turn_crank(&mut self, to_radps: f64) {
        let ([_, from_rad], [_, from_radps]) = (self.crank_rad, self.crank_radps);
        let turned_rad = from_rad + 0.5 * STEP_S * (from_radps + to_radps);
        // Not wrapped: orders have no common period. In a day it reaches 2e7, with a resolution of 4e-9.
        self.crank_rad = [from_rad, turned_rad];
        self.crank_radps = [from_radps, to_radps];
    }
}

impl Motion for Flight {
    fn kinematics(&mut self, time_s: f64) -> Kinematics {
        // Tolerance for rounding, far below a sampling interval.
        while time_s > self.segment.end_s() + 1e-9 {
            self.step();
        }
        let kinematics = self.segment.kinematics(time_s);
        let Some(lines) = &self.vibration else {
            return kinematics;
        };
        let [from_radps, to_radps] = self.crank_radps;
        let since_s = time_s - (self.segment.end_s() - STEP_S);
        let rate_radps2 = (to_radps - from_radps) / STEP_S;
        let crank = Crank {
            angle_rad: self.crank_rad[0] + since_s * (from_radps + 0.5 * since_s * rate_radps2),
            rate_radps: from_radps + since_s * rate_radps2,
            rate_radps2,
        };
        with_vibration(&kinematics, lines, &crank)
    }
}

/// Spectral line of the vibration of the inertial unit by engine and propeller: displacement and rotation
/// against the airframe, sinusoidal in the crank angle.
///
/// Amplitudes of displacement are constant: acceleration grows with the square of engine speed.
#[derive(Clone, Copy, Debug)]
struct Line {
    order: f64,
    displacement_m: Vector3<f64>,
    rotation_rad: Vector3<f64>,
}

/// Crank angle and its derivatives at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Crank {
    angle_rad: f64,
    rate_radps: f64,
    rate_radps2: f64,
}

/// The lines of an aircraft's parameters.
fn vibration(parameters: &Parameters) -> Vec<Line> {
    let rated_radps = TAU * parameters.engine.rated_speed_rps;
    let lines = parameters.vibration.lines.iter().map(|line| {
        let omega = line.order * rated_radps;
        Line {
            order: line.order,
            displacement_m: Vector3::from(line.acceleration_mps2) / (omega * omega),
            rotation_rad: Vector3::from(line.rate_radps) / omega,
        }
    });
    lines.collect()
}

fn with_vibration(k: &Kinematics, lines: &[Line], crank: &Crank) -> Kinematics {
    let (mut velocity, mut acceleration) = (Vector3::zeros(), Vector3::zeros());
    let (mut rotation, mut rate) = (Vector3::zeros(), Vector3::zeros());
    for line in lines {
        // Axes in quadrature: the unit moves on ellipses, not lines.
        for axis in 0..3 {
            let phase = line.order * crank.angle_rad + FRAC_PI_2 * axis as f64;
            let (sin, cos) = libm::sincos(phase);
            let omega = line.order * crank.rate_radps;
            let x = line.displacement_m[axis];
            velocity[axis] += x * omega * cos;
            acceleration[axis] += x * (line.order * crank.rate_radps2 * cos - omega * omega * sin);
            rotation[axis] += line.rotation_rad[axis] * sin;
            rate[axis] += line.rotation_rad[axis] * omega * cos;
        }
    }
    superposed(k, [velocity, acceleration], [rotation, rate])
}
