//! What recorded logs, which have no truth, can tell of the core.
//!
//! Four tests on every log: the constants that its two halves show; the core beside the Kalman
//! filter, the five stages, and itself with a parameter less; outages of 30 s; and a free INS with
//! and without the estimates. Logs on which the core is developed are counted apart from those
//! that judge it.

mod log_study;
pub mod methods;
pub(crate) mod page;
pub mod role;
mod summary;

use serde::Serialize;

pub use log_study::LogStudy;
use role::Role;
use summary::Summary;

/// All logs, and what they say together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Study {
    /// In the order given.
    pub logs: Vec<LogStudy>,
    /// Development logs and judges apart.
    pub summaries: Vec<Summary>,
}

impl Study {
    /// Adds up.
    pub fn new(logs: Vec<LogStudy>) -> Self {
        let summaries = Role::ALL.map(|role| Summary::of(role, &logs));
        Self {
            logs,
            summaries: summaries.into(),
        }
    }
}
