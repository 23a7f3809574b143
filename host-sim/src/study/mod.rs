//! Studies: accuracy and consistency of the estimates over many runs or logs.

pub mod accuracy;
pub mod conditions;
pub(crate) mod estimator;
pub mod flights;
pub mod logs;
pub(crate) mod options;
pub mod plan_drive;
pub mod recordings;
pub mod recovery;
pub mod reproduce;
