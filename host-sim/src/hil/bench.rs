//! The board's answers to a log, recorded as `identify` records the host's, and compared with those.

use std::borrow::Borrow;

use ins_core::{Config, ConfigError, GnssFix, ImuSample};
use ins_link::{Answer, FromBoard, Reply, Report, Request, Responder};
use serde::Serialize;

use crate::identify::row::Row;
use crate::identify::run::{Event, Identification, Recorder, in_order_of_time};
use crate::log::Log;

/// Estimates are requested after every sample.
pub const ESTIMATES_EVERY: u32 = 1;

/// Samples and fixes as requests, by stamp.
pub fn requests<'a>(
    imu: impl IntoIterator<Item: Borrow<ImuSample>> + 'a,
    gnss: &'a [GnssFix],
) -> impl Iterator<Item = Request> + 'a {
    in_order_of_time(imu, gnss).map(request)
}

/// A sample or a fix as a request to the board.
pub fn request(event: Event) -> Request {
    match event {
        Event::Imu(sample) => Request::Imu(sample),
        Event::Gnss(fix) => Request::Gnss(*fix),
    }
}

/// Comparison of the board's answers with the host's.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Comparison {
    pub answers: u64,
    /// Of these, not the same in every bit.
    pub different: u64,
    /// Samples and fixes without an answer.
    pub missing: u64,
    /// The first that is different or missing.
    pub first: Option<String>,
}

impl Comparison {
    /// Whether no answer is missing, and all are equal bit for bit.
    pub fn is_exact(&self) -> bool {
        self.answers > 0 && self.different == 0 && self.missing == 0
    }

    fn add(&mut self, request: &Request, reply: Option<&Reply>, expected: &Reply) {
        let wrong = match reply {
            None => {
                self.missing += 1;
                "no answer"
            }
            Some(reply) => {
                self.answers += 1;
                if same_bits(reply, expected) {
                    return;
                }
                self.different += 1;
                difference(reply, expected)
            }
        };
        self.first
            .get_or_insert_with(|| format!("{}: {wrong}", name(request)));
    }
}

fn name(request: &Request) -> String {
    match request {
        Request::Imu(sample) => format!("sample of {:.6} s", sample.time.as_seconds()),
        Request::Gnss(fix) => format!("fix of {:.6} s", fix.time.as_seconds()),
        other => format!("{other:?}"),
    }
}

/// Whether two answers are equal bit for bit, except for durations.
fn same_bits(one: &Reply, other: &Reply) -> bool {
    // The encoding has every bit, also of -0 and NaN, which `==` does not distinguish.
    let bits = |reply: &Reply| {
        let reply = without_ticks(reply.clone());
        ins_link::encode(0, &FromBoard::Reply { to: 0, reply })
    };
    bits(one) == bits(other)
}

fn without_ticks(mut reply: Reply) -> Reply {
    match &mut reply {
        Reply::Imu(Ok(sample)) => sample.ticks = 0,
        Reply::Gnss(Ok(fix)) => fix.ticks = 0,
        _ => {}
    }
    reply
}

/// Where two answers differ, as text.
fn difference(one: &Reply, other: &Reply) -> &'static str {
    match (one, other) {
        (Reply::Imu(Ok(one)), Reply::Imu(Ok(other))) => in_answers(one, other),
        (Reply::Gnss(Ok(one)), Reply::Gnss(Ok(other))) => in_answers(one, other),
        (Reply::Imu(Err(_)) | Reply::Gnss(Err(_)), _) => "no navigator: has the board restarted?",
        _ => "an answer to something else",
    }
}

fn in_answers<O: PartialEq>(one: &Answer<O>, other: &Answer<O>) -> &'static str {
    let (a, b) = (&one.report, &other.report);
    let parts = [
        (one.outcome == other.outcome, "outcome"),
        (a.phase == b.phase, "phase of the alignment"),
        (a.manoeuvre == b.manoeuvre, "manoeuvre"),
        (a.solution == b.solution, "solution"),
        (a.estimates == b.estimates, "estimates"),
        (a.signals == b.signals, "damping signals"),
        (a.settled == b.settled, "what became of fixes"),
    ];
    let first = parts.iter().find(|(same, _)| !same);
    first.map_or("sign of a zero", |(_, name)| name)
}

/// Durations of calls of the core, in ticks of the board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ticks {
    count: u64,
    sum: u64,
    worst: u32,
}

/// Their summary.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Took {
    pub mean: u64,
    pub worst: u32,
}

impl Ticks {
    fn add(&mut self, ticks: u32) {
        self.count += 1;
        self.sum += u64::from(ticks);
        self.worst = self.worst.max(ticks);
    }

    /// None without calls.
    pub fn summary(&self) -> Option<Took> {
        Some(Took {
            mean: self.sum.checked_div(self.count)?,
            worst: self.worst,
        })
    }
}

/// The answers of the board so far.
#[derive(Clone, Debug)]
pub struct Bench {
    /// Computes the expected answers on the host.
    reference: Responder,
    recorder: Recorder,
    /// With the answers of the host.
    pub comparison: Comparison,
    /// Last state of the navigator on the board.
    pub latest: Row,
    pub sample_ticks: Ticks,
    pub fix_ticks: Ticks,
}

impl Bench {
    /// For a board that was started with the same configuration.
    pub fn new(config: Config) -> Result<Self, ConfigError> {
        Ok(Self {
            reference: Responder::start(config, ESTIMATES_EVERY)?,
            recorder: Recorder::default(),
            comparison: Comparison::default(),
            latest: Row::default(),
            sample_ticks: Ticks::default(),
            fix_ticks: Ticks::default(),
        })
    }

    pub fn take(&mut self, request: &Request, reply: Option<&Reply>) {
        if let Some(expected) = self.reference.answer(request) {
            self.comparison.add(request, reply, &expected);
        }
        match (request, reply) {
            (Request::Imu(sample), Some(Reply::Imu(Ok(reply)))) => {
                self.latest.time = sample.time;
                self.update_latest(&reply.report);
                self.recorder
                    .on_sample(sample.time, reply.outcome, || self.latest);
                self.sample_ticks.add(reply.ticks);
            }
            (Request::Gnss(fix), Some(Reply::Gnss(Ok(reply)))) => {
                self.recorder.on_fix(fix.time, reply.outcome);
                self.update_latest(&reply.report);
                self.fix_ticks.add(reply.ticks);
            }
            _ => {}
        }
    }

    fn update_latest(&mut self, report: &Report) {
        let latest = &mut self.latest;
        latest.phase = report.phase;
        latest.manoeuvre = report.manoeuvre;
        latest.solution = report.solution;
        latest.estimates = report.estimates.unwrap_or(latest.estimates);
        latest.signals = report.signals.unwrap_or(latest.signals);
        self.recorder.on_settled(report.settled);
    }

    /// Results of the board after the log.
    pub fn finish(self, log: &Log, config: Config) -> Identification {
        self.recorder.finish(log, config, self.latest)
    }
}
