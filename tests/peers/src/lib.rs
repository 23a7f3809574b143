//! Published filters on the emulated board, with the same link as the firmware, so that the host runs and counts
//! them in the same way.
#![no_std]

pub mod filters;
mod navigation;
mod only;

pub use navigation::serve;
pub use only::only;
