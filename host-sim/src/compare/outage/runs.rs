//! The navigators through the outages: each runs over the log once, and a copy of it through
//! every outage without a fix.

use ins_core::{
    Config, ConfigError, Estimate, GnssFix, ImuSample, Navigator, Observability, Phase, Solution,
    Time,
};

use super::drift::{Drift, SETTLE_S};
use super::reference::Reference;
use crate::compare::kalman::{Noise, Run};
use crate::identify::run::{Event, in_order_of_time};
use crate::log::Log;

/// What the core finds in a whole log.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Survey {
    /// Where outages may begin.
    pub first: Option<Time>,
    /// Latency at the end, if observable, s.
    pub latency_s: f64,
}

/// An INS that takes samples and fixes by their stamps.
pub trait Ins: Clone {
    fn on_imu(&mut self, sample: &ImuSample);
    fn on_gnss(&mut self, fix: &GnssFix);
    fn solution(&self) -> Option<Solution>;
}

impl Ins for Navigator {
    fn on_imu(&mut self, sample: &ImuSample) {
        let _ = self.on_imu(sample);
    }

    fn on_gnss(&mut self, fix: &GnssFix) {
        let _ = self.on_gnss(fix);
    }

    fn solution(&self) -> Option<Solution> {
        self.solution()
    }
}

pub fn survey(log: &Log, config: Config) -> Result<Survey, ConfigError> {
    let mut navigator = Navigator::new(config)?;
    let mut survey = Survey::default();
    let (mut since, mut settled, mut observed) = (None, None, None);
    for event in in_order_of_time(&log.imu, &log.gnss) {
        let sample = event.give_to(&mut navigator);
        let Some(sample) = sample.filter(|_| navigator.phase() == Phase::Navigating) else {
            continue;
        };
        let since = *since.get_or_insert(sample.time);
        if sample.time.seconds_since(since) >= SETTLE_S {
            settled.get_or_insert(sample.time);
        }
        if observed.is_none() && is_observed(&navigator.estimates().azimuth_error_rad) {
            observed = Some(sample.time);
        }
    }
    // Never observed, it is not waited for.
    survey.first = settled.map(|settled| settled.max(observed.unwrap_or(settled)));
    let latency = navigator.estimates().gnss_latency_s;
    if is_observed(&latency) {
        survey.latency_s = latency.value;
    }
    Ok(survey)
}

fn is_observed(estimate: &Estimate) -> bool {
    estimate.observability == Observability::Observable
}

/// Any INS through all outages.
pub fn through<I: Ins>(
    log: &Log,
    mut ins: I,
    starts: &[Time],
    reference: &Reference,
) -> Vec<Drift> {
    let mut drifts = Vec::new();
    let mut starts = starts.iter().peekable();
    for event in in_order_of_time(&log.imu, &log.gnss) {
        let now = event.time();
        while let Some(start) = starts.next_if(|start| **start <= now) {
            drifts.push(blind(log, ins.clone(), *start, reference));
        }
        match event {
            Event::Imu(sample) => ins.on_imu(&sample),
            Event::Gnss(fix) => ins.on_gnss(fix),
        }
    }
    drifts
}

/// One outage, from the sample after the last one taken.
fn blind<I: Ins>(log: &Log, mut ins: I, start: Time, reference: &Reference) -> Drift {
    let mut meter = reference.meter(start, log.start());
    for sample in log.imu.since(start) {
        ins.on_imu(&sample);
        if ins
            .solution()
            .is_some_and(|solution| !meter.take(&solution))
        {
            break;
        }
    }
    meter.drift()
}

/// The Kalman filter, which stands at the moments of the fixes, not at their stamps.
pub fn kalman(
    log: &Log,
    config: Config,
    noise: Noise,
    starts: &[Time],
    reference: &Reference,
) -> Result<Vec<Drift>, ConfigError> {
    let imu = log.imu.all();
    let mut run = Run::new(&imu, &log.gnss, config, noise)?;
    let mut drifts = Vec::new();
    let mut starts = starts.iter().peekable();
    while let Some(time) = run.step(&mut |_, _| {}) {
        let latency_s = run.filter().map_or(0.0, |filter| filter.known.latency_s);
        let reached = |start: &&Time| start.plus_seconds(-latency_s) <= time;
        while let Some(start) = starts.next_if(reached) {
            let mut run = run.clone();
            run.take_fixes_until(*start);
            let mut meter = reference.meter(*start, log.start());
            while run.step(&mut |_, _| {}).is_some() {
                let solution = run.filter().map(|f| f.known.solution(f.time));
                if solution.is_some_and(|solution| !meter.take(&solution)) {
                    break;
                }
            }
            drifts.push(meter.drift());
        }
    }
    Ok(drifts)
}
