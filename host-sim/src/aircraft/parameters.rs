//! Parameters of an aircraft, as in its TOML file. Units are in the names; angles per
//! radian; coefficients in the usual non-dimensional form (rates by chord or span over 2 V).

use std::f64::consts::TAU;

use serde::Deserialize;

use super::atmosphere::SEA_LEVEL_DENSITY_KGPM3;

#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    pub name: String,
    pub mass: Mass,
    pub geometry: Geometry,
    pub lift: Lift,
    pub drag: Drag,
    pub pitch: Pitch,
    pub side: Lateral,
    pub roll: Lateral,
    pub yaw: Lateral,
    pub flaps: Flaps,
    pub travel: Travel,
    pub engine: Engine,
    pub propeller: Propeller,
    pub autopilot: Autopilot,
    pub vibration: Vibration,
    /// Published performance to compare with, if there is any.
    pub specification: Option<Specification>,
}

impl Parameters {
    /// Parameters that must be positive.
    pub fn must_be_positive(&self) -> [(&'static str, f64); 16] {
        [
            ("mass_kg", self.mass.mass_kg),
            ("roll_inertia_kgm2", self.mass.roll_inertia_kgm2),
            ("pitch_inertia_kgm2", self.mass.pitch_inertia_kgm2),
            ("yaw_inertia_kgm2", self.mass.yaw_inertia_kgm2),
            ("wing_area_m2", self.geometry.wing_area_m2),
            ("wing_span_m", self.geometry.wing_span_m),
            ("mean_chord_m", self.geometry.mean_chord_m),
            ("maximum", self.lift.maximum),
            ("stall_width_rad", self.lift.stall_width_rad),
            ("rated_power_w", self.engine.rated_power_w),
            ("rated_speed_rps", self.engine.rated_speed_rps),
            ("rotating_inertia_kgm2", self.engine.rotating_inertia_kgm2),
            ("diameter_m", self.propeller.diameter_m),
            ("stall_margin", self.autopilot.stall_margin),
            ("maximum_bank_rad", self.autopilot.maximum_bank_rad),
            ("maximum_descent_mps", self.autopilot.maximum_descent_mps),
        ]
    }

    /// Further conditions: dotted key, its value, whether it is valid, and what is expected.
    pub fn must_hold(&self) -> Vec<(&'static str, f64, bool, &'static str)> {
        let (mass, elevator) = (&self.mass, self.pitch.elevator);
        let (ixz, friction) = (mass.product_of_inertia_kgm2, self.engine.friction);
        let is_less = ixz * ixz < mass.roll_inertia_kgm2 * mass.yaw_inertia_kgm2;
        let is_part = (0.0..1.0).contains(&friction);
        let inertia = "a square less than roll times yaw inertia";
        let down = "a negative number: trailing edge down, nose down";
        let mut all = vec![
            ("mass.product_of_inertia_kgm2", ixz, is_less, inertia),
            ("pitch.elevator", elevator, elevator < 0.0, down),
            ("engine.friction", friction, is_part, "0 to below 1"),
        ];
        all.extend(
            self.vibration
                .lines
                .iter()
                .map(|&VibrationLine { order, .. }| {
                    let expected = "a positive multiple of the engine speed";
                    ("vibration.lines.order", order, order > 0.0, expected)
                }),
        );
        all
    }
}

/// Mass and moments of inertia about the centre of mass.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Mass {
    pub mass_kg: f64,
    pub roll_inertia_kgm2: f64,
    pub pitch_inertia_kgm2: f64,
    pub yaw_inertia_kgm2: f64,
    /// Product of inertia forward-down.
    pub product_of_inertia_kgm2: f64,
}

/// Reference lengths of the coefficients.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Geometry {
    pub wing_area_m2: f64,
    pub wing_span_m: f64,
    pub mean_chord_m: f64,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Lift {
    pub zero: f64,
    pub alpha: f64,
    /// Largest value of the clean wing, elevator neutral.
    pub maximum: f64,
    /// Angle of attack over which the flow separates.
    pub stall_width_rad: f64,
    pub pitch_rate: f64,
    pub alpha_rate: f64,
    pub elevator: f64,
}

/// Drag coefficient `zero + induced CL^2 + elevator |de| + sideslip beta^2`.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Drag {
    pub zero: f64,
    pub induced: f64,
    pub elevator: f64,
    pub sideslip: f64,
}

/// Pitching-moment coefficient, nose up positive.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Pitch {
    pub zero: f64,
    pub alpha: f64,
    pub pitch_rate: f64,
    pub alpha_rate: f64,
    pub elevator: f64,
}

/// A lateral coefficient: side force to the right, roll right wing down, or yaw nose right.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Lateral {
    pub sideslip: f64,
    pub roll_rate: f64,
    pub yaw_rate: f64,
    pub aileron: f64,
    pub rudder: f64,
}

/// Additions of fully extended flaps.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Flaps {
    pub lift: f64,
    pub lift_maximum: f64,
    pub drag: f64,
    pub pitch: f64,
}

/// Largest deflections. Elevator: trailing edge down positive; aileron: roll right positive;
/// rudder: trailing edge left (nose left) positive.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Travel {
    pub elevator_up_rad: f64,
    pub elevator_down_rad: f64,
    pub aileron_rad: f64,
    pub rudder_rad: f64,
}

/// Piston engine without supercharger, fixed mixture.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Engine {
    pub rated_power_w: f64,
    pub rated_speed_rps: f64,
    /// Friction and pumping as a part of the indicated torque: C of the Gagg-Ferrar lapse.
    pub friction: f64,
    /// Manifold density over ambient density with the throttle closed.
    pub idle_manifold_ratio: f64,
    /// Crankshaft and propeller.
    pub rotating_inertia_kgm2: f64,
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

/// Fixed-pitch propeller: power coefficient quadratic in the advance ratio J, thrust coefficient
/// by the linear propeller polar `CT / J^2 = slope CP / J^2 + intercept`.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Propeller {
    pub diameter_m: f64,
    pub power: [f64; 3],
    pub polar_slope: f64,
    pub polar_intercept: f64,
}

impl Propeller {
    /// Thrust and absorbed torque at a forward airspeed and an engine speed.
    pub fn thrust(&self, airspeed_mps: f64, engine_rps: f64, density_kgpm3: f64) -> Thrust {
        let [p0, p1, p2] = self.power;
        let d = self.diameter_m;
        // Multiplied by n^2 throughout, so that a propeller at rest is no special case.
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

    pub fn efficiency(&self, advance_ratio: f64) -> f64 {
        let [p0, p1, p2] = self.power;
        let j = advance_ratio;
        let power = p0 + p1 * j + p2 * j * j;
        j * (self.polar_slope * power + self.polar_intercept * j * j) / power
    }
}

/// Thrust and torque of the propeller at one engine speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thrust {
    pub thrust_n: f64,
    pub torque_nm: f64,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Autopilot {
    /// Lowest speed command, as a multiple of the clean stall speed.
    pub stall_margin: f64,
    pub maximum_bank_rad: f64,
    pub maximum_roll_rate_radps: f64,
    pub maximum_descent_mps: f64,
    /// Pitch command per climb-rate error, rad/(m/s).
    pub pitch_per_climb: f64,
    /// Its integral, rad/(m/s)/s.
    pub pitch_per_climb_integral: f64,
    /// Elevator per pitch error, and per pitch rate, s.
    pub elevator_per_pitch: f64,
    pub elevator_per_pitch_rate_s: f64,
    /// Throttle per speed error, 1/(m/s), and its integral, 1/m.
    pub throttle_per_speed: f64,
    pub throttle_per_speed_integral: f64,
    /// Aileron per roll error and per roll rate, s.
    pub aileron_per_roll: f64,
    pub aileron_per_roll_rate_s: f64,
    /// Rudder per sideslip, its integral, 1/s, and per yaw-rate error, s.
    pub rudder_per_sideslip: f64,
    pub rudder_per_sideslip_integral: f64,
    pub rudder_per_yaw_rate_s: f64,
}

/// Vibration of the inertial unit by engine and propeller at cruise speed of the engine.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Vibration {
    pub lines: Vec<VibrationLine>,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct VibrationLine {
    /// Multiple of the engine speed.
    pub order: f64,
    /// Amplitude of the acceleration right, forward, up at the rated engine speed, m/s^2.
    pub acceleration_mps2: [f64; 3],
    /// Amplitude of the angular rate about the same axes, rad/s.
    pub rate_radps: [f64; 3],
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Specification {
    pub max_speed_kmh: f64,
    pub stall_speed_kmh: f64,
    pub climb_rate_mps: f64,
}
