//! Simulated vehicles and sensors.
//!
//! A [`Motion`] over a local East-North-Up frame is placed on the rotating ellipsoid by
//! [`ideal::IdealSensors`], an [`errors::ErrorModel`] adds errors to its readings, and
//! [`drive::record`] puts the two together into what a logger would have written.

pub mod barometer;
pub mod car;
mod checks;
pub mod drive;
pub mod errors;
pub mod gnss;
pub mod ideal;
pub mod imu;
pub mod motion;
pub mod noise;
pub mod profile;
pub mod receiver;
pub mod recorded;
pub mod vehicles;

pub use drive::{
    DriveConfig, SensorErrors, SimulatedDrive, mean_up, record, record_with, simulate,
};
pub use errors::ErrorModel;
pub use motion::{Kinematics, Motion};
