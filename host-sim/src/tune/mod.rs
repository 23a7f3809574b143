//! What a log says of its sensors, as the parameters of programs that use them.
//!
//! The core and the error model find it; here it gets one sentence where it is missing, a verdict,
//! and each target's names, signs, axes and units.

mod found;
mod mount;
pub mod targets;
mod tuning;

pub use found::Found;
pub use mount::Vehicle;
pub use tuning::Tuning;
