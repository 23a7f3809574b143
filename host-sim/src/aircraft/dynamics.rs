//! Flight dynamics: six degrees of freedom over a flat, non-rotating Earth.
//!
//! Frames as everywhere: East-North-Up and right-forward-up. Aerodynamics use forward-right-down; the axes
//! are converted only here.

use std::ops::{Add, Div, Mul};

use nalgebra::{Matrix3, Quaternion, Unit, Vector3};

use super::aerodynamics::{Aerodynamics, Flow, Surfaces};
use super::atmosphere::{Density, GRAVITY_MPS2};
use super::parameters::Parameters;
use ins_core::attitude;

/// Step of the integrator and of the autopilot, s; verified by `step_size_is_small_enough`.
pub const STEP_S: f64 = 0.02;

/// State of the flight dynamics, which do not depend on latitude and longitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    pub velocity_enu_mps: Vector3<f64>,
    /// Body to ENU, of unit length within the integrator's error.
    pub attitude: Quaternion<f64>,
    /// Body rate against the Earth, right-forward-up.
    pub rate_radps: Vector3<f64>,
    pub height_m: f64,
    pub engine_rps: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Derivative {
    pub acceleration_enu_mps2: Vector3<f64>,
    pub attitude: Quaternion<f64>,
    pub rate_radps2: Vector3<f64>,
    pub height_mps: f64,
    pub engine_rps2: f64,
}

/// Control inputs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Controls {
    pub surfaces: Surfaces,
    /// 0 closed, 1 open.
    pub throttle: f64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wind {
    pub steady_enu_mps: Vector3<f64>,
    /// Gust, right-forward-up.
    pub gust_mps: Vector3<f64>,
    /// Rotation of the gust, right-forward-up.
    pub gust_rate_radps: Vector3<f64>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inputs {
    pub controls: Controls,
    pub wind: Wind,
}

impl Inputs {
    fn midpoint(&self, to: &Self) -> Self {
        let mid = |a: f64, b: f64| 0.5 * (a + b);
        let (s, t) = (&self.controls.surfaces, &to.controls.surfaces);
        Self {
            controls: Controls {
                surfaces: Surfaces {
                    elevator_rad: mid(s.elevator_rad, t.elevator_rad),
                    aileron_rad: mid(s.aileron_rad, t.aileron_rad),
                    rudder_rad: mid(s.rudder_rad, t.rudder_rad),
                    flaps: mid(s.flaps, t.flaps),
                },
                throttle: mid(self.controls.throttle, to.controls.throttle),
            },
            wind: Wind {
                steady_enu_mps: 0.5 * (self.wind.steady_enu_mps + to.wind.steady_enu_mps),
                gust_mps: 0.5 * (self.wind.gust_mps + to.wind.gust_mps),
                gust_rate_radps: 0.5 * (self.wind.gust_rate_radps + to.wind.gust_rate_radps),
            },
        }
    }
}

/// Airspeed and sideslip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AirData {
    pub airspeed_mps: f64,
    pub beta_rad: f64,
}

impl State {
    /// Velocity against the air in body axes, right-forward-up.
    fn air_velocity(&self, wind: &Wind, body_to_enu: &Matrix3<f64>) -> Vector3<f64> {
        body_to_enu.tr_mul(&(self.velocity_enu_mps - wind.steady_enu_mps)) - wind.gust_mps
    }

    pub fn air_data(&self, wind: &Wind) -> AirData {
        let air = self.air_velocity(wind, &self.body_to_enu());
        let airspeed_mps = air.norm();
        AirData {
            airspeed_mps,
            beta_rad: libm::asin(air.x / airspeed_mps),
        }
    }

    /// `C_B^L`.
    pub fn body_to_enu(&self) -> Matrix3<f64> {
        attitude::matrix(&Unit::new_unchecked(self.attitude))
    }

    fn advanced(&self, d: &Derivative, dt: f64) -> Self {
        Self {
            velocity_enu_mps: self.velocity_enu_mps + d.acceleration_enu_mps2 * dt,
            attitude: self.attitude + d.attitude * dt,
            rate_radps: self.rate_radps + d.rate_radps2 * dt,
            height_m: self.height_m + d.height_mps * dt,
            engine_rps: self.engine_rps + d.engine_rps2 * dt,
        }
    }
}

#[derive(Clone, Debug)]
pub struct Dynamics {
    pub parameters: Parameters,
    pub aerodynamics: Aerodynamics,
    /// `Ixx Izz - Ixz^2`, inverted.
    inertia_determinant_inverse: f64,
}

impl Dynamics {
    pub fn new(parameters: &Parameters) -> Self {
        let m = &parameters.mass;
        Self {
            parameters: parameters.clone(),
            aerodynamics: Aerodynamics::new(parameters),
            inertia_determinant_inverse: 1.0
                / (m.roll_inertia_kgm2 * m.yaw_inertia_kgm2
                    - m.product_of_inertia_kgm2 * m.product_of_inertia_kgm2),
        }
    }

    /// Equations of motion: time derivative of the state.
    pub fn derivative(&self, state: &State, inputs: &Inputs, density: &Density) -> Derivative {
        let parameters = &self.parameters;
        let density_kgpm3 = density.at(state.height_m);
        let body_to_enu = state.body_to_enu();
        let air = state.air_velocity(&inputs.wind, &body_to_enu);
        // Forward-right-down from here on.
        let (u, v, w) = (air.y, air.x, -air.z);
        let air_rate = state.rate_radps - inputs.wind.gust_rate_radps;
        let (p, q, r) = (state.rate_radps.y, state.rate_radps.x, -state.rate_radps.z);

        let symmetric_square = u * u + w * w;
        let symmetric = libm::sqrt(symmetric_square);
        // At rest there is no flow; a floor keeps the coefficients finite.
        let airspeed_mps = libm::sqrt(symmetric_square + v * v).max(1.0);
        let flow = Flow {
            airspeed_mps,
            sin_alpha: w / symmetric.max(1.0),
            cos_alpha: u / symmetric.max(1.0),
            alpha_rad: libm::atan2(w, u),
            beta_rad: libm::asin((v / airspeed_mps).clamp(-1.0, 1.0)),
            roll_rate_radps: air_rate.y,
            pitch_rate_radps: air_rate.x,
            yaw_rate_radps: -air_rate.z,
            density_kgpm3,
        };
        let loads = self.aerodynamics.loads(&flow, &inputs.controls.surfaces);
        let propeller = parameters
            .propeller
            .thrust(u, state.engine_rps, density_kgpm3);
        let engine_nm = parameters
            .engine
            .torque_nm(inputs.controls.throttle, density_kgpm3);

        // Specific force, and gravity in body axes from the third row of C.
        let mass_kg = parameters.mass.mass_kg;
        let [x, y, z] = loads.force;
        let mut fx = (x + propeller.thrust_n) / mass_kg;
        let fy = y / mass_kg;
        let mut fz = z / mass_kg;
        let (down_x, down_z) = (-body_to_enu.m32, body_to_enu.m33);
        let u_dot = fx + GRAVITY_MPS2 * down_x + r * v - q * w;
        let w_dot = fz + GRAVITY_MPS2 * down_z + q * u - p * v;
        // Lift depends on d alpha/dt, which depends on lift: solved in closed form.
        let alpha_rate = (u * w_dot - w * u_dot)
            / (symmetric_square + loads.lift_per_alpha_rate * symmetric / mass_kg).max(1.0);
        let rate_lift = loads.lift_per_alpha_rate * alpha_rate / mass_kg;
        fx += rate_lift * flow.sin_alpha;
        fz -= rate_lift * flow.cos_alpha;

        let momentum =
            std::f64::consts::TAU * parameters.engine.rotating_inertia_kgm2 * state.engine_rps;
        let m = &parameters.mass;
        let (ixx, iyy, izz, ixz) = (
            m.roll_inertia_kgm2,
            m.pitch_inertia_kgm2,
            m.yaw_inertia_kgm2,
            m.product_of_inertia_kgm2,
        );
        let roll_nm = loads.moment[0] - engine_nm + (iyy - izz) * q * r + ixz * p * q;
        let pitch_nm = loads.moment[1] + loads.pitch_per_alpha_rate * alpha_rate - r * momentum
            + (izz - ixx) * p * r
            + ixz * (r * r - p * p);
        let yaw_nm = loads.moment[2] + q * momentum + (ixx - iyy) * p * q - ixz * q * r;
        let p_dot = (izz * roll_nm + ixz * yaw_nm) * self.inertia_determinant_inverse;
        let r_dot = (ixz * roll_nm + ixx * yaw_nm) * self.inertia_determinant_inverse;

        let rate = Quaternion::from_parts(0.0, state.rate_radps);
        Derivative {
            acceleration_enu_mps2: body_to_enu * Vector3::new(fy, fx, -fz)
                - Vector3::new(0.0, 0.0, GRAVITY_MPS2),
            attitude: state.attitude * rate * 0.5,
            rate_radps2: Vector3::new(pitch_nm / iyy, p_dot, -r_dot),
            height_mps: state.velocity_enu_mps.z,
            engine_rps2: (engine_nm - propeller.torque_nm)
                / (std::f64::consts::TAU * parameters.engine.rotating_inertia_kgm2),
        }
    }

    /// One step of the classical Runge-Kutta method; `first` is the derivative at the start.
    /// Inputs are linear from `from` to `to`.
    pub fn step(
        &self,
        state: &State,
        first: &Derivative,
        from: &Inputs,
        to: &Inputs,
        density: &Density,
        dt: f64,
    ) -> State {
        let middle = from.midpoint(to);
        let k1 = first;
        let k2 = self.derivative(&state.advanced(k1, 0.5 * dt), &middle, density);
        let k3 = self.derivative(&state.advanced(&k2, 0.5 * dt), &middle, density);
        let k4 = self.derivative(&state.advanced(&k3, dt), to, density);
        let all = [k1, &k2, &k3, &k4];
        let mean = Derivative {
            acceleration_enu_mps2: rk4_mean(all.map(|k| k.acceleration_enu_mps2)),
            attitude: rk4_mean(all.map(|k| k.attitude)),
            rate_radps2: rk4_mean(all.map(|k| k.rate_radps2)),
            height_mps: rk4_mean(all.map(|k| k.height_mps)),
            engine_rps2: rk4_mean(all.map(|k| k.engine_rps2)),
        };
        let mut end = state.advanced(&mean, dt);
        end.attitude /= end.attitude.norm();
        end
    }
}

/// Runge-Kutta weighted mean of the four stages.
fn rk4_mean<T>([k1, k2, k3, k4]: [T; 4]) -> T
where
    T: Add<Output = T> + Mul<f64, Output = T> + Div<f64, Output = T>,
{
    (k1 + (k2 + k3) * 2.0 + k4) / 6.0
}
