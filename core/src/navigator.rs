//! The whole navigator: samples and fixes in, solution and estimates out.

use nalgebra::Vector3;

use crate::config::Config;
use crate::estimate::Estimates;
use crate::outcome::{GnssOutcome, ImuOutcome};
use crate::samples::{GnssFix, ImuSample};
use crate::solution::{Phase, Solution};
use crate::time::Time;

/// What the vehicle is doing, as found online.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Manoeuvre {
    /// Standing.
    #[default]
    Rest,
    /// Moving steadily.
    Steady,
    /// Gaining speed.
    Accelerating,
    /// Losing speed.
    Braking,
    /// Changing heading.
    Turning,
}

/// What the last accepted fix did to the INS.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DampingSignals {
    /// Stamp of the fix.
    pub time: Time,
    /// Velocity of the INS minus that of the fix, ENU, m/s.
    pub difference_enu_mps: Vector3<f64>,
    /// f^C: correction into the velocity block, ENU, m/s^2.
    pub accel_enu_mps2: Vector3<f64>,
    /// omega^C: correction into the attitude block, ENU, rad/s.
    pub rate_enu_radps: Vector3<f64>,
}

/// The configuration cannot be used; the message says which value and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ConfigError(pub &'static str);

/// Strapdown INS damped by GNSS velocity, with running estimators of its sensors' errors.
#[derive(Clone, Debug, PartialEq)]
pub struct Navigator {
    config: Config,
}

impl Navigator {
    /// A navigator that knows nothing yet.
    pub fn new(config: Config) -> Result<Self, ConfigError> {
        Ok(Self { config })
    }

    /// Takes one inertial sample, in order of time.
    pub fn on_imu(&mut self, sample: &ImuSample) -> ImuOutcome {
        let _ = sample;
        ImuOutcome::Accepted
    }

    /// Takes one GNSS fix, in order of time.
    pub fn on_gnss(&mut self, fix: &GnssFix) -> GnssOutcome {
        let _ = fix;
        GnssOutcome::Accepted
    }

    /// The configuration it runs with.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// How far the alignment has come.
    pub fn phase(&self) -> Phase {
        Phase::default()
    }

    /// Position, velocity and attitude at the last inertial sample, once navigating.
    pub fn solution(&self) -> Option<Solution> {
        None
    }

    /// Errors of the sensors as known now.
    pub fn estimates(&self) -> Estimates {
        Estimates::default()
    }

    /// The manoeuvre going on.
    pub fn manoeuvre(&self) -> Manoeuvre {
        Manoeuvre::default()
    }

    /// The damping signals of the last fix.
    pub fn damping_signals(&self) -> DampingSignals {
        DampingSignals::default()
    }
}
