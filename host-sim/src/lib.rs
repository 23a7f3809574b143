//! Host side of the inertial-navigation core: simulation, logs, identification, reports.
//!
//! A module uses only those above it, as `tests/layers.rs` checks.

// Tables, plots, pages and folders of results; independent of navigation.
pub mod page;
// Statistics of many values.
pub(crate) mod statistics;

// Logs on disk, checked; import of recordings of other programs.
pub mod log;

// Simulated motion, and its sensors.
pub mod sim;

// Flight dynamics of an aircraft along a plan.
pub mod aircraft;

// The core over a log: estimates, their validation, the error model of the sensors.
pub mod identify;

// Planning of drives that make quantities observable, also in addition to a log.
pub(crate) mod plan_drive;

// Other methods on the same log: Kalman filter and smoother, the five stages, outages.
pub mod compare;

// Results of a log as a page.
pub(crate) mod report;

// Results as parameters of other programs.
pub mod tune;

// Firmware on a board, real or emulated, against the host, bit by bit.
pub mod hil;

// Studies of accuracy and consistency over many seeds or logs.
pub mod study;

// Campaigns of hundreds of units: predicted against true accuracy.
pub(crate) mod campaign;

// Simulated flights of a unit that was identified from its drives, with any algorithm.
pub(crate) mod rehearse;

// The command line: a file for each command.
mod cli;

pub use cli::{Cli, clean_up_when_stopped, run};

// For `figures` of ins-tests, which measures the tables and pictures of the documentation.
pub use cli::campaign_summary;
pub use rehearse::{proof, settings::Drives};
pub use report::picture as picture_of_estimates;
pub use study::plan_drive::page as plan_drive_page;
