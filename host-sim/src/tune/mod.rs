//! Sensor parameters identified from a log, in the formats of other programs.
//!
//! The core and the error model identify them; here they get a hint where they are missing, a verdict, and each
//! target's names, signs, axes and units.

mod found;
mod mount;
pub mod targets;
mod tuning;

pub use found::Found;
pub use mount::Vehicle;
pub use tuning::Tuning;
