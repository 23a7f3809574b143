//! The same requests to a navigator here, to compare answers bit for bit.

use ins_core::{ConfigError, Navigator};
use ins_link::{FixReply, FromBoard, Reply, Report, Reporter, Request, SampleReply};

/// A navigator on the host that answers as the firmware does.
#[derive(Clone, Debug)]
pub struct Twin {
    navigator: Navigator,
    reporter: Reporter,
}

impl Twin {
    /// The twin of a firmware that was started with the same arguments.
    pub fn start(config: ins_core::Config, estimates_every: u32) -> Result<Self, ConfigError> {
        Ok(Self {
            navigator: Navigator::new(config)?,
            reporter: Reporter::new(estimates_every),
        })
    }

    /// What the firmware has to answer, with a duration of nothing; `None` to requests that are
    /// no samples.
    pub fn answer(&mut self, request: &Request) -> Option<Reply> {
        match request {
            Request::Imu(sample) => Some(Reply::Imu(Ok(SampleReply {
                outcome: self.navigator.on_imu(sample),
                report: self.reporter.after_sample(&self.navigator),
                ticks: 0,
            }))),
            Request::Gnss(fix) => Some(Reply::Gnss(Ok(FixReply {
                outcome: self.navigator.on_gnss(fix),
                report: self.reporter.after_fix(&self.navigator),
                ticks: 0,
            }))),
            Request::Hello { .. } | Request::Start { .. } | Request::Status => None,
        }
    }
}

/// Whether two answers are equal in every bit, durations apart.
pub fn same_bits(one: &Reply, other: &Reply) -> bool {
    // The wire carries every bit, -0 and NaN included, which `==` does not tell apart.
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

/// Where two answers differ, in words.
pub fn difference(one: &Reply, other: &Reply) -> &'static str {
    match (one, other) {
        (Reply::Imu(Ok(one)), Reply::Imu(Ok(other))) if one.outcome != other.outcome => "outcome",
        (Reply::Gnss(Ok(one)), Reply::Gnss(Ok(other))) if one.outcome != other.outcome => "outcome",
        (Reply::Imu(Ok(one)), Reply::Imu(Ok(other))) => in_reports(&one.report, &other.report),
        (Reply::Gnss(Ok(one)), Reply::Gnss(Ok(other))) => in_reports(&one.report, &other.report),
        (Reply::Imu(Err(_)) | Reply::Gnss(Err(_)), _) => "no navigator: has the board restarted?",
        _ => "an answer to something else",
    }
}

fn in_reports(one: &Report, other: &Report) -> &'static str {
    if one.phase != other.phase {
        "phase of the alignment"
    } else if one.manoeuvre != other.manoeuvre {
        "manoeuvre"
    } else if one.solution != other.solution {
        "solution"
    } else if one.estimates != other.estimates {
        "estimates"
    } else if one.signals != other.signals {
        "damping signals"
    } else {
        "sign of a zero"
    }
}
