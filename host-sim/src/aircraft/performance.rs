//! Performance of an aircraft: speeds, climb, ceiling.

use serde::Serialize;

use super::aerodynamics::bisect;
use super::atmosphere::{self, GRAVITY_MPS2};
use super::dynamics::Dynamics;
use super::trim::{Condition, Modes, Power, Trim, modes};

/// Rate of climb that defines the service ceiling (100 ft/min, FAR 23 practice), m/s.
const SERVICE_CLIMB_MPS: f64 = 0.508;

/// The performance table, at sea level unless it says otherwise, at the mass of the file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Performance {
    pub name: String,
    /// Largest level speed, throttle open.
    pub max_speed_kmh: f64,
    /// Flaps down.
    pub stall_speed_kmh: f64,
    pub clean_stall_speed_kmh: f64,
    /// Best rate of climb, throttle open.
    pub climb_rate_mps: f64,
    pub climb_speed_kmh: f64,
    pub service_ceiling_m: f64,
    pub ceiling_m: f64,
    pub engine_rpm_at_max_speed: f64,
    pub engine_rpm_in_climb: f64,
    pub propeller_efficiency_at_max_speed: f64,
    pub trims: Vec<TrimRow>,
}

/// Steady level flight at one speed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TrimRow {
    pub airspeed_mps: f64,
    pub alpha_deg: f64,
    pub elevator_deg: f64,
    pub throttle: f64,
    pub thrust_n: f64,
    pub shaft_power_kw: f64,
    pub engine_rpm: f64,
    pub modes: Option<Modes>,
}

/// Stall speed in steady level flight (true airspeed), power off.
pub fn stall_speed_mps(dynamics: &Dynamics, height_m: f64, flaps: f64) -> f64 {
    let p = &dynamics.parameters;
    let weight_n = p.mass.mass_kg * GRAVITY_MPS2;
    let lift = dynamics.aerodynamics.maximum_trimmed_lift(flaps);
    (2.0 * weight_n / (atmosphere::density(height_m) * p.geometry.wing_area_m2 * lift)).sqrt()
}

/// Steady flight with the throttle open.
fn full_throttle(dynamics: &Dynamics, airspeed_mps: f64, height_m: f64) -> Option<Trim> {
    Condition {
        power: Power::Throttle(1.0),
        ..Condition::level(airspeed_mps, height_m)
    }
    .trim(dynamics)
}

/// Steady rate of climb with the throttle open.
pub fn climb_rate_mps(dynamics: &Dynamics, airspeed_mps: f64, height_m: f64) -> Option<f64> {
    full_throttle(dynamics, airspeed_mps, height_m).map(|trim| trim.climb_rate_mps)
}

/// Best steady climb with the throttle open at a height.
pub fn best_climb(dynamics: &Dynamics, height_m: f64) -> Option<Trim> {
    let stall = stall_speed_mps(dynamics, height_m, 0.0);
    let rate = |speed: f64| climb_rate_mps(dynamics, speed, height_m).unwrap_or(f64::NEG_INFINITY);
    let (mut low, mut high) = (1.1 * stall, 2.5 * stall);
    // Unimodal: ternary search.
    for _ in 0..40 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if rate(a) < rate(b) { low = a } else { high = b }
    }
    full_throttle(dynamics, 0.5 * (low + high), height_m)
}

/// Largest speed of level flight at a height; `None` above the ceiling.
pub fn max_speed(dynamics: &Dynamics, height_m: f64) -> Option<Trim> {
    let best = best_climb(dynamics, height_m)?;
    if best.climb_rate_mps < 0.0 {
        return None;
    }
    let slowest = best.state.velocity_enu_mps.norm();
    let climbs = |speed| climb_rate_mps(dynamics, speed, height_m).is_some_and(|rate| rate > 0.0);
    let speed = bisect(climbs, [slowest, 3.0 * slowest], 50);
    full_throttle(dynamics, speed, height_m)
}

/// Height at which the best climb is `climb_mps`.
pub fn ceiling_m(dynamics: &Dynamics, climb_mps: f64) -> f64 {
    let climbs = |height_m| {
        let best = best_climb(dynamics, height_m);
        best.is_some_and(|trim| trim.climb_rate_mps > climb_mps)
    };
    bisect(climbs, [0.0, 11_000.0], 20)
}

/// Steady level flight; `None` where it is impossible.
pub fn trim_row(dynamics: &Dynamics, airspeed_mps: f64, height_m: f64) -> Option<TrimRow> {
    let trim = Condition::level(airspeed_mps, height_m).trim(dynamics)?;
    let controls = &trim.inputs.controls;
    let engine_rps = trim.state.engine_rps;
    let density = atmosphere::density(height_m);
    let forward_mps = airspeed_mps * libm::cos(trim.alpha_rad);
    let propeller = dynamics
        .parameters
        .propeller
        .thrust(forward_mps, engine_rps, density);
    Some(TrimRow {
        airspeed_mps,
        alpha_deg: trim.alpha_rad.to_degrees(),
        elevator_deg: controls.surfaces.elevator_rad.to_degrees(),
        throttle: controls.throttle,
        thrust_n: propeller.thrust_n,
        shaft_power_kw: 1e-3 * std::f64::consts::TAU * engine_rps * propeller.torque_nm,
        engine_rpm: 60.0 * engine_rps,
        modes: modes(dynamics, &trim),
    })
}

/// The whole table; `None` if the aircraft cannot fly level at sea level at all.
pub fn performance(dynamics: &Dynamics) -> Option<Performance> {
    let fastest = max_speed(dynamics, 0.0)?;
    let climb = best_climb(dynamics, 0.0)?;
    let max_speed_mps = fastest.state.velocity_enu_mps.norm();
    let clean_stall_mps = stall_speed_mps(dynamics, 0.0, 0.0);
    let propeller = &dynamics.parameters.propeller;
    let kmh = 3.6;
    let speeds = (0..5).map(|i| {
        1.3 * clean_stall_mps + f64::from(i) / 4.0 * (0.97 * max_speed_mps - 1.3 * clean_stall_mps)
    });
    Some(Performance {
        name: dynamics.parameters.name.clone(),
        max_speed_kmh: kmh * max_speed_mps,
        stall_speed_kmh: kmh * stall_speed_mps(dynamics, 0.0, 1.0),
        clean_stall_speed_kmh: kmh * clean_stall_mps,
        climb_rate_mps: climb.climb_rate_mps,
        climb_speed_kmh: kmh * climb.state.velocity_enu_mps.norm(),
        service_ceiling_m: ceiling_m(dynamics, SERVICE_CLIMB_MPS),
        ceiling_m: ceiling_m(dynamics, 0.0),
        engine_rpm_at_max_speed: 60.0 * fastest.state.engine_rps,
        engine_rpm_in_climb: 60.0 * climb.state.engine_rps,
        propeller_efficiency_at_max_speed: propeller
            .efficiency(max_speed_mps / (fastest.state.engine_rps * propeller.diameter_m)),
        trims: speeds
            .filter_map(|speed| trim_row(dynamics, speed, 0.0))
            .collect(),
    })
}
