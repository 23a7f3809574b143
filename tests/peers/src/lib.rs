//! Published filters on the emulated board, behind the same link as the firmware, so that the host
//! drives them and counts their calls in the same way.
#![no_std]

pub mod filters;
mod navigation;
mod only;

pub use navigation::serve;
pub use only::only;
