//! The quantities, in this order everywhere.

use core::f64::consts::PI;

use serde::Serialize;

use crate::identify::quantities::{DEG_H_RADPS, MG_MPS2};

/// A quantity and the engineering unit it is reported in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quantity {
    pub name: &'static str,
    pub unit: &'static str,
    /// SI value of one unit.
    #[serde(skip)]
    pub si: f64,
}

const fn quantity(name: &'static str, unit: &'static str, si: f64) -> Quantity {
    Quantity { name, unit, si }
}

/// Indices into [`QUANTITIES`].
pub(super) mod index {
    pub const HEADING: usize = 0;
    pub const TILT: usize = 1;
    pub const ACCEL: usize = 2;
    pub const GYRO: usize = 5;
    pub const LATENCY: usize = 8;
    pub const LEVER: usize = 9;
    /// Position, height, level and vertical velocity with GNSS.
    pub const AIDED: usize = 12;
    /// The same in outages, then tilt and heading.
    pub const COASTING: usize = 16;
}

/// At the end of a run; the last ten are RMS over its second half, with GNSS and in outages separately,
/// horizontal ones per axis. Axes are those of the unit.
#[rustfmt::skip]
pub const QUANTITIES: [Quantity; 22] = [
    quantity("heading", "deg", PI / 180.0),
    quantity("roll and pitch", "deg", PI / 180.0),
    quantity("accelerometer x", "mg", MG_MPS2),
    quantity("accelerometer y", "mg", MG_MPS2),
    quantity("accelerometer z", "mg", MG_MPS2),
    quantity("gyro x", "deg/h", DEG_H_RADPS),
    quantity("gyro y", "deg/h", DEG_H_RADPS),
    quantity("gyro z", "deg/h", DEG_H_RADPS),
    quantity("latency", "ms", 1e-3),
    quantity("lever arm x", "m", 1.0),
    quantity("lever arm y", "m", 1.0),
    quantity("lever arm z", "m", 1.0),
    quantity("level position", "m", 1.0),
    quantity("height", "m", 1.0),
    quantity("level velocity", "m/s", 1.0),
    quantity("vertical velocity", "m/s", 1.0),
    quantity("level position in outages", "m", 1.0),
    quantity("height in outages", "m", 1.0),
    quantity("level velocity in outages", "m/s", 1.0),
    quantity("vertical velocity in outages", "m/s", 1.0),
    quantity("roll and pitch in outages", "deg", PI / 180.0),
    quantity("heading in outages", "deg", PI / 180.0),
];
