//! Campaigns (Monte Carlo): units, their drives, the models identified from these, and flights with
//! the true and with the identified models. They show the accuracy of a navigation algorithm, and
//! whether drives predict it.
//!
//! Every run is a line in an append-only file, written once the run is over: a campaign that was
//! stopped resumes where it was. Memory holds a model a unit and the key of every run.

pub(crate) mod ledger;
pub(crate) mod plan;
pub(crate) mod run;
pub(crate) mod slurm;
pub(crate) mod summary;
