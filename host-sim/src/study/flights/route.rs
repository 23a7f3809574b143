//! The planned route, in a random direction for each flight.

use std::path::Path;

use ins_core::earth::wrap_pi;
use nalgebra::{Rotation3, Vector3};

use crate::aircraft::cessna172;
use crate::aircraft::dynamics::Dynamics;
use crate::aircraft::flight::{Flight, FlightError};
use crate::aircraft::input::InputError;
use crate::aircraft::plan::{Leg, Path2d, Plan, at};
use crate::sim::ideal::displaced;
use crate::sim::noise::Random;

const FILE: &str = "plans/route_one_hour.toml";
const ROUTE: &str = include_str!("../../../plans/route_one_hour.toml");

/// An aircraft and the route it flies.
#[derive(Clone, Debug)]
pub struct Route {
    dynamics: Dynamics,
    plan: Plan,
}

impl Route {
    /// The Cessna 172 on the built-in route of one hour.
    pub fn cessna172() -> Result<Self, InputError> {
        let dynamics = Dynamics::new(&cessna172());
        let plan = Plan::parse(Path::new(FILE), ROUTE, &dynamics)?;
        Ok(Self { dynamics, plan })
    }

    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Flight `seed`, repeating the route for a duration: route and wind are rotated by a random angle, so that
    /// no heading is preferred, and turbulence is drawn anew.
    pub fn flight(&self, seed: u64, duration_s: f64) -> Result<Flight, FlightError> {
        let pi = core::f64::consts::PI;
        let angle_rad = Random::stream(seed, "route direction").uniform([-pi, pi]);
        let plan = Plan {
            duration_s: Some(duration_s),
            ..turned(&self.plan, angle_rad)
        };
        self.fly(&plan, seed)
    }

    /// Straight flight on the initial heading for a duration.
    pub fn straight(&self, seed: u64, duration_s: f64) -> Result<Flight, FlightError> {
        let start = self.plan.start;
        let leg = Leg {
            path: Path2d::Heading {
                heading_rad: start.heading_rad,
                duration_s,
            },
            height_m: start.position.height_m,
            airspeed_mps: start.airspeed_mps,
        };
        let plan = Plan {
            duration_s: Some(duration_s),
            legs: vec![leg],
            ..self.plan.clone()
        };
        self.fly(&plan, seed)
    }

    /// Flies it without sensors first, to reject a plan that cannot be flown.
    fn fly(&self, plan: &Plan, seed: u64) -> Result<Flight, FlightError> {
        let flight = Flight::new(&self.dynamics, plan, seed)?;
        flight.duration_s()?;
        Ok(flight)
    }
}

/// The plan rotated clockwise about its start.
fn turned(plan: &Plan, angle_rad: f64) -> Plan {
    let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), -angle_rad);
    let turned_heading = |heading_rad: f64| wrap_pi(heading_rad + angle_rad);
    let start = plan.start.position;
    let path = |leg: &Leg| match leg.path {
        Path2d::To(position) => {
            let to = at(position, start.height_m).enu_from(&start);
            Path2d::To(displaced(&start, &(rotation * to)).lat_lon())
        }
        Path2d::Heading {
            heading_rad,
            duration_s,
        } => Path2d::Heading {
            heading_rad: turned_heading(heading_rad),
            duration_s,
        },
        bank @ Path2d::Bank { .. } => bank,
    };
    let mut turned = plan.clone();
    turned.start.heading_rad = turned_heading(plan.start.heading_rad);
    turned.wind_enu_mps = rotation * plan.wind_enu_mps;
    for leg in &mut turned.legs {
        leg.path = path(leg);
    }
    turned
}
