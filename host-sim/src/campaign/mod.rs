//! Campaigns: units, their drives, the models identified from these, and flights with the true and
//! with the identified models. How accurate a navigation algorithm will be, and whether that can
//! be foretold from drives.
//!
//! Every run is a line in a file that only grows, and is written once the run is over: a campaign
//! that was stopped goes on where it was. What stays in memory is a model a unit and a bit of
//! bookkeeping a run.

pub(crate) mod ledger;
pub(crate) mod plan;
pub(crate) mod run;
pub(crate) mod slurm;
pub(crate) mod summary;
