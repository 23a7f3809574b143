//! Alignment: roll and pitch from rest or from a coarse mean, heading from the gyros or from
//! motion.

pub mod heading_from_motion;
pub mod levelling;
pub mod rest;
