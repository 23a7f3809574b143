//! Many seeded flights: what the estimates are worth once GNSS is gone.
//!
//! Each flight is first damped by GNSS, then goes on free, at a height held by a barometer as any
//! real INS has it: alone the vertical channel runs away.

pub mod linear;
pub(crate) mod output;
pub mod route;
pub mod run;
pub mod schuler;
pub mod sensors;
pub mod statistics;
pub mod summary;
