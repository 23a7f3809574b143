//! Host side of the inertial-navigation core: simulation, logs, identification, reports.
//!
//! A room uses only what stands above it, as `tests/layers.rs` checks.

// Tables, plots and pages, folders of results; knows nothing of navigation.
pub mod page;
// What many values say together.
pub(crate) mod statistics;

// A drive on disk, checked; recordings of other programs made into one.
pub mod log;

// Motions, and the sensors that feel them.
pub mod sim;

// An aircraft, flown by forces along a plan.
pub mod aircraft;

// The core over a log: estimates, their worth, the model of the sensors' errors.
pub mod identify;

// Which drive shows what is wanted of a unit: planned, or what a log lacks.
pub(crate) mod plan_drive;

// Other methods on the same log: Kalman filter and smoother, the five stages, outages.
pub mod compare;

// What was found in a log, as a page.
pub(crate) mod report;

// What was found, as parameters of other programs.
pub mod tune;

// Firmware on a board, real or emulated, against the host, bit by bit.
pub mod hil;

// Many seeds, or many logs, to one table: how good, how honest.
pub mod study;

// Units by the hundred: is the accuracy that their models foretell the true one?
pub(crate) mod campaign;

// Flights of a unit that was identified from its drives, with any algorithm.
pub(crate) mod rehearse;

// The command line: a file for each command.
mod cli;

pub use cli::{Cli, clean_up_when_stopped, run};

// For `figures` of ins-tests, which measures the tables and pictures of the documentation.
pub use cli::campaign_summary;
pub use rehearse::{proof, settings::Drives};
pub use report::picture as picture_of_estimates;
pub use study::plan_drive::page as plan_drive_page;
