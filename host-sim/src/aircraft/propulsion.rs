//! A piston engine turning a fixed-pitch propeller.

use std::f64::consts::TAU;

use super::atmosphere::SEA_LEVEL_DENSITY_KGPM3;
use super::parameters::{Engine, Propeller};

/// What the propeller does at one engine speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thrust {
    pub thrust_n: f64,
    pub torque_nm: f64,
}

impl Engine {
    /// Shaft torque, Nm; negative if the throttle is closed further than friction allows.
    ///
    /// Torque at open throttle hardly depends on engine speed. With height and throttle it follows
    /// the density in the manifold less a constant friction (Gagg and Ferrar 1934):
    /// `Q = Q0 (ratio sigma - C) / (1 - C)`.
    pub fn torque_nm(&self, throttle: f64, density_kgpm3: f64) -> f64 {
        let rated = self.rated_power_w / (TAU * self.rated_speed_rps);
        let ratio = self.idle_manifold_ratio + (1.0 - self.idle_manifold_ratio) * throttle;
        let manifold = ratio * density_kgpm3 / SEA_LEVEL_DENSITY_KGPM3;
        rated * (manifold - self.friction) / (1.0 - self.friction)
    }
}

impl Propeller {
    /// Thrust and absorbed torque at a forward airspeed and an engine speed.
    pub fn thrust(&self, airspeed_mps: f64, engine_rps: f64, density_kgpm3: f64) -> Thrust {
        let [p0, p1, p2] = self.power;
        let d = self.diameter_m;
        // Multiplied by n^2 throughout, so that a standing propeller needs no special case.
        let n = engine_rps;
        let jn = airspeed_mps / d;
        let power_n2 = p0 * n * n + p1 * jn * n + p2 * jn * jn;
        let thrust_n2 = self.polar_slope * power_n2 + self.polar_intercept * jn * jn;
        let d4 = density_kgpm3 * d * d * d * d;
        Thrust {
            thrust_n: d4 * thrust_n2,
            torque_nm: d4 * d * power_n2 / TAU,
        }
    }

    /// Efficiency at an advance ratio.
    pub fn efficiency(&self, advance_ratio: f64) -> f64 {
        let [p0, p1, p2] = self.power;
        let j = advance_ratio;
        let power = p0 + p1 * j + p2 * j * j;
        j * (self.polar_slope * power + self.polar_intercept * j * j) / power
    }
}
