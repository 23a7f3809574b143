//! Inertial samples as angular rates and specific forces, whether the log holds rates or increments.

use ins_core::ImuOutput;
use nalgebra::Vector3;

use super::series::{Curve, Series};
use super::{Log, Samples};

/// An inertial sample as angular rate and specific force.
#[derive(Clone, Copy)]
pub(super) struct Rate {
    pub(super) time_s: f64,
    pub(super) interval_s: f64,
    pub(super) gyro_radps: Vector3<f64>,
    pub(super) accel_mps2: Vector3<f64>,
}

/// Samples as rates, s from the first one, and their medians.
pub(super) struct Rates<'a> {
    samples: Samples,
    output: ImuOutput,
    first_interval_s: f64,
    remap: &'a dyn Fn(&mut Rate),
    pub(super) median: Medians,
    pub(super) mean_gyro_radps: Vector3<f64>,
}

/// Robust against some seconds of spikes and manoeuvres.
#[derive(Clone, Copy, Default)]
pub(super) struct Medians {
    pub(super) interval_s: f64,
    pub(super) force_mps2: Vector3<f64>,
    pub(super) force_norm_mps2: f64,
    pub(super) gyro_radps: Vector3<f64>,
    pub(super) gyro_norm_radps: f64,
}

fn unchanged(_: &mut Rate) {}

impl<'a> Rates<'a> {
    /// Of a log with this median sample interval.
    pub(super) fn of(log: &Log, interval_s: f64) -> Self {
        Self::new(log.imu.clone(), log.meta.imu, interval_s, &unchanged)
    }

    /// Those before a time.
    pub(super) fn until(&self, end_s: f64) -> Self {
        let samples = match self.samples.first() {
            Some(first) => (self.samples).between(first.time, first.time.plus_seconds(end_s)),
            None => self.samples.clone(),
        };
        Self::new(samples, self.output, self.first_interval_s, self.remap)
    }

    /// The same samples with other units, signs or axes.
    pub(super) fn remapped<'b>(&self, remap: &'b dyn Fn(&mut Rate)) -> Rates<'b> {
        let mut median = self.median;
        let mut rate = Rate {
            time_s: 0.0,
            interval_s: median.interval_s,
            gyro_radps: median.gyro_radps,
            accel_mps2: median.force_mps2,
        };
        remap(&mut rate);
        median.gyro_radps = rate.gyro_radps;
        median.force_mps2 = rate.accel_mps2;
        Rates {
            samples: self.samples.clone(),
            output: self.output,
            first_interval_s: self.first_interval_s,
            remap,
            median,
            mean_gyro_radps: self.mean_gyro_radps,
        }
    }

    fn new(
        samples: Samples,
        output: ImuOutput,
        first_interval_s: f64,
        remap: &'a dyn Fn(&mut Rate),
    ) -> Self {
        let mut rates = Self {
            samples,
            output,
            first_interval_s,
            remap,
            median: Medians::default(),
            mean_gyro_radps: Vector3::zeros(),
        };
        (rates.median, rates.mean_gyro_radps) = medians_and_mean_gyro(rates.iter());
        rates
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = Rate> {
        let (mut first, mut last) = (None, None);
        self.samples.iter().map(move |sample| {
            let since = |last| sample.time.seconds_since(last);
            let interval_s = last
                .replace(sample.time)
                .map_or(self.first_interval_s, since);
            let scale = 1.0 / self.output.per_rate(interval_s);
            let mut rate = Rate {
                time_s: since(*first.get_or_insert(sample.time)),
                interval_s,
                gyro_radps: sample.gyro * scale,
                accel_mps2: sample.accel * scale,
            };
            (self.remap)(&mut rate);
            rate
        })
    }

    /// Angle turned about the median direction of the specific force, over time.
    pub(super) fn angles_about_vertical(&self) -> Curve {
        let up = self.median.force_mps2.normalize();
        let mut angle = 0.0;
        Curve::new(self.iter().map(|rate| {
            angle += rate.gyro_radps.dot(&up) * rate.interval_s;
            (rate.time_s, angle)
        }))
    }
}

fn medians_and_mean_gyro(rates: impl Iterator<Item = Rate>) -> (Medians, Vector3<f64>) {
    let mut all: [Series; 9] = Default::default();
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for rate in rates {
        let (gyro, force) = (rate.gyro_radps, rate.accel_mps2);
        let norms = [gyro.norm(), force.norm(), rate.interval_s];
        let values = gyro.iter().chain(&force).chain(&norms);
        for (series, value) in all.iter_mut().zip(values) {
            series.push(*value);
        }
        sum += gyro;
        count += 1.0;
    }
    let [gx, gy, gz, ax, ay, az, gyro, force, interval] = all.map(Series::median);
    let medians = Medians {
        interval_s: interval,
        force_mps2: Vector3::new(ax, ay, az),
        force_norm_mps2: force,
        gyro_radps: Vector3::new(gx, gy, gz),
        gyro_norm_radps: gyro,
    };
    (medians, sum / count)
}
