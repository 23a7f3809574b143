//! Studies: many runs, or many logs, to one table of how good and how honest the results are.

pub mod accuracy;
pub mod conditions;
pub mod flights;
pub mod logs;
pub(crate) mod options;
pub mod plan_drive;
pub mod recordings;
pub mod recovery;
pub mod reproduce;
pub(crate) mod subject;
