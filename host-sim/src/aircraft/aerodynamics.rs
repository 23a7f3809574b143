//! Aerodynamic forces and moments: linear derivatives, with stall of the wing.

use super::parameters::Parameters;

/// Air data and angular rates. Rates are those against the air, forward-right-down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flow {
    pub airspeed_mps: f64,
    /// Sine and cosine of the angle of attack, and the angle, rad.
    pub sin_alpha: f64,
    pub cos_alpha: f64,
    pub alpha_rad: f64,
    /// Sideslip, wind from the right positive, rad.
    pub beta_rad: f64,
    pub roll_rate_radps: f64,
    pub pitch_rate_radps: f64,
    pub yaw_rate_radps: f64,
    pub density_kgpm3: f64,
}

/// Control surfaces; signs as in [`super::parameters::Travel`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surfaces {
    pub elevator_rad: f64,
    pub aileron_rad: f64,
    pub rudder_rad: f64,
    /// 0 retracted, 1 landing.
    pub flaps: f64,
}

/// Forces N and moments Nm, forward-right-down, except the terms in `d alpha / dt`, whose derivatives are
/// given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loads {
    pub force: [f64; 3],
    pub moment: [f64; 3],
    pub lift_per_alpha_rate: f64,
    pub pitch_per_alpha_rate: f64,
}

/// The model of one aircraft: its parameters and the stall angles of its wing.
#[derive(Clone, Debug, PartialEq)]
pub struct Aerodynamics {
    parameters: Parameters,
    stall_alpha_rad: [f64; 2],
}

impl Aerodynamics {
    /// Chooses the stall angles so that the lift curve peaks at the given maxima.
    pub fn new(parameters: &Parameters) -> Self {
        let mut model = Self {
            parameters: parameters.clone(),
            stall_alpha_rad: [0.0; 2],
        };
        let (lift, flaps) = (&parameters.lift, &parameters.flaps);
        model.stall_alpha_rad = [
            model.stall_alpha_for(lift.zero, lift.maximum),
            model.stall_alpha_for(lift.zero + flaps.lift, lift.maximum + flaps.lift_maximum),
        ];
        model
    }

    /// Angle of attack of half separation for which the largest lift is `maximum`.
    fn stall_alpha_for(&self, zero: f64, maximum: f64) -> f64 {
        let too_little = |stall: f64| {
            let lift = |alpha: f64| {
                let (sin, cos) = (libm::sin(alpha), libm::cos(alpha));
                self.lift_curve(zero, stall, alpha, sin, cos).0
            };
            let alphas = (0..1000).map(|i| 0.001 * f64::from(i));
            alphas.map(lift).fold(0.0, f64::max) <= maximum
        };
        bisect(too_little, [0.0, 1.0], 50)
    }

    /// Lift coefficient and the separated part of the flow, 0 to 1.
    ///
    /// Attached: linear. Separated: a flat plate, `2 sin^2 cos`.
    fn lift_curve(&self, zero: f64, stall: f64, alpha: f64, sin: f64, cos: f64) -> (f64, f64) {
        let width = self.parameters.lift.stall_width_rad;
        let separated = smooth_step((alpha.abs() - stall) / (2.0 * width) + 0.5);
        let attached = zero + self.parameters.lift.alpha * alpha;
        let plate = 2.0 * sin * sin.abs() * cos;
        (attached + separated * (plate - attached), separated)
    }

    /// Lift coefficient of wing and flaps and the separated part.
    pub fn wing(&self, alpha: f64, sin: f64, cos: f64, flaps: f64) -> (f64, f64) {
        let zero = self.parameters.lift.zero + flaps * self.parameters.flaps.lift;
        let [clean, landing] = self.stall_alpha_rad;
        self.lift_curve(zero, clean + flaps * (landing - clean), alpha, sin, cos)
    }

    /// Elevator for zero pitching moment in steady flight at an angle of attack.
    pub fn trim_elevator(&self, alpha_rad: f64, flaps: f64) -> f64 {
        let pitch = &self.parameters.pitch;
        -(pitch.zero + flaps * self.parameters.flaps.pitch + pitch.alpha * alpha_rad)
            / pitch.elevator
    }

    /// Largest trimmed lift coefficient, which determines the stall speed.
    pub fn maximum_trimmed_lift(&self, flaps: f64) -> f64 {
        (0..500)
            .map(|i| {
                let alpha = 0.001 * f64::from(i);
                let (wing, _) = self.wing(alpha, libm::sin(alpha), libm::cos(alpha), flaps);
                wing + self.parameters.lift.elevator * self.trim_elevator(alpha, flaps)
            })
            .fold(0.0, f64::max)
    }

    pub fn loads(&self, flow: &Flow, surfaces: &Surfaces) -> Loads {
        let p = &self.parameters;
        let speed = flow.airspeed_mps;
        let pressure_area = 0.5 * flow.density_kgpm3 * speed * speed * p.geometry.wing_area_m2;
        let chord_time = 0.5 * p.geometry.mean_chord_m / speed;
        let span_time = 0.5 * p.geometry.wing_span_m / speed;
        let roll_rate = flow.roll_rate_radps * span_time;
        let pitch_rate = flow.pitch_rate_radps * chord_time;
        let yaw_rate = flow.yaw_rate_radps * span_time;
        let (sin, cos) = (flow.sin_alpha, flow.cos_alpha);
        let elevator = surfaces.elevator_rad;

        let (wing, separated) = self.wing(flow.alpha_rad, sin, cos, surfaces.flaps);
        let lift = wing + p.lift.pitch_rate * pitch_rate + p.lift.elevator * elevator;
        let drag = p.drag.zero
            + surfaces.flaps * p.flaps.drag
            + (1.0 - separated) * p.drag.induced * wing * wing
            + separated * 2.0 * sin * sin
            + p.drag.elevator * elevator.abs()
            + p.drag.sideslip * flow.beta_rad * flow.beta_rad;
        let lateral = |c: &super::parameters::Lateral| {
            c.sideslip * flow.beta_rad
                + c.roll_rate * roll_rate
                + c.yaw_rate * yaw_rate
                + c.aileron * surfaces.aileron_rad
                + c.rudder * surfaces.rudder_rad
        };
        let pitch = p.pitch.zero
            + surfaces.flaps * p.flaps.pitch
            + p.pitch.alpha * flow.alpha_rad
            + p.pitch.pitch_rate * pitch_rate
            + p.pitch.elevator * elevator;
        let span = pressure_area * p.geometry.wing_span_m;
        let chord = pressure_area * p.geometry.mean_chord_m;
        Loads {
            force: [
                pressure_area * (lift * sin - drag * cos),
                pressure_area * lateral(&p.side),
                -pressure_area * (lift * cos + drag * sin),
            ],
            moment: [
                span * lateral(&p.roll),
                chord * pitch,
                span * lateral(&p.yaw),
            ],
            lift_per_alpha_rate: pressure_area * chord_time * p.lift.alpha_rate,
            pitch_per_alpha_rate: chord * chord_time * p.pitch.alpha_rate,
        }
    }
}

/// Bisection: the point up to which a condition holds.
pub(super) fn bisect(
    condition: impl Fn(f64) -> bool,
    [mut low, mut high]: [f64; 2],
    iterations: u32,
) -> f64 {
    for _ in 0..iterations {
        let middle = 0.5 * (low + high);
        if condition(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// 0 below 0, 1 above 1, twice differentiable between.
fn smooth_step(x: f64) -> f64 {
    if x <= 0.0 {
        0.0
    } else if x >= 1.0 {
        1.0
    } else {
        x * x * x * (10.0 - x * (15.0 - 6.0 * x))
    }
}
