//! A simulated drive, and the estimates on it.

use indicatif::ProgressBar;
use ins_core::config::{Feedback, Form};
use ins_core::increments::Interval;
use ins_core::{Config, ConfigError, Solution, Time};
use nalgebra::{Vector2, Vector3};

use super::part::GRADE;
use crate::compare::five_stage::{self, FiveStage};
use crate::identify::baro_aided_ins::BaroAidedIns;
use crate::identify::configure::config_of;
use crate::identify::free_inertial::feed_intervals;
use crate::identify::row::Row;
use crate::identify::run::{Identification, identify, record};
use crate::log::{BodyAxes, Log};
use crate::sim::{DriveConfig, SimulatedDrive, simulate};
use crate::study::accuracy;

/// Interval between velocity errors, s.
const EVERY_S: f64 = 1.0;

/// East and north, m/s, over time, s.
pub(super) type Velocities = Vec<(f64, Vector2<f64>)>;

pub(super) struct Drive {
    /// With its truth.
    pub(super) log: Log,
    /// The same without white noise of the gyros.
    pub(super) without_arw: Log,
    pub(super) config: Config,
    /// The damped INS without feedback, literal form.
    pub(super) open: Vec<Row>,
    /// The core as it is.
    pub(super) found: Identification,
    pub(super) stages: FiveStage,
}

/// A drive as a log, and the configuration of the core for it.
pub(super) fn log_of(drive: SimulatedDrive) -> (Log, Config) {
    let output = accuracy::config_of(GRADE).imu_output;
    let config = config_of(GRADE, output, drive.given_heading_rad);
    (drive.into_log(BodyAxes::Rfu, output), config)
}

/// Configuration of the damped INS of the thesis, without feedback.
pub(super) fn open(config: Config) -> Config {
    Config {
        form: Form::Literal,
        feedback: Feedback::Open,
        ..config
    }
}

impl Drive {
    pub(super) fn new(seed: u64, minutes: f64) -> Result<Self, ConfigError> {
        let mut plan = DriveConfig::new(seed, GRADE, minutes);
        plan.recording.truth_every = 1;
        let (log, config) = log_of(simulate(&plan));
        plan.recording.errors.gyro_deg_h.white_noise = 0.0;
        let without_arw = Log {
            gnss: Vec::new(),
            truth: Vec::new(),
            ..log_of(simulate(&plan)).0
        };
        let (open, _) = record(&log, open(config), &ProgressBar::hidden(), |_, _| {})?;
        Ok(Self {
            open: open.history,
            found: identify(&log, config, &ProgressBar::hidden())?,
            stages: five_stage::run(&log, config, five_stage::REPEATED)?,
            config,
            without_arw,
            log,
        })
    }

    /// Seconds since the first sample.
    pub(super) fn since(&self, time: Time) -> f64 {
        let first = self.log.imu.first();
        first.map_or(0.0, |first| time.seconds_since(first.time))
    }

    /// Truth at the stamp of an inertial sample.
    pub(super) fn truth(&self, time: Time) -> Option<&Solution> {
        let at = self.log.truth.binary_search_by_key(&time, |row| row.time);
        at.ok().map(|at| &self.log.truth[at])
    }

    /// Velocity error of a free INS from `start` on the readings of `log` less `known`, once a second until
    /// `end`, and at `end`; times are since the first sample. Its vertical channel is damped.
    pub(super) fn free(
        &self,
        log: &Log,
        start: &Solution,
        known: impl Fn(Time) -> [Vector3<f64>; 2],
        end: Time,
    ) -> Velocities {
        let mut ins = BaroAidedIns::new(start);
        let mut height_m = start.position.height_m;
        let (mut errors, mut last) = (Velocities::new(), start.time);
        // The errors end where the samples end.
        let _ = feed_intervals(log, start.time, &[], |interval: &Interval, time| {
            let [gyro, accel] = known(time);
            ins.step(
                &interval.without_bias(&gyro, &accel),
                height_m,
                &self.config.damping,
            );
            if let Some(truth) = self.truth(time) {
                height_m = truth.position.height_m;
                if time.seconds_since(last) > EVERY_S - 5e-4 || time >= end {
                    errors.push((self.since(time), ins.velocity_error_mps(truth)));
                    last = time;
                }
            }
            time < end
        });
        errors
    }

    /// Biases estimated by the stages: gyros at a time, and accelerometers.
    pub(super) fn found(&self, time: Time) -> [Vector3<f64>; 2] {
        [self.stages.gyros.at(time), self.accels()]
    }

    /// Accelerometer biases estimated by the stages.
    pub(super) fn accels(&self) -> Vector3<f64> {
        Vector3::from(self.stages.estimates.accel_bias_mps2.map(|bias| bias.value))
    }
}
