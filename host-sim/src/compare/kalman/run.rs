//! The filter run over a log, from the core's own alignment on.

use core::iter::Peekable;
use core::slice::Iter;

use ins_core::config::HeadingSource;
use ins_core::increments::Increments;
use ins_core::{Config, ConfigError, GnssFix, ImuSample, Navigator, Time};

use super::filter::{Correction, Filter, Start};
use super::noise::Noise;

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
            last: None,
        })
    }

    /// Steps the covariance at every inertial sample.
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

    /// The filter, once aligned.
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
        match &mut self.state {
            State::Aligning(_) => self.align(sample),
            State::Filtering(_) => self.filter_over(sample, corrected),
        }
        Some(sample.time)
    }

    /// To the end of the log.
    pub fn finish(&mut self) {
        while self.step(&mut |_, _| {}).is_some() {}
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
        remember(&mut self.last, sample, &self.config);
        let Some(start) = Start::of(navigator, sample.time, &self.noise) else {
            return;
        };
        let filter = Filter::new(&start, &self.noise);
        self.state = State::Filtering(Box::new(if self.covariance_at_every_sample {
            filter.with_covariance_at_every_sample()
        } else {
            filter
        }));
    }

    fn filter_over(&mut self, sample: &ImuSample, corrected: &mut dyn FnMut(&Filter, Correction)) {
        let (State::Filtering(filter), Some((last, increments))) =
            (&mut self.state, &mut self.last)
        else {
            return;
        };
        let seconds = sample.time.seconds_since(*last);
        if seconds <= 0.0 {
            return;
        }
        if seconds > BRIDGED_S {
            self.align_again(sample);
            return;
        }
        let interval = increments.interval(sample, seconds);
        *last = sample.time;
        if let Some(correction) = filter.predict(sample.time, &interval) {
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

    /// A hole too long to bridge: from the alignment on, as the core does.
    fn align_again(&mut self, sample: &ImuSample) {
        // A heading is given for the first sample, and is another one by now.
        self.config.heading = HeadingSource::Auto;
        // The configuration was accepted before.
        if let Ok(navigator) = Navigator::new(self.config) {
            self.state = State::Aligning(Box::new(navigator));
            self.last = None;
            self.align(sample);
        }
    }
}

/// Increments need the sample before.
fn remember(last: &mut Option<(Time, Increments)>, sample: &ImuSample, config: &Config) {
    match last {
        Some((time, increments)) => {
            let seconds = sample.time.seconds_since(*time);
            if seconds > 0.0 {
                let _ = increments.interval(sample, seconds);
                *time = sample.time;
            }
        }
        None => *last = Some((sample.time, Increments::new(config.imu_output, sample))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::kalman::index;
    use crate::identify::configure::config_of;
    use crate::sim::errors::Outage;
    use crate::sim::{DriveConfig, Grade, simulate};

    #[test]
    fn the_heading_of_the_start_is_not_given_again_after_a_hole() {
        let mut with_hole = DriveConfig::new(3, Grade::Hg1700, 12.0);
        let model = &mut with_hole.recording.errors;
        model.imu.holes.push(Outage {
            start_s: 300.0,
            duration_s: 0.6,
        });
        let noise = Noise::of_model(model);
        let output = model.imu.output;
        let drive = simulate(&with_hole);
        let config = config_of(Grade::Hg1700.class(), output, drive.given_heading_rad);
        let mut run = Run::new(&drive.imu, &drive.gnss, config, noise).unwrap();
        run.finish();
        let filter = run.filter().expect("aligned again");
        let truth = drive.truth.last().unwrap();
        assert_eq!(filter.time, truth.time);
        let attitude = filter.known.solution(filter.time).attitude;
        let turn = (attitude * truth.attitude.inverse()).scaled_axis().z;
        let sigma = filter.sigmas()[index::ATTITUDE + 2];
        assert!(
            sigma < 0.01 && turn.abs() < 4.0 * sigma,
            "{turn} of {sigma}"
        );
    }
}
