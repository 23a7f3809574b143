//! Hardware in the loop: the navigator on a processor, fed from here.

pub mod bench;
pub(crate) mod board_log;
pub mod emulator;
pub(crate) mod hardware;
pub mod session;
pub(crate) mod target;
pub mod twin;
pub(crate) mod view;

pub use emulator::{Board, Emulator};
pub use session::{HilError, Session};
pub use twin::Twin;
