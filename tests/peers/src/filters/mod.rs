//! Published filters of 15 error states behind one interface, each in its own axes and types; for the
//! emulated board and for the benchmark on the host.

mod fusion;
mod kinavis;

use ins_core::earth::Geodetic;
use ins_core::{GnssFix, ImuSample, Time};

pub use fusion::FusionNav;
pub use kinavis::KinavisIns;

/// Interval of the samples that the host sends, s.
const SAMPLE_S: f64 = 0.01;
/// One sigma of the simulated receiver's velocity, m/s.
const VELOCITY_SIGMA_MPS: f64 = 0.1;

/// A filter that is given one inertial sample and one velocity at a time.
pub trait Peer: Clone {
    /// A sample in the filter's own axes and types.
    type Sample: Copy;
    /// A velocity in the same.
    type Fix: Copy;

    /// At rest; `None` if it does not accept the start.
    fn new(at_rest: &AtRest) -> Option<Self>;
    /// Converts a sample of increments.
    fn sample(sample: &ImuSample) -> Option<Self::Sample>;
    /// Converts a fix, whose time stamp is its time of validity.
    fn fix(fix: &GnssFix) -> Option<Self::Fix>;
    /// Predicts; whether the sample was accepted.
    fn on_imu(&mut self, sample: Self::Sample) -> bool;
    /// Updates with a velocity; whether it was accepted.
    fn on_gnss(&mut self, fix: Self::Fix) -> bool;
}

/// State of the vehicle at rest.
pub struct AtRest {
    pub time: Time,
    pub position: Geodetic,
    pub roll_rad: f64,
    pub pitch_rad: f64,
    pub heading_rad: f64,
}

impl AtRest {
    /// Levelled by one sample. `None` if the fix has no position.
    pub fn new(sample: &ImuSample, fix: &GnssFix, heading_rad: f64) -> Option<Self> {
        let f = sample.accel;
        Some(Self {
            time: sample.time,
            position: fix.geodetic_or(0.0)?,
            roll_rad: libm::atan2(-f.x, f.z),
            pitch_rad: libm::atan2(f.y, f.z),
            heading_rad,
        })
    }
}

/// Rates and specific force, forward-right-down.
fn rates_frd(sample: &ImuSample) -> ([f64; 3], [f64; 3]) {
    let frd = |v: [f64; 3]| [v[1] / SAMPLE_S, v[0] / SAMPLE_S, -v[2] / SAMPLE_S];
    (frd(sample.gyro.into()), frd(sample.accel.into()))
}

/// North, east, down.
fn velocity_ned(fix: &GnssFix) -> [f64; 3] {
    let [east, north, up] = fix.velocity_enu_mps().into();
    [north, east, -up]
}
