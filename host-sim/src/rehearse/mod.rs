//! Rehearsals (semi-natural testing): the error model of a unit is identified from recorded drives,
//! flights of the user's plan are simulated with sensors of that model, and the algorithm under test
//! is run over each: a prediction of its accuracy in the air.
//!
//! A flight is one line in an append-only file: a rehearsal that was stopped resumes where it was, and
//! shards write files of their own.

pub(crate) mod flight;
pub(crate) mod output;
pub(crate) mod program;
pub mod proof;
mod replay;
pub(crate) mod run;
pub(crate) mod settings;
pub(crate) mod subject;
pub(crate) mod summary;
