//! Sensors of one flight, step by step: ideal and measured readings, and the truth.

use ins_core::earth::Geodetic;
use ins_core::increments::{Increments, Interval};
use ins_core::{GnssFix, ImuOutput, ImuSample, Solution, Time};

use crate::aircraft::flight::Flight;
use crate::sim::ErrorModel;
use crate::sim::drive::{IMU_HZ, Recorder, Recording, Step};
use crate::sim::ideal::IdealSensors;
use crate::sim::imu::Biases;

/// Interval between samples, s.
pub const STEP_S: f64 = 1.0 / IMU_HZ;

#[derive(Clone, Debug)]
pub struct Sensors {
    ideal: IdealSensors<Flight>,
    recorder: Recorder,
}

impl Sensors {
    /// Draws the errors of flight `seed`. The model's output must be increments.
    pub fn new(flight: Flight, origin: Geodetic, errors: &ErrorModel, seed: u64) -> Self {
        let ideal = IdealSensors::new(flight, origin, Time::default());
        let recording = Recording {
            seed,
            duration_s: 0.0,
            imu_hz: IMU_HZ,
            truth_every: 1,
            origin,
            errors: errors.clone(),
        };
        Self {
            recorder: Recorder::new(&recording, None, ideal.state()),
            ideal,
        }
    }

    pub fn truth(&self) -> &Solution {
        &self.ideal.state().solution
    }

    pub fn biases(&self) -> Biases {
        self.recorder.unit.biases()
    }

    /// Stamp of a fix less the time of the motion that it measures, s.
    pub fn latency_s(&self) -> f64 {
        self.recorder.receiver.latency_s
    }

    pub fn step(&mut self) -> Step {
        self.recorder.step(&mut self.ideal)
    }

    /// The fixes received before the sample of `step`, the last step.
    pub fn fixes(&mut self, step: &Step) -> impl Iterator<Item = GnssFix> + '_ {
        let fixes = &mut self.recorder.gnss;
        let received = fixes.partition_point(|fix| fix.time < step.sample.time);
        fixes.drain(..received)
    }
}

/// Intervals of the samples, including the first.
#[derive(Clone, Copy, Debug, Default)]
pub struct Intervals(Option<Increments>);

impl Intervals {
    pub fn of(&mut self, sample: &ImuSample) -> Interval {
        self.0
            .get_or_insert_with(|| Increments::new(ImuOutput::Increments, sample))
            .interval(sample, STEP_S)
    }
}
