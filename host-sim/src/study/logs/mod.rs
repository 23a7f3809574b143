//! What recorded logs, which have no truth, can tell of the core.
//!
//! Six tests on every log: the constants that its two halves show; the core beside the Kalman
//! filter, the five stages, and itself with a parameter less; what it finds where the log is altered in
//! a known way; outages of 30 s; a free INS with and without the estimates; and how far the receiver's
//! positions wander. Logs on which the core is developed are counted apart from those that judge it.

mod altered;
mod log_study;
pub(crate) mod page;
mod summary;
mod wander;

pub use log_study::{LogStudy, Role};
pub use summary::Study;
pub use wander::{Wander, table as wander_table};
