//! What earlier stages have found, taken out of a log before the next.

use ins_core::config::HeadingSource;
use ins_core::{Config, GnssFix, ImuOutput, ImuSample};
use nalgebra::Vector3;

use crate::log::Log;

/// Errors to take out, SI units, body axes right-forward-up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Correction {
    pub(super) azimuth_rad: f64,
    pub(super) accel_mps2: Vector3<f64>,
    pub(super) gyro_radps: Vector3<f64>,
    pub(super) latency_s: f64,
}

impl Correction {
    /// A log as better sensors and a receiver without latency would have written it.
    pub(super) fn log(&self, log: &Log) -> Log {
        Log {
            meta: log.meta.clone(),
            imu: self.samples(log).into(),
            gnss: log.gnss.iter().map(|fix| self.fix(fix)).collect(),
            truth: Vec::new(),
        }
    }

    /// The heading to start with. One that is found from motion is found anew in every run.
    pub(super) fn config(&self, config: Config) -> Config {
        let heading = match config.heading {
            HeadingSource::Given(heading) => HeadingSource::Given(heading - self.azimuth_rad),
            found => found,
        };
        Config { heading, ..config }
    }

    fn samples(&self, log: &Log) -> Vec<ImuSample> {
        // The interval of the first sample is not known: that of the second will do.
        let second = log.imu.get(1);
        let mut last = second.zip(log.imu.first()).map(|(second, first)| {
            let interval_s = second.time.seconds_since(first.time);
            first.time.plus_seconds(-interval_s)
        });
        let corrected = log.imu.iter().map(|sample| {
            let interval_s = last.map_or(0.0, |last| sample.time.seconds_since(last));
            last = Some(sample.time);
            let held = match log.meta.imu {
                ImuOutput::Rates => 1.0,
                ImuOutput::Increments => interval_s,
            };
            ImuSample {
                time: sample.time,
                gyro: sample.gyro - held * self.gyro_radps,
                accel: sample.accel - held * self.accel_mps2,
            }
        });
        corrected.collect()
    }

    fn fix(&self, fix: &GnssFix) -> GnssFix {
        GnssFix {
            time: fix.time.plus_seconds(-self.latency_s),
            ..*fix
        }
    }
}
