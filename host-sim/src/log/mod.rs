//! Recorded drives: a folder with `imu.csv`, `gnss.csv`, `meta.toml` and, optionally, `baro.csv` and
//! `truth.csv`.
//!
//! In memory everything is in the core's types: body right-forward-up, SI, integer microseconds.
//! Only [`read()`] and [`write()`] know the log's own axes and units.

mod barometer;
mod check;
mod clock;
mod error;
mod fixes;
pub mod import;
mod meta;
mod motion;
mod order;
mod rates;
mod read;
mod samples;
mod sensors;
mod series;
mod table;
mod write;

pub use error::LogError;
pub use meta::{BodyAxes, Grade, Meta};
pub use read::read;
pub use samples::Samples;
pub(crate) use series::median;
use series::median_interval_s;
pub(crate) use write::numbers;
pub use write::{Compression, write};

use ins_core::{BaroHeight, GnssFix, Solution, Time};

/// Nominal gravity, where its variation with position does not matter.
pub(crate) const GRAVITY_MPS2: f64 = 9.81;

#[derive(Clone, Debug, PartialEq)]
pub struct Log {
    pub meta: Meta,
    /// Inertial samples, in order of time.
    pub imu: Samples,
    /// GNSS fixes, in order of time.
    pub gnss: Vec<GnssFix>,
    /// Heights of a barometer, in order of time; empty if the log has none.
    pub baro: Vec<BaroHeight>,
    /// Reference motion; empty if the log has none.
    pub truth: Vec<Solution>,
}

impl Log {
    /// Span of the inertial samples, s.
    pub fn duration_s(&self) -> f64 {
        match (self.imu.first(), self.imu.last()) {
            (Some(first), Some(last)) => last.time.seconds_since(first.time),
            _ => 0.0,
        }
    }

    /// Time of the first inertial sample: differences from it are exact enough in f64.
    pub fn start(&self) -> Time {
        self.imu.first().map_or(Time::default(), |first| first.time)
    }

    /// The part from one time to before another.
    #[must_use]
    pub fn between(&self, from: Time, to: Time) -> Self {
        let starts_here = self.imu.first().is_none_or(|sample| from <= sample.time);
        Self {
            meta: Meta {
                // Stated for the first sample only.
                initial_heading_deg: self.meta.initial_heading_deg.filter(|_| starts_here),
                ..self.meta.clone()
            },
            imu: self.imu.between(from, to),
            gnss: rows_between(&self.gnss, |fix| fix.time, from, to),
            baro: rows_between(&self.baro, |height| height.time, from, to),
            truth: rows_between(&self.truth, |truth| truth.time, from, to),
        }
    }

    /// Median rate of the inertial samples, so that gaps do not count; zero of a single one.
    pub fn imu_rate_hz(&self) -> f64 {
        rate_hz(self.imu.times())
    }

    /// Median rate of the fixes.
    pub fn fix_rate_hz(&self) -> f64 {
        rate_hz(self.gnss.iter().map(|fix| fix.time))
    }

    /// The log up to the middle of its inertial samples, with the fixes before them.
    #[must_use]
    pub fn first_half(&self) -> Self {
        self.between(Time::from_micros(i64::MIN), self.middle())
    }

    /// The log from there on, with the fixes after the samples.
    #[must_use]
    pub fn second_half(&self) -> Self {
        self.between(self.middle(), Time::from_micros(i64::MAX))
    }

    /// Start of the second half.
    pub fn middle(&self) -> Time {
        self.start().plus_seconds(0.5 * self.duration_s())
    }
}

fn rate_hz(times: impl Iterator<Item = Time>) -> f64 {
    match median_interval_s(times) {
        0.0 => 0.0,
        interval_s => 1.0 / interval_s,
    }
}

fn rows_between<T: Clone>(rows: &[T], time: fn(&T) -> Time, from: Time, to: Time) -> Vec<T> {
    let at = |limit: Time| rows.partition_point(|row| time(row) < limit);
    rows[at(from)..at(to).max(at(from))].to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ins_core::{ImuOutput, ImuSample};
    use nalgebra::Vector3;

    #[test]
    fn halves_partition_the_log() {
        let sample = |micros| ImuSample {
            time: Time::from_micros(micros),
            gyro: Vector3::zeros(),
            accel: Vector3::zeros(),
        };
        let fix = |micros| GnssFix {
            time: Time::from_micros(micros),
            ..GnssFix::default()
        };
        let log = Log {
            meta: Meta {
                initial_heading_deg: Some(12.0),
                ..Meta::new(BodyAxes::Rfu, ImuOutput::Rates)
            },
            imu: (0..=10).map(|k| sample(10 * k)).collect::<Vec<_>>().into(),
            gnss: [-5, 20, 50, 70, 105].map(fix).to_vec(),
            baro: Vec::new(),
            truth: Vec::new(),
        };
        let (first, second) = (log.first_half(), log.second_half());
        assert_eq!((first.imu.len(), second.imu.len()), (5, 6));
        assert_eq!((first.gnss.len(), second.gnss.len()), (2, 3));
        assert_eq!(
            second.imu.first().map(|s| s.time),
            Some(Time::from_micros(50))
        );
        assert_eq!(first.meta.initial_heading_deg, Some(12.0));
        assert_eq!(second.meta.initial_heading_deg, None);
    }
}
