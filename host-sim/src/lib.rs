//! Host side of the inertial-navigation core: simulation, logs, identification, reports.

pub mod accuracy;
pub mod aircraft;
pub mod analysis;
pub mod cli;
pub mod compare;
pub mod configure;
pub mod error_free;
pub mod figures;
pub mod flights;
pub mod free_inertial;
pub mod hil;
pub mod identify;
pub mod kalman;
pub mod log;
pub mod outage;
pub mod output;
pub mod quantities;
pub mod report;
pub mod sim;
pub mod summary;
pub mod table;
pub mod tables;
pub mod truth;
