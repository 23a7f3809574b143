//! The mechanization alone, fed by ideal sensors: how far it strays from the motion itself.

use ins_core::earth::Geodetic;
use ins_core::increments::Increments;
use ins_core::mechanization::{Controls, Mechanization};
use ins_core::{ImuOutput, ImuSample, Time};

use crate::sim::Motion;
use crate::sim::ideal::IdealSensors;

/// Largest errors of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Worst {
    /// Distance from the true position, m.
    pub position_m: f64,
    /// Velocity, m/s.
    pub velocity_mps: f64,
    /// Angle from the true attitude, rad.
    pub attitude_rad: f64,
}

/// Runs an error-free strapdown along a motion, `rate_hz` increments a second.
pub fn strapdown(motion: impl Motion, origin: Geodetic, rate_hz: u32, duration_s: u32) -> Worst {
    let mut sensors = IdealSensors::new(motion, origin, Time::default());
    let start = sensors.state().solution;
    let mut ins = Mechanization::new(start.position, start.velocity_enu_mps, start.attitude);
    let mut increments: Option<Increments> = None;
    let mut worst = Worst::default();
    let interval_s = 1.0 / f64::from(rate_hz);
    for count in 1..=rate_hz * duration_s {
        let time = Time::default().plus_seconds(f64::from(count) * interval_s);
        let gained = sensors.advance(time);
        let sample = ImuSample {
            time,
            gyro: gained.angle_b_rad,
            accel: gained.velocity_b_mps,
        };
        let increments =
            increments.get_or_insert_with(|| Increments::new(ImuOutput::Increments, &sample));
        let interval = increments.interval(&sample, interval_s);
        ins.step(&interval, &Controls::default());
        let truth = sensors.state().solution;
        let position_m = ins.position.enu_from(&truth.position).norm();
        let velocity_mps = (ins.velocity_enu_mps - truth.velocity_enu_mps).norm();
        worst.position_m = worst.position_m.max(position_m);
        worst.velocity_mps = worst.velocity_mps.max(velocity_mps);
        worst.attitude_rad = worst
            .attitude_rad
            .max(ins.attitude.angle_to(&truth.attitude));
    }
    worst
}
