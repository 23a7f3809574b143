//! Helpers of the tests that cross crates; the tests are in `tests/tests/`.

pub mod aircraft;
pub mod cargo;
pub mod drives;
pub mod firmware;
pub mod footprint;
pub mod pages;
pub mod pyins;
pub mod python;
