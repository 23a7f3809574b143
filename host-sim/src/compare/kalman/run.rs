//! The filter over a log, from the core's own alignment on; and the fixed-interval smoother of Rauch, Tung
//! and Striebel.
//!
//! The filter corrects its solution by every error estimate, so errors of that solution are smoothed: `s`
//! of the corrected and `s + errors` of the predicted one at the same fix.

use core::iter::Peekable;
use core::slice::Iter;

use ins_core::config::HeadingSource;
use ins_core::increments::{Increments, Interval};
use ins_core::{Config, ConfigError, Estimates, GnssFix, ImuSample, Navigator, Time};

use super::filter::{Correction, Filter, Start};
use super::{Noise, Nominal, StateMatrix, States, propagated, times};

/// Longest gap in the samples that is integrated over, s: there is no noise model of the motion in one.
const LONGEST_GAP_S: f64 = 0.5;

/// The filter and the samples and fixes that it has yet to process. Clone it for a snapshot.
///
/// A fix is processed when the INS has just reached its time less latency: the filter lags the newest data
/// by the latency.
#[derive(Clone, Debug)]
pub struct Run<'a> {
    config: Config,
    noise: Noise,
    samples: Iter<'a, ImuSample>,
    fixes: Peekable<Iter<'a, GnssFix>>,
    fixes_until: Option<Time>,
    covariance_at_every_sample: bool,
    state: State,
    /// The filter before a gap that was too long.
    before_gap: Option<Box<Filter>>,
    last: Option<(Time, Increments)>,
}

#[derive(Clone, Debug)]
enum State {
    Aligning(Box<Navigator>),
    Filtering(Box<Filter>),
}

impl<'a> Run<'a> {
    /// Before the first sample. The configuration is that of the alignment.
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
            before_gap: None,
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

    /// Ignores fixes of this stamp and later ones.
    pub fn ignore_fixes_from(&mut self, time: Time) {
        self.fixes_until = Some(time);
    }

    pub fn filter(&self) -> Option<&Filter> {
        match &self.state {
            State::Aligning(_) => None,
            State::Filtering(filter) => Some(filter),
        }
    }

    /// Processes one sample and the fixes whose times it has passed, with a call for every update; the
    /// stamp of the sample, or `None` at the end of the log.
    pub fn step(&mut self, corrected: &mut dyn FnMut(&Filter, Correction)) -> Option<Time> {
        let sample = self.samples.next()?;
        let last = self.last.as_ref().map_or(sample.time, |(time, _)| *time);
        let interval = self.interval(sample);
        match (&self.state, interval) {
            (State::Aligning(_), _) => self.align(sample),
            (State::Filtering(_), None) => {}
            (State::Filtering(_), Some(_)) if sample.time.seconds_since(last) > LONGEST_GAP_S => {
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

    /// Increments since the previous sample; none without one, or with one of the same time.
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
            if let Some(before_gap) = &self.before_gap {
                filter.keep_sensors_of(before_gap);
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
            let moment = fix.time.plus_seconds(-filter.nominal.latency_s);
            moment <= filter.time && self.fixes_until.is_none_or(|until| fix.time < until)
        }) {
            let correction = filter.correct(fix);
            corrected(filter, correction);
        }
    }

    /// After a gap that is too long: aligns anew, and keeps the sensor estimates.
    fn align_again(&mut self, sample: &ImuSample) {
        // A given heading is that of the first sample.
        self.config.heading = HeadingSource::Auto;
        // The configuration was accepted before.
        if let Ok(navigator) = Navigator::new(self.config) {
            let aligning = State::Aligning(Box::new(navigator));
            if let State::Filtering(before_gap) = std::mem::replace(&mut self.state, aligning) {
                self.before_gap = Some(before_gap);
            }
            self.last = None;
            let _ = self.interval(sample);
            self.align(sample);
        }
    }
}

/// The filter just after an update, for the smoother.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    pub time: Time,
    nominal: Nominal,
    run_s: f64,
    correction: Correction,
}

/// Smoothed state at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Smoothed {
    pub time: Time,
    pub nominal: Nominal,
    pub estimates: Estimates,
}

impl Record {
    pub fn new(filter: &Filter, correction: Correction) -> Self {
        Self {
            time: filter.time,
            nominal: filter.nominal,
            run_s: filter.run_s(),
            correction,
        }
    }
}

/// Backward pass over the records of a filter with this noise model, which must not contain a new
/// alignment.
pub fn smooth(records: &[Record], noise: &Noise) -> Vec<Smoothed> {
    let Some(last) = records.last() else {
        return Vec::new();
    };
    let layout = noise.layout();
    let smoothed_at = |record: &Record, errors: &States, covariance: &StateMatrix| {
        let nominal = record.nominal.corrected_by(errors, &layout);
        Smoothed {
            time: record.time,
            nominal,
            estimates: nominal.estimates(covariance, record.run_s, &layout, noise),
        }
    };
    let mut errors = States::zeros(layout.size);
    let mut covariance = last.correction.corrected.clone();
    let mut smoothed = vec![smoothed_at(last, &errors, &covariance)];
    for pair in records.windows(2).rev() {
        let (record, next) = (&pair[0], &pair[1].correction);
        let Some(gain) = gain(&record.correction.corrected, next) else {
            break;
        };
        errors = &gain * (errors + &next.errors);
        let change = propagated(&gain, &(covariance - &next.predicted));
        covariance = &record.correction.corrected + change;
        smoothed.push(smoothed_at(record, &errors, &covariance));
    }
    smoothed.reverse();
    smoothed
}

/// Smoother gain `P F^T P'^-1`; `None` if the predicted covariance is singular.
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
        let gap = Time::default().plus_seconds(299.0);
        while run.step(&mut |_, _| {}).is_some_and(|time| time < gap) {}
        let before = run.filter().expect("aligned").sigmas()[index::LATENCY];
        run.finish();
        let filter = run.filter().expect("aligned again");
        let latency_sigma_s = filter.sigmas()[index::LATENCY];
        assert!(latency_sigma_s < before, "{latency_sigma_s} after {before}");
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
