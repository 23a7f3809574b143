//! Studies: many runs, or many logs, to one table of how good and how honest the results are.

pub mod cli;
pub mod conditions;
pub mod logs;
pub mod plan_drive;
