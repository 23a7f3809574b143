//! The same requests to a navigator here, to compare answers bit for bit.

use ins_core::Navigator;
use ins_core::navigator::ConfigError;
use ins_link::{FixReply, Reply, Request, SampleReply};

/// A navigator on the host that answers as the firmware does.
#[derive(Clone, Debug)]
pub struct Twin {
    navigator: Navigator,
    estimates_every: u32,
    samples: u32,
}

impl Twin {
    /// The twin of a firmware that was started with the same arguments.
    pub fn start(config: ins_core::Config, estimates_every: u32) -> Result<Self, ConfigError> {
        Ok(Self {
            navigator: Navigator::new(config)?,
            estimates_every,
            samples: 0,
        })
    }

    /// What the firmware has to answer, with a duration of nothing; `None` to requests that are
    /// no samples.
    pub fn answer(&mut self, request: &Request) -> Option<Reply> {
        match request {
            Request::Imu(sample) => {
                let outcome = self.navigator.on_imu(sample);
                self.samples = self.samples.wrapping_add(1);
                let wanted = self.samples.checked_rem(self.estimates_every) == Some(0);
                Some(Reply::Imu(Ok(SampleReply::of(
                    &self.navigator,
                    outcome,
                    wanted,
                    0,
                ))))
            }
            Request::Gnss(fix) => {
                let outcome = self.navigator.on_gnss(fix);
                Some(Reply::Gnss(Ok(FixReply::of(&self.navigator, outcome, 0))))
            }
            Request::Hello { .. } | Request::Start { .. } | Request::Status => None,
        }
    }
}

/// Whether two answers are equal in every bit, durations apart.
pub fn same_bits(one: &Reply, other: &Reply) -> bool {
    // The wire carries every bit, -0 and NaN included, which `==` does not tell apart.
    let bits = |reply: &Reply| ins_link::encode(0, &without_ticks(reply.clone()));
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
