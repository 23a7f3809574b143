//! Climb by a barometer, while no fix measures the vertical.
//!
//! Its zero is unknown: weather, temperature and the flow about the vehicle move it. Its change within
//! seconds is good, and aids the vertical channel like a vertical velocity.

use crate::history::PastState;
use crate::outcome::GnssOutcome;
use crate::samples::BaroHeight;
use crate::time::Time;

/// Interval of a climb, s: its middle is a second back, which late fixes may reach. And longest such
/// interval, for the ring to hold the middle.
const INTERVAL_S: f64 = 2.0;
const LONGEST_S: f64 = 3.0;
/// Scale error by air warmer or colder than standard, one sigma, 1: 12 K. It is constant for the duration
/// of a climb, s.
const SCALE_ERROR: f64 = 0.04;
const CLIMB_DURATION_S: f64 = 60.0;

/// Height at the start of the next climb.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Barometer {
    last: Option<BaroHeight>,
}

/// A climb, and the variance of its velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Climb {
    /// Of its middle.
    pub time: Time,
    mps: f64,
    variance: f64,
    seconds: f64,
}

/// INS minus barometer in a climb.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ClimbDifference {
    pub time: Time,
    pub mps: f64,
    /// Of the barometer, (m/s)^2.
    pub variance: f64,
}

impl Barometer {
    /// Takes a height; some end a climb.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn take(&mut self, height: &BaroHeight) -> Result<Option<Climb>, GnssOutcome> {
        let Some(last) = self.last else {
            self.last = Some(*height);
            return Ok(None);
        };
        let seconds = height.time.seconds_since(last.time);
        if seconds <= 0.0 {
            return Err(GnssOutcome::TimeNotIncreasing);
        }
        if seconds < INTERVAL_S {
            return Ok(None);
        }
        let rise_m = height.height_m - last.height_m;
        if rise_m == 0.0 && seconds <= LONGEST_S {
            return Err(GnssOutcome::Repeated);
        }
        self.last = Some(*height);
        let mps = rise_m / seconds;
        let read_m2 = last.sigma_m * last.sigma_m + height.sigma_m * height.sigma_m;
        let scale_mps = SCALE_ERROR * mps;
        let climb = Climb {
            time: last.time.plus_seconds(0.5 * seconds),
            mps,
            variance: read_m2 / (seconds * seconds)
                + scale_mps * scale_mps * CLIMB_DURATION_S / seconds,
            seconds,
        };
        Ok((rise_m != 0.0 && seconds <= LONGEST_S).then_some(climb))
    }
}

impl ClimbDifference {
    /// Whether it is still used at a later time: the ring holds the time between.
    pub fn is_valid_at(&self, moment: Time) -> bool {
        moment.seconds_since(self.time) < INTERVAL_S
    }
}

impl Climb {
    /// Compares the INS of the middle with it.
    pub fn difference(&self, ins: &PastState) -> ClimbDifference {
        // Mean velocity against that of the middle, with a jerk.
        let bent_mps = ins.jerk_mps3.z * self.seconds * self.seconds / 24.0;
        ClimbDifference {
            time: self.time,
            mps: ins.velocity_mps.z - self.mps,
            variance: self.variance + bent_mps * bent_mps,
        }
    }
}
