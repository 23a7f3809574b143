//! Strapdown inertial navigation damped by GNSS velocity, which finds its own sensor errors.
#![no_std]

mod aided;
pub mod alignment;
pub mod attitude;
pub mod config;
pub mod damping;
pub mod earth;
pub mod estimate;
pub mod estimators;
pub mod history;
pub mod increments;
pub mod manoeuvre;
mod math;
pub mod mechanization;
pub mod navigator;
pub mod outcome;
mod ring;
pub mod samples;
pub mod solution;
pub mod time;

pub use config::Config;
pub use estimate::{Estimate, Estimates, Observability};
pub use manoeuvre::Manoeuvre;
pub use navigator::Navigator;
pub use outcome::{GnssOutcome, ImuOutcome};
pub use samples::{GnssFix, ImuOutput, ImuSample};
pub use solution::{Phase, Solution};
pub use time::Time;
