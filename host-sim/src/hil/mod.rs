//! Hardware in the loop: the navigator on a processor, fed from here.

pub mod bench;
mod board_log;
pub(crate) mod cli;
pub mod emulator;
mod hardware;
mod serial;
pub mod session;
pub mod twin;
mod view;

pub use emulator::{Board, Emulator};
pub use session::{HilError, Session};
pub use twin::Twin;
