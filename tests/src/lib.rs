//! Helpers of the tests that cross crates; the tests are in `tests/tests/`.

pub mod altered;
pub mod cargo;
pub mod firmware;
pub mod footprint;
pub mod jsbsim;
pub mod pages;
pub mod published;
pub mod pyins;
pub mod python;
pub mod recorded;
pub mod simulated;
