//! Hardware in the loop: the navigator on a processor, fed by the host.

pub mod bench;
pub mod board;
pub(crate) mod board_log;
pub(crate) mod report;
pub mod session;

pub use board::{Board, Emulator};
pub use session::{HilError, Session};
