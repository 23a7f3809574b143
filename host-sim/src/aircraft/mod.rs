//! An aircraft at two levels: flight dynamics over a flat Earth ([`dynamics`]), sensors on the rotating
//! ellipsoid (`crate::sim::ideal`).

pub mod aerodynamics;
pub mod atmosphere;
pub mod autopilot;
pub mod dynamics;
pub mod flight;
pub mod input;
pub mod parameters;
pub mod performance;
pub(crate) mod pictures;
pub mod plan;
pub mod trajectory;
pub mod trim;
pub mod wind;

use parameters::Parameters;

/// The Cessna 172 that comes with the program.
pub const CESSNA_172_TOML: &str = include_str!("../../aircraft/cessna172.toml");

/// Parameters of the Cessna 172.
///
/// # Panics
/// Never: the file is part of the program and tested.
pub fn cessna172() -> Parameters {
    toml::from_str(CESSNA_172_TOML).expect("the built-in aircraft is valid")
}
