//! The core run over a log, sample by sample, as firmware would run it.

use std::borrow::Borrow;

use indicatif::ProgressBar;
use ins_core::{
    Config, ConfigError, FixReport, GnssFix, GnssOutcome, ImuOutcome, ImuSample, Navigator, Phase,
    Solution, Time,
};

use crate::identify::against_truth::{self, AgainstTruth};
use crate::identify::free_inertial::{self, VelocityErrors};
use crate::identify::innovations::{Innovation, Innovations};
use crate::identify::row::{Counts, Row, add, due};
use crate::log::Log;

/// Interval between rows of the history, and between solutions kept, s.
const HISTORY_S: f64 = 1.0;
const SOLUTION_S: f64 = 0.1;
/// Events from one step of the progress bar to the next.
const PROGRESS_EVERY: u64 = 4096;

#[derive(Clone, Debug, PartialEq)]
pub struct Identification {
    pub config: Config,
    /// State of the navigator once a second.
    pub history: Vec<Row>,
    pub end: Row,
    /// After the first half of the log; none where the navigator runs elsewhere.
    pub halfway: Option<Row>,
    /// Solutions ten times a second.
    pub solutions: Vec<Solution>,
    pub imu_outcomes: Counts<ImuOutcome>,
    pub fixes: Vec<(Time, GnssOutcome)>,
    /// Innovations of the fixes; none where the navigator runs elsewhere.
    pub innovations: Vec<Innovation>,
    /// Free-inertial velocity error without and with the estimates.
    pub velocity_error: VelocityErrors,
    /// Errors of the solution, damped and free; none without a reference motion.
    pub against_truth: Option<AgainstTruth>,
}

impl Identification {
    pub fn gnss_outcomes(&self) -> Counts<GnssOutcome> {
        let mut counts = Counts::new();
        for (_, outcome) in &self.fixes {
            add(&mut counts, *outcome);
        }
        counts
    }
}

/// Runs the navigator over a log, then checks its estimates on free-inertial windows.
pub fn identify(
    log: &Log,
    config: Config,
    progress: &ProgressBar,
) -> Result<Identification, ConfigError> {
    let (run, end) = record(log, config, progress, |_, _| {})?;
    let found = run.finish(log, config, end);
    progress.finish_and_clear();
    Ok(found)
}

/// Runs the navigator over a log: the record of it, and its state at the end. `after_sample` is called
/// after each sample.
pub(crate) fn record(
    log: &Log,
    config: Config,
    progress: &ProgressBar,
    mut after_sample: impl FnMut(&Navigator, Time),
) -> Result<(Recorder, Row), ConfigError> {
    progress.set_length(log.imu.len() as u64);
    let mut navigator = Navigator::new(config)?;
    let mut run = Recorder::default();
    let (middle, mut last) = (log.middle(), Time::default());
    let mut heights = log.baro.iter().peekable();
    for (count, event) in (1_u64..).zip(in_order_of_time(log.imu.iter(), &log.gnss)) {
        if run.halfway.is_none() && event.time() >= middle {
            run.halfway = Some(Row::of(last, &navigator));
        }
        match event {
            Event::Imu(sample) => {
                last = sample.time;
                run.form_innovations(sample.time, &navigator);
                let outcome = navigator.on_imu(&sample);
                run.on_sample(sample.time, outcome, || Row::of(sample.time, &navigator));
                run.on_settled(navigator.health().last_fix);
                while let Some(height) = heights.next_if(|height| height.time <= sample.time) {
                    let _ = navigator.on_baro(height);
                }
                after_sample(&navigator, sample.time);
            }
            Event::Gnss(fix) => {
                run.innovations.queue(fix);
                run.form_innovations(fix.time, &navigator);
                run.on_fix(fix.time, navigator.on_gnss(fix));
                run.on_settled(navigator.health().last_fix);
            }
        }
        if count % PROGRESS_EVERY == 0 {
            progress.inc(PROGRESS_EVERY);
        }
    }
    Ok((run, Row::of(last, &navigator)))
}

/// Records the outcomes, state and solutions of a navigator, wherever it runs.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    pub(crate) history: Vec<Row>,
    halfway: Option<Row>,
    solutions: Vec<Solution>,
    imu_outcomes: Counts<ImuOutcome>,
    fixes: Vec<(Time, GnssOutcome)>,
    settled: Option<FixReport>,
    innovations: Innovations,
}

impl Recorder {
    fn form_innovations(&mut self, time: Time, navigator: &Navigator) {
        (self.innovations).form_up_to(time, navigator, &self.history, &self.solutions);
    }

    /// After an inertial sample; `row` is called only when one is due.
    pub fn on_sample(&mut self, time: Time, outcome: ImuOutcome, row: impl Fn() -> Row) {
        add(&mut self.imu_outcomes, outcome);
        if due(self.history.last().map(|row| row.time), time, HISTORY_S) {
            self.history.push(row());
        }
        let last = self.solutions.last().map(|solution| solution.time);
        if due(last, time, SOLUTION_S) {
            let row = row();
            // During a realignment the solution is only extrapolated from the last fix.
            let navigates = row.phase == Phase::Navigating;
            self.solutions.extend(row.solution.filter(|_| navigates));
        }
    }

    pub fn on_fix(&mut self, time: Time, outcome: GnssOutcome) {
        self.fixes.push((time, outcome));
    }

    /// Outcome of fixes that were queued, reported for the last of them.
    pub fn on_settled(&mut self, report: Option<FixReport>) {
        let Some(report) = report.filter(|_| report != self.settled) else {
            return;
        };
        self.settled = Some(report);
        let queued = |fix: &&mut (Time, GnssOutcome)| fix.1 == GnssOutcome::Queued;
        let mut waiting = self.fixes.iter_mut().rev().filter(queued).peekable();
        while waiting.next_if(|fix| fix.0 > report.time).is_some() {}
        if waiting.peek().is_some_and(|fix| fix.0 == report.time) {
            for fix in waiting.take(report.fixes.into()) {
                fix.1 = report.outcome;
            }
        }
    }

    /// After the log, with the navigator's state at its end.
    pub fn finish(self, log: &Log, config: Config, end: Row) -> Identification {
        let velocity_error =
            free_inertial::check(log, &self.solutions, &self.history, &end.estimates);
        let against_truth =
            against_truth::check(log, &self.solutions, &self.history, &config.damping);
        Identification {
            config,
            history: self.history,
            end,
            halfway: self.halfway,
            solutions: self.solutions,
            imu_outcomes: self.imu_outcomes,
            fixes: self.fixes,
            innovations: self.innovations.found,
            velocity_error,
            against_truth,
        }
    }
}

/// When an INS counts as settled: it has navigated for some time and, if ever, knows its azimuth.
#[derive(Default)]
pub(crate) struct Settling {
    since: Option<Time>,
    /// First times of either.
    pub settled: Option<Time>,
    pub azimuth_known: Option<Time>,
}

impl Settling {
    /// Takes the next time; whether it has navigated for `after_s` by then.
    pub fn at(
        &mut self,
        now: Time,
        navigates: bool,
        after_s: f64,
        azimuth_known: impl Fn() -> bool,
    ) -> bool {
        self.since = navigates.then(|| self.since.unwrap_or(now));
        let settled = (self.since).is_some_and(|since| now.seconds_since(since) >= after_s);
        self.settled = self.settled.or(settled.then_some(now));
        if navigates && self.azimuth_known.is_none() && azimuth_known() {
            self.azimuth_known = Some(now);
        }
        settled
    }
}

#[derive(Clone, Copy, Debug)]
pub enum Event<'a> {
    Imu(ImuSample),
    Gnss(&'a GnssFix),
}

impl Event<'_> {
    pub fn time(&self) -> Time {
        match self {
            Self::Imu(sample) => sample.time,
            Self::Gnss(fix) => fix.time,
        }
    }

    /// Gives it to a navigator; the sample, if it is one.
    pub fn give_to(&self, navigator: &mut Navigator) -> Option<ImuSample> {
        match self {
            Self::Imu(sample) => {
                let _ = navigator.on_imu(sample);
                Some(*sample)
            }
            Self::Gnss(fix) => {
                let _ = navigator.on_gnss(fix);
                None
            }
        }
    }
}

/// Samples and fixes by stamp; on equal stamps the sample comes first.
pub fn in_order_of_time(
    imu: impl IntoIterator<Item: Borrow<ImuSample>>,
    gnss: &[GnssFix],
) -> impl Iterator<Item = Event<'_>> {
    merged_by_time(imu, gnss.iter().map(|fix| (fix.time, fix)))
}

/// Samples by stamp and fixes by another time; at equal times the sample comes first.
pub(crate) fn merged_by_time<'a>(
    imu: impl IntoIterator<Item: Borrow<ImuSample>>,
    fixes: impl Iterator<Item = (Time, &'a GnssFix)>,
) -> impl Iterator<Item = Event<'a>> {
    let copied = imu.into_iter().map(|sample| *sample.borrow());
    let mut imu = copied.peekable();
    let mut fixes = fixes.peekable();
    std::iter::from_fn(move || match (imu.peek(), fixes.peek()) {
        (Some(sample), fix) if fix.is_none_or(|(time, _)| *time >= sample.time) => {
            imu.next().map(Event::Imu)
        }
        _ => fixes.next().map(|(_, fix)| Event::Gnss(fix)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn samples_come_before_fixes_of_the_same_stamp() {
        let sample = |micros| ImuSample {
            time: Time::from_micros(micros),
            gyro: Vector3::zeros(),
            accel: Vector3::zeros(),
        };
        let fix = |micros| GnssFix {
            time: Time::from_micros(micros),
            ..GnssFix::default()
        };
        let (imu, gnss) = ([sample(10), sample(20)], [fix(5), fix(20), fix(30)]);
        let order: Vec<_> = in_order_of_time(imu, &gnss)
            .map(|event| match event {
                Event::Imu(sample) => ('i', sample.time.as_micros()),
                Event::Gnss(fix) => ('g', fix.time.as_micros()),
            })
            .collect();
        assert_eq!(
            order,
            [('g', 5), ('i', 10), ('i', 20), ('g', 20), ('g', 30)]
        );
    }
}
