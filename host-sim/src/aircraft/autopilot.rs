//! Autopilot: holds height, airspeed and heading, track or bank, in coordinated flight.

use ins_core::attitude::Euler;
use ins_core::earth::{Geodetic, wrap_pi};
use nalgebra::{Vector2, Vector3};

use super::atmosphere::GRAVITY_MPS2;
use super::dynamics::{AirData, Controls, STEP_S, State};
use super::parameters::Parameters;
use super::trim::Trim;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    pub height_m: f64,
    pub airspeed_mps: f64,
    pub lateral: Lateral,
}

/// Lateral mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lateral {
    Heading(f64),
    Bank(f64),
    Track(Track),
}

/// The line through a point along a direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Track {
    pub to: Geodetic,
    /// East, north; unit length.
    pub direction: Vector2<f64>,
}

impl Track {
    /// From one position to another, which must differ.
    pub fn between(from: &Geodetic, to: &Geodetic) -> Self {
        Self {
            to: *to,
            direction: to.enu_from(from).xy().normalize(),
        }
    }

    /// Distance to go and cross-track error, right positive.
    pub fn to_go_and_cross_track(&self, position: &Geodetic) -> (f64, f64) {
        let from_end = position.enu_from(&self.to).xy();
        (
            -from_end.dot(&self.direction),
            -self.direction.perp(&from_end),
        )
    }
}

/// Gain of the heading or course loop, 1/s.
const COURSE_RATE: f64 = 0.12;
/// Look-ahead time of the track loop, s.
const TRACK_TIME_S: f64 = 18.0;
/// Rate limit of the airspeed command, which engine and drag can follow, m/s^2.
const AIRSPEED_RATE_MPS2: f64 = 0.5;
/// Gain of the height loop, 1/s.
const HEIGHT_RATE: f64 = 0.12;

#[derive(Clone, Debug)]
pub struct Autopilot {
    parameters: Parameters,
    bank_limit_rad: f64,
    climb_limit_mps: f64,
    bank_command_rad: f64,
    airspeed_reference_mps: f64,
    roll_reference_rad: f64,
    pitch_integral_rad: f64,
    throttle_integral: f64,
    rudder_integral_rad: f64,
    trim: Controls,
}

impl Autopilot {
    /// Engaged in steady flight; `climb_limit_mps` limits the climb command.
    pub fn new(
        parameters: &Parameters,
        trim: &Trim,
        bank_limit_rad: f64,
        climb_limit_mps: f64,
    ) -> Self {
        Self {
            parameters: parameters.clone(),
            bank_limit_rad,
            climb_limit_mps,
            bank_command_rad: 0.0,
            airspeed_reference_mps: trim.state.velocity_enu_mps.norm(),
            roll_reference_rad: trim.euler.roll_rad,
            pitch_integral_rad: trim.euler.pitch_rad,
            throttle_integral: trim.inputs.controls.throttle,
            rudder_integral_rad: trim.inputs.controls.surfaces.rudder_rad,
            trim: trim.inputs.controls,
        }
    }

    /// Guidance: the bank command for the target; slower than the inner loops.
    pub fn guide(
        &mut self,
        target: &Target,
        position: &Geodetic,
        velocity_enu_mps: &Vector3<f64>,
        heading_rad: f64,
    ) {
        let ground_mps = velocity_enu_mps.xy().norm();
        let error_rad = match target.lateral {
            Lateral::Bank(bank_rad) => {
                self.bank_command_rad = bank_rad;
                return;
            }
            Lateral::Heading(command) => wrap_pi(command - heading_rad),
            Lateral::Track(track) => {
                let (_, cross_track_m) = track.to_go_and_cross_track(position);
                let course = libm::atan2(velocity_enu_mps.x, velocity_enu_mps.y);
                let along = libm::atan2(track.direction.x, track.direction.y);
                let intercept = libm::atan(cross_track_m / (TRACK_TIME_S * ground_mps));
                wrap_pi(along - intercept - course)
            }
        };
        let bank = libm::atan(COURSE_RATE * error_rad * ground_mps / GRAVITY_MPS2);
        self.bank_command_rad = bank.clamp(-self.bank_limit_rad, self.bank_limit_rad);
    }

    pub fn control(
        &mut self,
        target: &Target,
        state: &State,
        euler: &Euler,
        air: &AirData,
    ) -> Controls {
        let gains = &self.parameters.autopilot;
        let travel = &self.parameters.travel;
        let dt = STEP_S;
        let max_change = AIRSPEED_RATE_MPS2 * dt;
        self.airspeed_reference_mps +=
            (target.airspeed_mps - self.airspeed_reference_mps).clamp(-max_change, max_change);
        let speed_error_mps = self.airspeed_reference_mps - air.airspeed_mps;

        // Speed by throttle, with anti-windup at the ends of the travel.
        let throttle = self.throttle_integral + gains.throttle_per_speed * speed_error_mps;
        let saturated =
            (throttle > 1.0 && speed_error_mps > 0.0) || (throttle < 0.0 && speed_error_mps < 0.0);
        if !saturated {
            self.throttle_integral += gains.throttle_per_speed_integral * speed_error_mps * dt;
        }

        // Height by pitch, with priority of speed: an aircraft that is too slow climbs less.
        let climb_limit = self.climb_limit_mps - (0.6 * (speed_error_mps - 1.0)).max(0.0);
        let climb_command = (HEIGHT_RATE * (target.height_m - state.height_m)).clamp(
            -gains.maximum_descent_mps,
            climb_limit.max(-gains.maximum_descent_mps),
        );
        let climb_error = climb_command - state.velocity_enu_mps.z;
        self.pitch_integral_rad = (self.pitch_integral_rad
            + gains.pitch_per_climb_integral * climb_error * dt)
            .clamp(-0.25, 0.25);
        let pitch_command =
            (self.pitch_integral_rad + gains.pitch_per_climb * climb_error).clamp(-0.3, 0.3);

        // Bank, approached no faster than the roll-rate limit.
        let max_change = gains.maximum_roll_rate_radps * dt;
        self.roll_reference_rad +=
            (self.bank_command_rad - self.roll_reference_rad).clamp(-max_change, max_change);
        let (sin_roll, cos_roll) = libm::sincos(euler.roll_rad);
        let turn_rate = GRAVITY_MPS2 * sin_roll / (cos_roll.max(0.5) * air.airspeed_mps);
        let (pitch_rate, roll_rate, yaw_rate) =
            (state.rate_radps.x, state.rate_radps.y, -state.rate_radps.z);

        // Coordination: no sideslip, and the yaw rate of the turn.
        self.rudder_integral_rad = (self.rudder_integral_rad
            - gains.rudder_per_sideslip_integral * air.beta_rad * dt)
            .clamp(-travel.rudder_rad, travel.rudder_rad);

        let mut controls = self.trim;
        controls.throttle = throttle.clamp(0.0, 1.0);
        let surfaces = &mut controls.surfaces;
        surfaces.elevator_rad = (self.trim.surfaces.elevator_rad
            - gains.elevator_per_pitch * (pitch_command - euler.pitch_rad)
            + gains.elevator_per_pitch_rate_s * (pitch_rate - turn_rate * sin_roll))
            .clamp(-travel.elevator_up_rad, travel.elevator_down_rad);
        surfaces.aileron_rad = (self.trim.surfaces.aileron_rad
            + gains.aileron_per_roll * (self.roll_reference_rad - euler.roll_rad)
            - gains.aileron_per_roll_rate_s * roll_rate)
            .clamp(-travel.aileron_rad, travel.aileron_rad);
        surfaces.rudder_rad = (self.rudder_integral_rad - gains.rudder_per_sideslip * air.beta_rad
            + gains.rudder_per_yaw_rate_s * (yaw_rate - turn_rate * cos_roll))
            .clamp(-travel.rudder_rad, travel.rudder_rad);
        controls
    }
}
