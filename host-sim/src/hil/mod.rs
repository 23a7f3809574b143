//! Hardware in the loop: the navigator on a processor, fed from here.

pub mod emulator;
pub mod session;
pub mod twin;

pub use emulator::{Board, Emulator};
pub use session::{HilError, Session};
pub use twin::Twin;
