//! Natural motions around a steady flight.

use ins_core::attitude::{self, Euler};
use nalgebra::{Complex, SMatrix, SVector, Unit, Vector3};
use serde::{Deserialize, Serialize};

use super::atmosphere::Density;
use super::dynamics::{Dynamics, State};
use super::trim::Trim;

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
    /// Time constant, s; negative if it grows.
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

/// The two halves of the linearised motion around a straight flight. What couples them (the
/// propeller's torque and momentum) is left out, as is usual; height is held.
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
