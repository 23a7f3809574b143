//! Inertial samples as rates, whatever the log holds.

use ins_core::ImuOutput;
use nalgebra::Vector3;

use super::typical::{Curve, Series};
use super::{Log, Samples};

/// An inertial sample as rates, whatever the log holds.
#[derive(Clone, Copy)]
pub(super) struct Rate {
    pub(super) time_s: f64,
    pub(super) interval_s: f64,
    pub(super) gyro_radps: Vector3<f64>,
    pub(super) accel_mps2: Vector3<f64>,
}

/// Samples as rates, seconds from the first one, and what is typical of them.
pub(super) struct Rates<'a> {
    samples: Samples,
    output: ImuOutput,
    first_interval_s: f64,
    read: &'a dyn Fn(&mut Rate),
    pub(super) typical: Typical,
}

/// Medians: the few seconds of spikes and manoeuvres do not count.
#[derive(Clone, Copy, Default)]
pub(super) struct Typical {
    pub(super) interval_s: f64,
    pub(super) force_mps2: Vector3<f64>,
    pub(super) force_norm_mps2: f64,
    pub(super) gyro_radps: Vector3<f64>,
    pub(super) gyro_norm_radps: f64,
    /// No median.
    pub(super) mean_gyro_radps: Vector3<f64>,
}

fn as_it_is(_: &mut Rate) {}

impl<'a> Rates<'a> {
    /// Of a log whose samples are so far apart, typically.
    pub(super) fn of(log: &Log, interval_s: f64) -> Self {
        Self::new(log.imu.clone(), log.meta.imu, interval_s, &as_it_is)
    }

    /// Those before a time.
    pub(super) fn until(&self, end_s: f64) -> Self {
        let samples = match self.samples.first() {
            Some(first) => (self.samples).between(first.time, first.time.plus_seconds(end_s)),
            None => self.samples.clone(),
        };
        Self::new(samples, self.output, self.first_interval_s, self.read)
    }

    /// The same samples, with signs and axes read in another way.
    pub(super) fn read_as<'b>(&self, read: &'b dyn Fn(&mut Rate)) -> Rates<'b> {
        let mut typical = self.typical;
        // What is typical of the readings turns with them.
        let mut rate = Rate {
            time_s: 0.0,
            interval_s: typical.interval_s,
            gyro_radps: typical.gyro_radps,
            accel_mps2: typical.force_mps2,
        };
        read(&mut rate);
        typical.gyro_radps = rate.gyro_radps;
        typical.force_mps2 = rate.accel_mps2;
        Rates {
            samples: self.samples.clone(),
            output: self.output,
            first_interval_s: self.first_interval_s,
            read,
            typical,
        }
    }

    fn new(
        samples: Samples,
        output: ImuOutput,
        first_interval_s: f64,
        read: &'a dyn Fn(&mut Rate),
    ) -> Self {
        let mut rates = Self {
            samples,
            output,
            first_interval_s,
            read,
            typical: Typical::default(),
        };
        rates.typical = Typical::of(rates.iter());
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
            (self.read)(&mut rate);
            rate
        })
    }

    /// Time and angle turned so far about the typical direction of the specific force.
    pub(super) fn vertical_angles(&self) -> Curve {
        let up = self.typical.force_mps2.normalize();
        let mut angle = 0.0;
        Curve::new(self.iter().map(|rate| {
            angle += rate.gyro_radps.dot(&up) * rate.interval_s;
            (rate.time_s, angle)
        }))
    }
}

impl Typical {
    fn of(rates: impl Iterator<Item = Rate>) -> Self {
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
        Self {
            interval_s: interval,
            force_mps2: Vector3::new(ax, ay, az),
            force_norm_mps2: force,
            gyro_radps: Vector3::new(gx, gy, gz),
            gyro_norm_radps: gyro,
            mean_gyro_radps: sum / count,
        }
    }
}
