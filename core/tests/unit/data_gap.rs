//! Errors of readings interpolated over a lost sample in vibration, against the variances stated.
#![allow(clippy::disallowed_methods)]

use core::f64::consts::TAU;

use nalgebra::Vector3;

use super::DataGap;
use crate::increments::Increments;
use crate::samples::{ImuOutput, ImuSample};
use crate::time::Time;

const SAMPLE_S: f64 = 0.01;
const RATE_RADPS: f64 = 0.1;
const ACCEL_MPS2: f64 = 3.0;
/// Engines of 5 to 150 Hz, a lost sample of each, at phases and speeds that fill their ranges evenly: their
/// mean square has settled to a few percent.
const ENGINES: u32 = 2000;

/// Phase of an engine's vibration at a stamp, rad, and its angular frequency, rad/s.
fn phase(engine: u32, seconds: f64) -> (f64, f64) {
    let part = |step: f64| (f64::from(engine) * step).fract();
    let frequency = TAU * (5.0 + 145.0 * part(0.618_034));
    (frequency * seconds + TAU * part(0.754_878), frequency)
}

#[test]
fn samples_lost_in_vibration_cost_what_is_stated() {
    let shaken = Vector3::new(1.0, 0.0, 1.0);
    // Squares of the errors, and variances: of the turn about a level axis and about the vertical, rad^2, and
    // of velocity along an axis, (m/s)^2.
    let (mut squares, mut stated) = (Vector3::zeros(), Vector3::zeros());
    for engine in 0..ENGINES {
        let reading = |index: u32| {
            let seconds = SAMPLE_S * f64::from(index);
            let swing = phase(engine, seconds).0.cos();
            ImuSample {
                time: Time::default().plus_seconds(seconds),
                gyro: shaken * (RATE_RADPS * swing),
                accel: shaken * (ACCEL_MPS2 * swing),
            }
        };
        let mut increments = Increments::new(ImuOutput::Rates, &reading(0));
        for index in 1..=8 {
            increments.interval(&reading(index), SAMPLE_S);
        }
        let (after, seconds) = (reading(10), 2.0 * SAMPLE_S);
        let ends_differ = increments.ends_differ(&after);
        let interval = increments.interval(&after, seconds);
        let [(start, frequency), (end, _)] = [8.0, 10.0].map(|i| phase(engine, SAMPLE_S * i));
        let swung = (end.sin() - start.sin()) / frequency;
        let turned = interval.angle_rad.map(|angle| angle - RATE_RADPS * swung);
        let gained = interval.force_mps.x - ACCEL_MPS2 * swung;
        let gap = DataGap::after(Time::default(), seconds, 0.0, &ends_differ, &Vector3::z());
        let errors = Vector3::new(turned.x, turned.z, gained);
        squares += errors.component_mul(&errors);
        // One of two level axes turns.
        let by = gap.disturbance;
        stated += Vector3::new(2.0 * by.tilt, by.azimuth, by.velocity[0]);
    }
    for ratio in &squares.component_div(&stated) {
        // Half the difference of the ends is right in the mean of all frequencies; an ordinary manoeuvre adds to
        // it.
        assert!((0.9..=1.05).contains(ratio), "{squares}, {ratio}");
    }
}
