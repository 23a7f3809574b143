//! Trim: state and controls of steady flight; and the natural modes about it.

use ins_core::attitude::{self, Euler};
use nalgebra::{Complex, SMatrix, SVector, Unit, Vector3};
use serde::{Deserialize, Serialize};

use super::aerodynamics::Surfaces;
use super::atmosphere::{Density, GRAVITY_MPS2};
use super::dynamics::{Controls, Dynamics, Inputs, State, Wind};

/// Specification of a steady flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Condition {
    pub airspeed_mps: f64,
    pub height_m: f64,
    /// 0 for straight flight; else a coordinated turn.
    pub bank_rad: f64,
    pub flaps: f64,
    pub power: Power,
}

/// Specification of the climb.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Power {
    /// The throttle that gives this rate of climb.
    ClimbRate(f64),
    /// The rate of climb that this throttle gives.
    Throttle(f64),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trim {
    pub state: State,
    pub inputs: Inputs,
    pub euler: Euler,
    pub alpha_rad: f64,
    pub climb_rate_mps: f64,
    pub turn_rate_radps: f64,
}

/// Unknowns: angle of attack, pitch, elevator, aileron, rudder, engine speed, throttle or climb
/// rate, bank (straight) or turn rate.
type Unknowns = SVector<f64, 8>;

impl Condition {
    pub fn level(airspeed_mps: f64, height_m: f64) -> Self {
        Self {
            airspeed_mps,
            height_m,
            bank_rad: 0.0,
            flaps: 0.0,
            power: Power::ClimbRate(0.0),
        }
    }

    /// The flight for a set of unknowns, without sideslip, heading north.
    fn flight(&self, x: &Unknowns) -> Trim {
        let turning = self.bank_rad != 0.0;
        let (roll_rad, turn_rate_radps) = if turning {
            (self.bank_rad, x[7])
        } else {
            (x[7], 0.0)
        };
        let (climb_rate_mps, throttle) = match self.power {
            Power::ClimbRate(rate) => (rate, x[6]),
            Power::Throttle(throttle) => (x[6], throttle),
        };
        let euler = Euler {
            roll_rad,
            pitch_rad: x[1],
            heading_rad: 0.0,
        };
        let attitude = attitude::from_euler(&euler);
        let air = self.airspeed_mps * Vector3::new(0.0, libm::cos(x[0]), -libm::sin(x[0]));
        // A turn to the right is a rotation about down.
        let turn = attitude.inverse() * Vector3::new(0.0, 0.0, -turn_rate_radps);
        Trim {
            state: State {
                velocity_enu_mps: attitude * air,
                attitude: *attitude,
                rate_radps: turn,
                height_m: self.height_m,
                engine_rps: x[5],
            },
            inputs: Inputs {
                controls: Controls {
                    surfaces: Surfaces {
                        elevator_rad: x[2],
                        aileron_rad: x[3],
                        rudder_rad: x[4],
                        flaps: self.flaps,
                    },
                    throttle,
                },
                wind: Wind::default(),
            },
            euler,
            alpha_rad: x[0],
            climb_rate_mps,
            turn_rate_radps,
        }
    }

    /// Residual of the trim equations, in comparable units.
    fn residual(&self, dynamics: &Dynamics, density: &Density, x: &Unknowns) -> Unknowns {
        let flight = self.flight(x);
        let d = dynamics.derivative(&flight.state, &flight.inputs, density);
        // In a steady turn the velocity rotates with the aircraft.
        let turn = Vector3::new(0.0, 0.0, -flight.turn_rate_radps);
        let acceleration = d.acceleration_enu_mps2 - turn.cross(&flight.state.velocity_enu_mps);
        Unknowns::from([
            acceleration.x,
            acceleration.y,
            acceleration.z,
            d.rate_radps2.x,
            d.rate_radps2.y,
            d.rate_radps2.z,
            d.engine_rps2,
            flight.state.velocity_enu_mps.z - flight.climb_rate_mps,
        ])
    }

    /// Solves for the steady flight by Newton's method; `None` if there is none nearby (below the
    /// stall, say).
    pub fn trim(&self, dynamics: &Dynamics) -> Option<Trim> {
        const STEP: f64 = 1e-6;
        let density = Density::around(self.height_m);
        let turn_rate = GRAVITY_MPS2 * libm::tan(self.bank_rad) / self.airspeed_mps;
        let mut x = self.first_guess(dynamics, turn_rate);
        for _ in 0..60 {
            let residual = self.residual(dynamics, &density, &x);
            if residual.norm() < 1e-10 {
                let flight = self.flight(&x);
                // Newton may also converge to a flight beyond the stall or inverted.
                return (flight.alpha_rad.abs() < 0.5 && flight.euler.pitch_rad.abs() < 1.0)
                    .then_some(flight);
            }
            let mut jacobian = SMatrix::<f64, 8, 8>::zeros();
            for i in 0..8 {
                let mut moved = x;
                moved[i] += STEP;
                let column = (self.residual(dynamics, &density, &moved) - residual) / STEP;
                jacobian.set_column(i, &column);
            }
            let step = jacobian.lu().solve(&residual)?;
            // Damped: on the stalled part of the lift curve a full step may diverge.
            let scale = (0.1 / step.rows(0, 5).amax()).min(1.0);
            x -= scale * step;
            if !x.iter().all(|v| v.is_finite()) {
                return None;
            }
        }
        None
    }

    fn first_guess(&self, dynamics: &Dynamics, turn_rate: f64) -> Unknowns {
        let p = &dynamics.parameters;
        let pressure =
            0.5 * super::atmosphere::density(self.height_m) * self.airspeed_mps * self.airspeed_mps;
        let load = 1.0 / libm::cos(self.bank_rad);
        let lift = p.mass.mass_kg * GRAVITY_MPS2 * load / (pressure * p.geometry.wing_area_m2);
        let alpha =
            ((lift - p.lift.zero - self.flaps * p.flaps.lift) / p.lift.alpha).clamp(-0.1, 0.25);
        let elevator = dynamics.aerodynamics.trim_elevator(alpha, self.flaps);
        let (climb, power) = match self.power {
            Power::ClimbRate(climb) => (climb, 0.6),
            Power::Throttle(_) => (0.0, 0.0),
        };
        let pitch = alpha + climb / self.airspeed_mps;
        let last = if self.bank_rad == 0.0 { 0.0 } else { turn_rate };
        let engine = 0.8 * p.engine.rated_speed_rps;
        Unknowns::from([alpha, pitch, elevator, 0.0, 0.0, engine, power, last])
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Oscillation {
    pub natural_frequency_radps: f64,
    pub damping_ratio: f64,
    /// Of the damped oscillation.
    pub period_s: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Modes {
    pub phugoid: Oscillation,
    pub short_period: Oscillation,
    pub dutch_roll: Oscillation,
    /// Time constant, s; negative if unstable.
    pub spiral_time_constant_s: f64,
    pub roll_time_constant_s: f64,
}

/// Forward and down velocity, pitch rate, pitch angle, engine speed.
type Longitudinal = SMatrix<f64, 5, 5>;
/// Right velocity, roll rate, yaw rate, roll angle.
type Lateral = SMatrix<f64, 4, 4>;

/// Coordinates of the linear system: u, w, q, pitch, engine, v, p, r, roll.
type Coordinates = SVector<f64, 9>;

fn coordinates(state: &State) -> Coordinates {
    let euler = attitude::euler(&Unit::new_unchecked(state.attitude));
    let body = state.body_to_enu().tr_mul(&state.velocity_enu_mps);
    let rate = &state.rate_radps;
    Coordinates::from([
        body.y,
        -body.z,
        rate.x,
        euler.pitch_rad,
        state.engine_rps,
        body.x,
        rate.y,
        -rate.z,
        euler.roll_rad,
    ])
}

fn state_at(x: &Coordinates, height_m: f64) -> State {
    let euler = Euler {
        roll_rad: x[8],
        pitch_rad: x[3],
        heading_rad: 0.0,
    };
    let attitude = attitude::from_euler(&euler);
    State {
        velocity_enu_mps: attitude * Vector3::new(x[5], x[0], -x[1]),
        attitude: *attitude,
        rate_radps: Vector3::new(x[2], x[6], -x[7]),
        height_m,
        engine_rps: x[4],
    }
}

fn rate_of_change(
    dynamics: &Dynamics,
    trim: &Trim,
    density: &Density,
    x: &Coordinates,
) -> Coordinates {
    let state = state_at(x, trim.state.height_m);
    let d = dynamics.derivative(&state, &trim.inputs, density);
    let body_to_enu = state.body_to_enu();
    let body = body_to_enu.tr_mul(&state.velocity_enu_mps);
    let v = body_to_enu.tr_mul(&d.acceleration_enu_mps2) - state.rate_radps.cross(&body);
    let (p, q, r) = (x[6], x[2], x[7]);
    let (sin, cos) = libm::sincos(x[8]);
    let pitch_rate = q * cos - r * sin;
    let roll_rate = p + libm::tan(x[3]) * (q * sin + r * cos);
    Coordinates::from([
        v.y,
        -v.z,
        d.rate_radps2.x,
        pitch_rate,
        d.engine_rps2,
        v.x,
        d.rate_radps2.y,
        -d.rate_radps2.z,
        roll_rate,
    ])
}

/// Longitudinal and lateral linearised motion about straight flight. Their coupling (the
/// propeller's torque and momentum) is neglected, as is usual; height is constant.
pub fn linearised(dynamics: &Dynamics, trim: &Trim) -> (Longitudinal, Lateral) {
    const STEP: f64 = 1e-5;
    let density = Density::around(trim.state.height_m);
    let x0 = coordinates(&trim.state);
    let mut full = SMatrix::<f64, 9, 9>::zeros();
    for i in 0..9 {
        let at = |sign: f64| {
            let mut x = x0;
            x[i] += sign * STEP;
            rate_of_change(dynamics, trim, &density, &x)
        };
        full.set_column(i, &((at(1.0) - at(-1.0)) / (2.0 * STEP)));
    }
    (
        full.fixed_view::<5, 5>(0, 0).into(),
        full.fixed_view::<4, 4>(5, 5).into(),
    )
}

/// The modes of a straight steady flight; `None` if one of the classical ones has degenerated
/// (two real roots for an oscillation), as happens near the stall.
pub fn modes(dynamics: &Dynamics, trim: &Trim) -> Option<Modes> {
    let (longitudinal, lateral) = linearised(dynamics, trim);
    let longitudinal = longitudinal.complex_eigenvalues();
    let lateral = lateral.complex_eigenvalues();
    let mut pairs = oscillations(longitudinal.as_slice());
    pairs.sort_by(|a, b| {
        a.natural_frequency_radps
            .total_cmp(&b.natural_frequency_radps)
    });
    let [phugoid, short_period] = pairs.try_into().ok()?;
    let [dutch_roll] = oscillations(lateral.as_slice()).try_into().ok()?;
    let mut real: Vec<f64> = lateral
        .iter()
        .filter(|root| is_real(root))
        .map(|root| root.re)
        .collect();
    real.sort_by(f64::total_cmp);
    let [roll, spiral] = real.try_into().ok()?;
    Some(Modes {
        phugoid,
        short_period,
        dutch_roll,
        spiral_time_constant_s: -1.0 / spiral,
        roll_time_constant_s: -1.0 / roll,
    })
}

fn is_real(root: &Complex<f64>) -> bool {
    root.im.abs() < 1e-6
}

fn oscillations(roots: &[Complex<f64>]) -> Vec<Oscillation> {
    roots
        .iter()
        .filter(|root| root.im > 0.0 && !is_real(root))
        .map(|root| {
            let natural_frequency_radps = libm::hypot(root.re, root.im);
            Oscillation {
                natural_frequency_radps,
                damping_ratio: -root.re / natural_frequency_radps,
                period_s: std::f64::consts::TAU / root.im,
            }
        })
        .collect()
}
