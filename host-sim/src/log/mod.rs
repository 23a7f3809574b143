//! Recorded drives: a folder with `imu.csv`, `gnss.csv`, `meta.toml` and, optionally, `truth.csv`.
//!
//! In memory everything is in the core's types: body right-forward-up, SI, integer microseconds.
//! The log's own axes and units live only in [`read`] and [`write`].

mod axes;
mod check;
mod clock;
mod error;
mod fixes;
mod meta;
mod motion;
mod paths;
mod read;
mod sensors;
mod table;
mod turns;
mod write;

pub use axes::BodyAxes;
pub use error::{Cell, LogError};
pub use meta::{Grade, Meta};
pub use read::read;
pub(crate) use read::settle;
pub use write::{Compression, write};

use ins_core::{GnssFix, ImuSample, Solution};

/// A recorded or simulated drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Log {
    /// How it was recorded.
    pub meta: Meta,
    /// Inertial samples, in order of time.
    pub imu: Vec<ImuSample>,
    /// GNSS fixes, in order of time.
    pub gnss: Vec<GnssFix>,
    /// Reference motion; empty if the log has none.
    pub truth: Vec<Solution>,
}

impl Log {
    /// Span of the inertial samples, s.
    pub fn duration_s(&self) -> f64 {
        match (self.imu.first(), self.imu.last()) {
            (Some(first), Some(last)) => last.time.seconds_since(first.time),
            _ => 0.0,
        }
    }
}
