//! Replies to samples and fixes, the same on a board and on the host.

use ins_core::damping::DampingSignals;
use ins_core::{
    Config, ConfigError, Estimates, FixReport, GnssFix, GnssOutcome, ImuOutcome, ImuSample,
    Navigator,
};

use crate::message::{Answer, Reply, Report, Request};

/// Measures execution time.
pub trait Timer {
    /// Result of `work`, and its ticks.
    fn time<T>(&self, work: impl FnOnce() -> T) -> (T, u32);
}

/// Without a clock all times are zero.
impl Timer for () {
    fn time<T>(&self, work: impl FnOnce() -> T) -> (T, u32) {
        (work(), 0)
    }
}

/// A navigator, and the values last sent.
#[derive(Clone, Debug)]
pub struct Responder {
    navigator: Navigator,
    estimates_every: u32,
    samples: u32,
    estimates: Option<Estimates>,
    signals: Option<DampingSignals>,
    settled: Option<FixReport>,
}

impl Responder {
    /// As [`Request::Start`] asks for it.
    ///
    /// # Errors
    /// If the configuration cannot be used.
    pub fn start(config: Config, estimates_every: u32) -> Result<Self, ConfigError> {
        Ok(Self {
            navigator: Navigator::new(config)?,
            estimates_every,
            samples: 0,
            estimates: None,
            signals: None,
            settled: None,
        })
    }

    /// Takes an inertial sample.
    pub fn on_imu(&mut self, sample: &ImuSample, timer: &impl Timer) -> Answer<ImuOutcome> {
        let (outcome, ticks) = timer.time(|| self.navigator.on_imu(sample));
        self.samples = self.samples.wrapping_add(1);
        self.answer_with(outcome, ticks)
    }

    /// Takes a GNSS fix.
    pub fn on_gnss(&mut self, fix: &GnssFix, timer: &impl Timer) -> Answer<GnssOutcome> {
        let (outcome, ticks) = timer.time(|| self.navigator.on_gnss(fix));
        self.answer_with(outcome, ticks)
    }

    /// The expected reply of a board, with zero duration; `None` to requests that are neither samples nor
    /// fixes.
    pub fn answer(&mut self, request: &Request) -> Option<Reply> {
        match request {
            Request::Imu(sample) => Some(Reply::Imu(Ok(self.on_imu(sample, &())))),
            Request::Gnss(fix) => Some(Reply::Gnss(Ok(self.on_gnss(fix, &())))),
            Request::Hello { .. } | Request::Start { .. } | Request::Status => None,
        }
    }

    fn answer_with<O>(&mut self, outcome: O, ticks: u32) -> Answer<O> {
        let navigator = &self.navigator;
        let due = self.samples.checked_rem(self.estimates_every) == Some(0);
        let report = Report {
            phase: navigator.phase(),
            manoeuvre: navigator.manoeuvre(),
            solution: navigator.solution(),
            estimates: due
                .then(|| changed(&mut self.estimates, navigator.estimates()))
                .flatten(),
            signals: changed(&mut self.signals, navigator.damping_signals()),
            settled: navigator
                .health()
                .last_fix
                .and_then(|fix| changed(&mut self.settled, fix)),
        };
        Answer {
            outcome,
            report,
            ticks,
        }
    }
}

fn changed<T: Copy + PartialEq>(last: &mut Option<T>, now: T) -> Option<T> {
    (*last != Some(now)).then(|| *last.insert(now))
}
