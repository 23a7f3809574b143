//! The core run over a log: its estimates, their validation, and the model of the sensors' errors.

pub mod against_truth;
pub mod analysis;
pub mod baro_aided_ins;
pub mod configure;
pub mod error_model;
pub mod free_inertial;
pub(crate) mod halves;
pub mod innovations;
pub mod quantities;
pub mod row;
pub mod run;
pub mod summary;
pub mod true_errors;
pub mod verdict;
pub(crate) mod words;
