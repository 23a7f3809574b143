//! The estimators: from what GNSS says of the INS to the errors of the sensors.

pub mod information;
pub mod literal;
pub mod observer;
pub mod parameters;
pub mod triangle;
