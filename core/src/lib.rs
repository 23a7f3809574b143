//! Strapdown inertial navigation damped by GNSS velocity, which finds its own sensor errors.
#![no_std]

pub mod attitude;
pub mod earth;
pub mod estimate;
mod math;
pub mod samples;
pub mod solution;
pub mod time;
