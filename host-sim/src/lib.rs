//! Host side of the inertial-navigation core: simulation, logs, identification, reports.

pub mod accuracy;
pub mod aircraft;
pub mod log;
pub mod sim;
