//! The core over a log: what it finds, what that is worth, and the model of the sensors' errors.

pub mod against_truth;
pub mod analysis;
pub mod configure;
pub mod error_model;
pub mod free_inertial;
pub(crate) mod halves;
pub mod held_ins;
pub mod innovations;
pub mod quantities;
pub mod row;
pub mod run;
pub mod summary;
pub mod true_errors;
pub mod verdict;
pub(crate) mod words;
