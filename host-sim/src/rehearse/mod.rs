//! Rehearsals, the semi-natural test: recorded drives of a unit to its error model, flights of the
//! user's plan with ideal readings and the errors of the model laid over them, and the algorithm
//! under test over each: how accurate it will be in the air.
//!
//! A flight is one line in a file that only grows: a rehearsal that was stopped goes on where it
//! was, and shards lie side by side.

pub(crate) mod flight;
pub(crate) mod output;
pub(crate) mod program;
pub mod proof;
mod replay;
pub(crate) mod run;
pub(crate) mod settings;
pub(crate) mod subject;
pub(crate) mod summary;
