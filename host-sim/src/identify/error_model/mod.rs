//! From drives to the statistical model of their sensors, thesis equations (3), (4), (5).
//!
//! What a drive tells of its sensors, and what it does not:
//!
//! - White noise of the gyros: at rest they read it; in motion it makes the tilt walk, which GNSS
//!   velocity shows after some ten seconds. Both enter one likelihood.
//! - Gyro biases: the noise hides anything smaller than `noise / sqrt(time)`. Jumps and correlated
//!   parts of at least that size over their own duration are seen; of smaller and more frequent
//!   jumps only the rate of the walk. A constant and what is correlated over a whole drive are the
//!   same thing to that drive.
//! - Run-to-run spreads stand on three axes a drive: one drive gives them to a factor of two or so.
//! - Accelerometers: constants from turns and stops, white noise at rest. Their noise in motion is not
//!   told from noise of GNSS with a memory, their drift drowns in both: it is that of the class.
//! - Latency: its scatter from drive to drive needs several.
//!
//! All drives are taken as draws from one model: drives of one unit give the spreads of that unit,
//! drives of several units those of the batch. What is not observable is said so, and the model
//! file then has zero for a random part and the value of the class for the rest.

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
