//! Host side of the inertial-navigation core: simulation, logs, identification, reports.

pub mod aircraft;
pub mod sim;
pub mod accuracy;
