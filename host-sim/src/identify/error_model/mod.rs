//! Identification of the sensors' error model from drives, thesis equations (3), (4), (5).
//!
//! What is observable in a drive, and what is not:
//!
//! - White noise of the gyros: measured directly at rest; in motion it is the random walk of the tilt,
//!   observable in GNSS velocity after some ten seconds. Both enter one likelihood.
//! - Gyro biases: anything smaller than `noise / sqrt(time)` is below the noise. Jumps and correlated
//!   parts of at least that size over their own duration are observable; of smaller and more frequent
//!   jumps only the rate of the random walk. A part correlated over the whole drive cannot be told
//!   from a constant.
//! - Run-to-run sigmas have three samples (axes) a drive: one drive gives them to a factor of two or so.
//! - Accelerometers: constants from turns and stops, white noise at rest. In motion their noise cannot
//!   be told from coloured GNSS noise, and their drift is below both: the class's value is taken.
//! - Latency: its scatter from drive to drive takes several drives.
//!
//! All drives are samples of one model: drives of one unit give the spreads of that unit, drives of
//! several units those of the batch. What is not observable is reported as such, and is zero in the
//! model file if it is a random part, else the value of the class.

pub mod allan;
pub mod filter;
pub mod fit;
pub mod identified;
pub mod interval;
mod maximum;
mod output;
pub mod record;
mod rest_noise;

pub use identified::{Assumed, Identified, Parameter};
pub use output::{MODEL, Sensors, toml, write};
pub use record::Record;
