//! From drives to the statistical model of their sensors, thesis equations (3), (4), (5).

pub mod filter;
pub mod fit;
pub mod interval;
mod maximum;
pub mod record;
mod probe;
