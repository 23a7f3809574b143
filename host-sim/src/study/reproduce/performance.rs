//! The thesis's Table 2: performance of the aircraft.

use miette::{Result, miette};

use crate::aircraft::cessna172;
use crate::aircraft::dynamics::Dynamics;
use crate::aircraft::performance::performance as of_aircraft;

/// A line of the thesis's Table 2.
#[derive(Debug)]
pub struct PerformanceRow {
    pub name: &'static str,
    pub specification: f64,
    /// The thesis's model.
    pub thesis: f64,
    pub ours: f64,
}

/// The thesis's Table 2.
pub fn performance() -> Result<[PerformanceRow; 3]> {
    let dynamics = Dynamics::new(&cessna172());
    let ours = of_aircraft(&dynamics).ok_or_else(|| miette!("the aircraft cannot fly level"))?;
    let published = (dynamics.parameters.specification.as_ref())
        .ok_or_else(|| miette!("the aircraft has no published performance"))?;
    let row = |name, specification, thesis, ours| PerformanceRow {
        name,
        specification,
        thesis,
        ours,
    };
    Ok([
        row(
            "maximum level speed, km/h",
            published.max_speed_kmh,
            240.0,
            ours.max_speed_kmh,
        ),
        row(
            "stall speed, flaps down, km/h",
            published.stall_speed_kmh,
            85.0,
            ours.stall_speed_kmh,
        ),
        row(
            "rate of climb, m/s",
            published.climb_rate_mps,
            5.0,
            ours.climb_rate_mps,
        ),
    ])
}
