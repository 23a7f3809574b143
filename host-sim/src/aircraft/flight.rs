//! A planned flight, step by step: autopilot, air, forces; and its motion as a function of time.

use ins_core::attitude::{self, Euler};
use ins_core::earth::Geodetic;
use nalgebra::Vector3;

use super::atmosphere::Density;
use super::autopilot::{Autopilot, Lateral, Target, Track};
use super::dynamics::{Derivative, Dynamics, Inputs};
use super::performance::best_climb;
use super::plan::{Leg, Path2d, Plan, at, lead_m};
use super::trajectory::{Node, Segment, euler};
use super::trim::Condition;
use super::vibration::{Crank, Vibration};
use super::wind::AirMass;
use crate::sim::ideal::displaced;
use crate::sim::{Kinematics, Motion};

/// Step of the integrator and of the autopilot, s. `step_size_is_small_enough` is the evidence.
pub const STEP_S: f64 = 0.02;
/// Guidance runs once in so many steps.
const GUIDE_EVERY: u64 = 10;
/// A leg that takes longer than in still air by this factor, and ten minutes, is not to be reached.
const PATIENCE: f64 = 3.0;

/// Why a flight could not be flown to its end.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FlightError {
    #[error("no steady flight at the start: {airspeed_mps:.1} m/s at {height_m:.0} m")]
    NoTrim { airspeed_mps: f64, height_m: f64 },
    #[error("out of control after {time_s:.0} s, on leg {leg}: too slow for this turbulence?")]
    OutOfControl { time_s: f64, leg: usize },
    #[error("hit the ground after {time_s:.0} s, on leg {leg}")]
    Ground { time_s: f64, leg: usize },
    #[error("leg {leg} is not over {time_s:.0} s after its beginning: too much head wind?")]
    NeverThere { time_s: f64, leg: usize },
}

/// A flight under way.
#[derive(Clone, Debug)]
pub struct Flight {
    dynamics: Dynamics,
    plan: Plan,
    autopilot: Autopilot,
    air: AirMass,
    vibration: Option<Vibration>,
    step_s: f64,
    steps: u64,
    node: Node,
    derivative: Derivative,
    inputs: Inputs,
    position: Geodetic,
    segment: Segment,
    crank: [Crank; 2],
    leg: usize,
    leg_start_s: f64,
    leg_patience_s: f64,
    target: Target,
    over: bool,
}

impl Flight {
    /// At the start of the plan, in steady level flight.
    pub fn new(dynamics: &Dynamics, plan: &Plan, seed: u64) -> Result<Self, FlightError> {
        Self::with_step(dynamics, plan, seed, STEP_S)
    }

    /// The same with another step of the integrator.
    pub fn with_step(
        dynamics: &Dynamics,
        plan: &Plan,
        seed: u64,
        step_s: f64,
    ) -> Result<Self, FlightError> {
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
            step_s,
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
        let autopilot = Autopilot::new(&dynamics.parameters, &trim, plan.bank_rad, climb, step_s);
        let crank = Crank {
            angle_rad: 0.0,
            rate_radps: 0.0,
            rate_radps2: 0.0,
        };
        let mut flight = Self {
            dynamics: dynamics.clone(),
            plan: plan.clone(),
            autopilot,
            air,
            vibration: plan.vibration.then(|| Vibration::new(&dynamics.parameters)),
            step_s,
            steps: 0,
            node,
            derivative,
            inputs,
            position,
            segment: Segment::between(
                &node,
                &Node {
                    time_s: step_s,
                    ..node
                },
            ),
            crank: [crank; 2],
            leg: 0,
            leg_start_s: 0.0,
            leg_patience_s: 0.0,
            target: Target {
                height_m: 0.0,
                airspeed_mps: 0.0,
                lateral: Lateral::Heading(0.0),
            },
            over: false,
        };
        flight.crank[1] = flight.crank_now(0.0);
        flight.begin_leg(0);
        flight.step();
        Ok(flight)
    }

    /// How long the plan takes with this seed, s; flown to the end, without sensors.
    pub fn duration_s(&self) -> Result<f64, FlightError> {
        let (mut trial, told_s) = (self.clone(), self.plan.duration_s);
        while told_s.map_or(!trial.over, |told_s| trial.node.time_s < told_s) {
            trial.step();
            trial.check()?;
        }
        Ok(told_s.unwrap_or(libm::floor(trial.node.time_s)))
    }

    /// Where the integrator has come to.
    pub fn node(&self) -> &Node {
        &self.node
    }

    /// Controls and wind there.
    pub fn inputs(&self) -> &Inputs {
        &self.inputs
    }

    /// What the autopilot is doing.
    pub fn target(&self) -> &Target {
        &self.target
    }

    /// Position as the autopilot knows it.
    pub fn position(&self) -> &Geodetic {
        &self.position
    }

    fn check(&self) -> Result<(), FlightError> {
        let (time_s, leg) = (self.node.time_s, self.leg + 1);
        let angles = euler(&self.node.state);
        let upright = angles.pitch_rad.abs() < 0.8 && angles.roll_rad.abs() < 1.2;
        if !upright || !self.node.state.height_m.is_finite() {
            return Err(FlightError::OutOfControl { time_s, leg });
        }
        if self.node.state.height_m < self.plan.ground_height_m {
            return Err(FlightError::Ground { time_s, leg });
        }
        let on_leg_s = time_s - self.leg_start_s;
        if on_leg_s > self.leg_patience_s {
            return Err(FlightError::NeverThere {
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
                // From the last waypoint if there was one; else from here.
                let from = match self.target.lateral {
                    Lateral::Track(track) => track.to,
                    _ => self.position,
                };
                Lateral::Track(Track::between(&from, &at(place, height_m)))
            }
        };
        self.leg_patience_s = match &lateral {
            Lateral::Track(track) => {
                let (to_go_m, _) = track.place(&self.position);
                600.0 + PATIENCE * to_go_m.abs() / airspeed_mps
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

    /// The leg after this one; with a duration in the plan the first follows the last.
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
                let (to_go_m, _) = track.place(&self.position);
                to_go_m < self.turn_lead_m(track)
            }
            _ => true,
        }
    }

    /// How far before the end of this track the turn onto the next begins.
    fn turn_lead_m(&self, track: &Track) -> f64 {
        let Some(next) = self.next_leg() else {
            return 0.0;
        };
        let Path2d::To(place) = self.plan.legs[next].path else {
            return 0.0;
        };
        let onward = Track::between(&track.to, &at(place, track.to.height_m)).direction;
        let angle = libm::atan2(
            track.direction.perp(&onward).abs(),
            track.direction.dot(&onward),
        );
        lead_m(
            self.node.state.velocity_enu_mps.xy().norm(),
            self.plan.bank_rad,
            angle,
        )
    }

    fn guide(&mut self, heading_rad: f64) {
        if self.leg_is_over() {
            match self.next_leg() {
                Some(next) => self.begin_leg(next),
                None => self.over = true,
            }
        }
        let velocity = self.node.state.velocity_enu_mps;
        self.autopilot
            .guide(&self.target, &self.position, &velocity, heading_rad);
    }

    /// One step of everything.
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
            self.step_s,
        );
        self.derivative = self.dynamics.derivative(&next, &next_inputs, &density);
        self.inputs = next_inputs;
        self.steps += 1;
        let node = Node {
            time_s: self.steps as f64 * self.step_s,
            state: next,
            acceleration_enu_mps2: self.derivative.acceleration_enu_mps2,
        };
        self.segment = Segment::between(&self.node, &node);
        self.node = node;
        self.move_position();
        self.crank = [self.crank[1], self.crank_now(self.crank_angle())];
    }

    /// The flight of the flat Earth, put onto the ellipsoid.
    fn move_position(&mut self) {
        self.position = Geodetic {
            height_m: self.node.state.height_m,
            ..displaced(&self.position, &self.segment.displacement_enu_m())
        };
    }

    fn crank_now(&self, angle_rad: f64) -> Crank {
        Crank {
            angle_rad,
            rate_radps: std::f64::consts::TAU * self.node.state.engine_rps,
            rate_radps2: std::f64::consts::TAU * self.derivative.engine_rps2,
        }
    }

    /// Crank angle at the end of the step: the speed taken linear within it.
    fn crank_angle(&self) -> f64 {
        let from = &self.crank[1];
        let to_radps = std::f64::consts::TAU * self.node.state.engine_rps;
        libm::fmod(
            from.angle_rad + 0.5 * self.step_s * (from.rate_radps + to_radps),
            // All orders are multiples of a half.
            4.0 * std::f64::consts::PI,
        )
    }
}

impl Motion for Flight {
    fn kinematics(&mut self, time_s: f64) -> Kinematics {
        // A whole step's rounding, far below a sampling interval.
        while time_s > self.segment.end_s() + 1e-9 {
            self.step();
        }
        let kinematics = self.segment.kinematics(time_s);
        let Some(vibration) = &self.vibration else {
            return kinematics;
        };
        let [from, to] = &self.crank;
        let since_s = time_s - (self.segment.end_s() - self.step_s);
        let rate_radps2 = (to.rate_radps - from.rate_radps) / self.step_s;
        let crank = Crank {
            angle_rad: from.angle_rad + since_s * (from.rate_radps + 0.5 * since_s * rate_radps2),
            rate_radps: from.rate_radps + since_s * rate_radps2,
            rate_radps2,
        };
        vibration.shake(&kinematics, &crank)
    }
}
