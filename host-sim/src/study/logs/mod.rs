//! Tests of the core on recorded logs, which have no truth.
//!
//! Six tests on every log: constants estimated on its two halves; the core against the Kalman filter, the five
//! stages, and itself with one parameter less; the log altered in known ways; outages of 30 s; a free INS with
//! and without the estimates; and the wander of the receiver's positions. Development logs are counted
//! separately from those that judge.

mod altered;
mod log_study;
pub(crate) mod page;
mod summary;
mod wander;

pub use log_study::{LogStudy, Role};
pub use summary::Study;
pub use wander::{Wander, table as wander_table};
