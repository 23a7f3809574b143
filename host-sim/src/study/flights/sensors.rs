//! One flight's sensors, step by step: ideal, measured, and the truth under both.

use ins_core::earth::Geodetic;
use ins_core::increments::{Increments, Interval};
use ins_core::{GnssFix, ImuOutput, ImuSample, Solution, Time};

use crate::aircraft::flight::Flight;
use crate::sim::ErrorModel;
use crate::sim::gnss::Gnss;
use crate::sim::ideal::{IdealSensors, TrueState};
use crate::sim::imu::{Biases, Imu};

/// Inertial samples per second.
pub const RATE_HZ: f64 = 100.0;
/// Their interval, s.
pub const STEP_S: f64 = 1.0 / RATE_HZ;

/// What happened over one sampling interval.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// Truth at its start.
    pub before: TrueState,
    /// As measured.
    pub sample: ImuSample,
    /// What error-free sensors gained.
    pub ideal: ImuSample,
}

#[derive(Clone, Debug)]
pub struct Sensors {
    ideal: IdealSensors<Flight>,
    imu: Imu,
    gnss: Gnss,
    count: u32,
    /// Received, and not stamped before the last inertial sample.
    fixes: Vec<GnssFix>,
}

impl Sensors {
    /// Draws the errors of flight `seed`. The model's output must be increments.
    pub fn new(flight: Flight, origin: Geodetic, errors: &ErrorModel, seed: u64) -> Self {
        Self {
            ideal: IdealSensors::new(flight, origin, Time::default()),
            imu: Imu::new(errors, seed),
            gnss: Gnss::new(&errors.gnss, seed),
            count: 0,
            fixes: Vec::new(),
        }
    }

    pub fn truth(&self) -> &Solution {
        &self.ideal.state().solution
    }

    pub fn biases(&self) -> Biases {
        self.imu.biases()
    }

    /// A fix is stamped so long after the motion that it shows, s.
    pub fn latency_s(&self) -> f64 {
        self.gnss.latency_s
    }

    pub fn step(&mut self) -> Step {
        self.count += 1;
        let time = Time::default().plus_seconds(f64::from(self.count) * STEP_S);
        let before = *self.ideal.state();
        let gained = self.ideal.advance(time);
        let (gyro, accel) = self.imu.measure(&gained, &self.ideal.state().rates, STEP_S);
        Step {
            before,
            sample: ImuSample { time, gyro, accel },
            ideal: ImuSample {
                time,
                gyro: gained.angle_b_rad,
                accel: gained.velocity_b_mps,
            },
        }
    }

    /// The fixes that are received before the sample of `step`, which is the last one.
    pub fn fixes(&mut self, step: &Step) -> impl Iterator<Item = GnssFix> + '_ {
        self.gnss
            .observe(&step.before, self.ideal.state(), &mut self.fixes);
        let received = self
            .fixes
            .partition_point(|fix| fix.time < step.sample.time);
        self.fixes.drain(..received)
    }
}

/// Turns samples into intervals, the first one too.
#[derive(Clone, Copy, Debug, Default)]
pub struct Intervals(Option<Increments>);

impl Intervals {
    pub fn of(&mut self, sample: &ImuSample) -> Interval {
        self.0
            .get_or_insert_with(|| Increments::new(ImuOutput::Increments, sample))
            .interval(sample, STEP_S)
    }
}
