//! The filter run over a log, from the core's own alignment on; and back over it: the fixed-interval
//! smoother of Rauch, Tung and Striebel.
//!
//! The filter takes out what it finds, so it is errors of its solution that are smoothed: `s` of
//! the corrected and `s + found` of the predicted one at the same fix.

use core::iter::Peekable;
use core::slice::Iter;

use ins_core::config::HeadingSource;
use ins_core::increments::{Increments, Interval};
use ins_core::{Config, ConfigError, Estimates, GnssFix, ImuSample, Navigator, Time};

use super::filter::{Correction, Filter, Start};
use super::{Known, Noise, StateMatrix, States, propagated, times};

/// Longest hole in the samples that it bridges, s: it has no noise for what happens in one.
const BRIDGED_S: f64 = 0.5;

/// Inertial samples and fixes, and how far the filter has come in them. Clone it for a snapshot.
///
/// A fix is taken when the INS has just reached the fix's own moment: with latency the filter
/// stands that much before the newest data.
#[derive(Clone, Debug)]
pub struct Run<'a> {
    config: Config,
    noise: Noise,
    samples: Iter<'a, ImuSample>,
    fixes: Peekable<Iter<'a, GnssFix>>,
    fixes_until: Option<Time>,
    covariance_at_every_sample: bool,
    state: State,
    /// The filter before a hole that it did not bridge.
    lost: Option<Box<Filter>>,
    last: Option<(Time, Increments)>,
}

#[derive(Clone, Debug)]
enum State {
    Aligning(Box<Navigator>),
    Filtering(Box<Filter>),
}

impl<'a> Run<'a> {
    /// Stands before the first sample. The configuration says how to align.
    pub fn new(
        imu: &'a [ImuSample],
        gnss: &'a [GnssFix],
        config: Config,
        noise: Noise,
    ) -> Result<Self, ConfigError> {
        Ok(Self {
            config,
            noise,
            samples: imu.iter(),
            fixes: gnss.iter().peekable(),
            fixes_until: None,
            covariance_at_every_sample: false,
            state: State::Aligning(Box::new(Navigator::new(config)?)),
            lost: None,
            last: None,
        })
    }

    #[must_use]
    pub fn with_covariance_at_every_sample(self) -> Self {
        Self {
            covariance_at_every_sample: true,
            ..self
        }
    }

    /// Takes no fix of this stamp or a later one.
    pub fn take_fixes_until(&mut self, time: Time) {
        self.fixes_until = Some(time);
    }

    pub fn filter(&self) -> Option<&Filter> {
        match &self.state {
            State::Aligning(_) => None,
            State::Filtering(filter) => Some(filter),
        }
    }

    /// Takes one sample and the fixes whose moments it has passed, and tells of every correction;
    /// the stamp of the sample, or `None` at the end of the log.
    pub fn step(&mut self, corrected: &mut dyn FnMut(&Filter, Correction)) -> Option<Time> {
        let sample = self.samples.next()?;
        let last = self.last.as_ref().map_or(sample.time, |(time, _)| *time);
        let interval = self.interval(sample);
        match (&self.state, interval) {
            (State::Aligning(_), _) => self.align(sample),
            (State::Filtering(_), None) => {}
            (State::Filtering(_), Some(_)) if sample.time.seconds_since(last) > BRIDGED_S => {
                self.align_again(sample);
            }
            (State::Filtering(_), Some(interval)) => {
                self.filter_over(sample.time, &interval, corrected);
            }
        }
        Some(sample.time)
    }

    pub fn finish(&mut self) {
        while self.step(&mut |_, _| {}).is_some() {}
    }

    /// What has come since the sample before; none without one, or with one of the same time.
    fn interval(&mut self, sample: &ImuSample) -> Option<Interval> {
        let Some((last, increments)) = &mut self.last else {
            let increments = Increments::new(self.config.imu_output, sample);
            self.last = Some((sample.time, increments));
            return None;
        };
        let seconds = sample.time.seconds_since(*last);
        (seconds > 0.0).then(|| {
            *last = sample.time;
            increments.interval(sample, seconds)
        })
    }

    fn align(&mut self, sample: &ImuSample) {
        let State::Aligning(navigator) = &mut self.state else {
            return;
        };
        let before = |fix: &&GnssFix| fix.time < sample.time;
        while let Some(fix) = self.fixes.next_if(before) {
            let _ = navigator.on_gnss(fix);
        }
        let _ = navigator.on_imu(sample);
        if let Some(start) = Start::of(navigator, sample.time, &self.noise) {
            let mut filter = Filter::new(&start, &self.noise);
            if let Some(lost) = &self.lost {
                filter.keep_sensors_of(lost);
            }
            if self.covariance_at_every_sample {
                filter.covariance_step_s = 0.0;
            }
            self.state = State::Filtering(Box::new(filter));
        }
    }

    fn filter_over(
        &mut self,
        time: Time,
        interval: &Interval,
        corrected: &mut dyn FnMut(&Filter, Correction),
    ) {
        let State::Filtering(filter) = &mut self.state else {
            return;
        };
        if let Some(correction) = filter.predict(time, interval) {
            corrected(filter, correction);
        }
        while let Some(fix) = self.fixes.next_if(|fix| {
            let moment = fix.time.plus_seconds(-filter.known.latency_s);
            moment <= filter.time && self.fixes_until.is_none_or(|until| fix.time < until)
        }) {
            let correction = filter.correct(fix);
            corrected(filter, correction);
        }
    }

    /// A hole too long to bridge: from the alignment on, with what is known of the sensors.
    fn align_again(&mut self, sample: &ImuSample) {
        // A heading is given for the first sample, and is another one by now.
        self.config.heading = HeadingSource::Auto;
        // The configuration was accepted before.
        if let Ok(navigator) = Navigator::new(self.config) {
            let aligning = State::Aligning(Box::new(navigator));
            if let State::Filtering(lost) = std::mem::replace(&mut self.state, aligning) {
                self.lost = Some(lost);
            }
            self.last = None;
            let _ = self.interval(sample);
            self.align(sample);
        }
    }
}

/// The filter just after a correction, kept for the way back.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    pub time: Time,
    known: Known,
    run_s: f64,
    correction: Correction,
}

/// What all data say of one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Smoothed {
    pub time: Time,
    pub known: Known,
    pub estimates: Estimates,
}

impl Record {
    pub fn new(filter: &Filter, correction: Correction) -> Self {
        Self {
            time: filter.time,
            known: filter.known,
            run_s: filter.run_s(),
            correction,
        }
    }
}

/// Goes back over the records of a filter that was told this noise; they must follow one another
/// without a new alignment between.
pub fn smooth(records: &[Record], noise: &Noise) -> Vec<Smoothed> {
    let Some(last) = records.last() else {
        return Vec::new();
    };
    let layout = noise.layout();
    let less = |record: &Record, errors: &States, covariance: &StateMatrix| {
        let known = record.known.less(errors, &layout);
        Smoothed {
            time: record.time,
            known,
            estimates: known.estimates(covariance, record.run_s, &layout, noise),
        }
    };
    let mut errors = States::zeros(layout.size);
    let mut covariance = last.correction.corrected.clone();
    let mut smoothed = vec![less(last, &errors, &covariance)];
    for pair in records.windows(2).rev() {
        let (record, next) = (&pair[0], &pair[1].correction);
        let Some(gain) = gain(&record.correction.corrected, next) else {
            break;
        };
        errors = &gain * (errors + &next.errors);
        let change = propagated(&gain, &(covariance - &next.predicted));
        covariance = &record.correction.corrected + change;
        smoothed.push(less(record, &errors, &covariance));
    }
    smoothed.reverse();
    smoothed
}

/// `P F^T P'^-1`; `None` if the prediction is singular.
fn gain(corrected: &StateMatrix, next: &Correction) -> Option<StateMatrix> {
    // Scaled to correlations first: variances of radians and metres are decades apart.
    let scale = next
        .predicted
        .diagonal()
        .map(|v| 1.0 / v.max(1e-300).sqrt());
    let scaled = |matrix: &StateMatrix| {
        let (rows, columns) = matrix.shape();
        StateMatrix::from_fn(rows, columns, |row, column| {
            matrix[(row, column)] * scale[row] * scale[column]
        })
    };
    let inverse = scaled(&next.predicted).cholesky()?.inverse();
    let cross = times(&next.transition, corrected).transpose();
    Some(times(&cross, &scaled(&inverse)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::kalman::index;
    use crate::identify::configure::config_of;
    use crate::log::Grade;
    use crate::sim::errors::Outage;
    use crate::sim::{DriveConfig, simulate};

    #[test]
    fn after_a_hole_the_sensors_are_known_and_the_heading_of_the_start_is_not() {
        let mut with_hole = DriveConfig::new(3, Grade::Hg1700, 12.0);
        let model = &mut with_hole.recording.errors;
        model.imu.holes.push(Outage {
            start_s: 300.0,
            duration_s: 0.6,
        });
        let noise = Noise::of_model(model);
        let output = model.imu.output;
        let drive = simulate(&with_hole);
        let config = config_of(Grade::Hg1700, output, drive.given_heading_rad);
        let mut run = Run::new(&drive.imu, &drive.gnss, config, noise).unwrap();
        let hole = Time::default().plus_seconds(299.0);
        while run.step(&mut |_, _| {}).is_some_and(|time| time < hole) {}
        let known = run.filter().expect("aligned").sigmas()[index::LATENCY];
        run.finish();
        let filter = run.filter().expect("aligned again");
        let latency_sigma_s = filter.sigmas()[index::LATENCY];
        assert!(latency_sigma_s < known, "{latency_sigma_s} after {known}");
        let truth = drive.truth.last().unwrap();
        assert_eq!(filter.time, truth.time);
        let attitude = filter.solution().attitude;
        let turn = (attitude * truth.attitude.inverse()).scaled_axis().z;
        let sigma = filter.sigmas()[index::ATTITUDE + 2];
        assert!(
            sigma < 0.01 && turn.abs() < 4.0 * sigma,
            "{turn} of {sigma}"
        );
    }
}
