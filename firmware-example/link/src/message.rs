//! Messages. Any change here requires a new [`VERSION`](crate::VERSION).

use ins_core::Manoeuvre;
use ins_core::damping::DampingSignals;
use ins_core::{
    Config, Estimates, FixReport, GnssFix, GnssOutcome, ImuOutcome, ImuSample, Phase, Solution,
};
use serde::{Deserialize, Serialize};

use crate::frame::{Counters, Message};

/// Longest piece of the log in one message, bytes.
pub const LOG_BYTES: usize = 128;

/// Host to firmware.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant)] // No heap to box the large one in.
pub enum Request {
    /// Opens a session: sequence numbers and counters restart.
    Hello {
        /// Any number other than that of the last session.
        session: u32,
    },
    /// A new navigator.
    Start {
        /// Its configuration.
        config: Config,
        /// Interval of estimates, in inertial samples (and after fixes that follow directly); they are only
        /// sent if changed. 0: never.
        estimates_every: u32,
    },
    /// An inertial sample.
    Imu(ImuSample),
    /// A GNSS fix.
    Gnss(GnssFix),
    /// Asks for [`Status`].
    Status,
}

impl Message for Request {
    fn session(&self) -> Option<u32> {
        if let Self::Hello { session } = self {
            Some(*session)
        } else {
            None
        }
    }
}

/// Firmware to host.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant)]
pub enum FromBoard {
    /// One for each request.
    Reply {
        /// Sequence number of the request.
        to: u32,
        /// The answer.
        reply: Reply,
    },
    /// The next piece of the log as encoded by defmt, split at any byte.
    Log(heapless::Vec<u8, LOG_BYTES>),
}

impl Message for FromBoard {
    fn session(&self) -> Option<u32> {
        if let Self::Reply {
            reply: Reply::Hello(hello),
            ..
        } = self
        {
            Some(hello.session)
        } else {
            None
        }
    }
}

/// Answer to a request.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant)]
pub enum Reply {
    /// To [`Request::Hello`].
    Hello(Hello),
    /// To [`Request::Start`].
    Start(Result<Started, StartError>),
    /// To [`Request::Imu`].
    Imu(Result<Answer<ImuOutcome>, NotStarted>),
    /// To [`Request::Gnss`].
    Gnss(Result<Answer<GnssOutcome>, NotStarted>),
    /// To [`Request::Status`].
    Status(Status),
}

/// Identification of the firmware.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello {
    /// The session of the request.
    pub session: u32,
    /// Bytes that may be in transit to the firmware before it replies.
    pub window_bytes: u32,
    /// Unit of [`Answer::ticks`]: a divider of the processor clock.
    pub clocks_per_tick: u32,
}

/// The navigator was started.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Started {
    /// RAM of the navigator.
    pub state_bytes: u32,
}

/// Why [`Config`] was rejected.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StartError(pub heapless::String<128>);

/// Samples need a [`Request::Start`] first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NotStarted;

/// After an inertial sample or a GNSS fix.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer<O> {
    /// Its outcome.
    pub outcome: O,
    /// The navigator now.
    pub report: Report,
    /// Execution time of the core.
    pub ticks: u32,
}

/// State of the navigator.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Phase of the alignment.
    pub phase: Phase,
    /// The current manoeuvre.
    pub manoeuvre: Manoeuvre,
    /// The solution, once there is one.
    pub solution: Option<Solution>,
    /// The estimates, if they have changed.
    pub estimates: Option<Estimates>,
    /// The damping signals of the last fix used, if they have changed.
    pub signals: Option<DampingSignals>,
    /// New outcome of fixes, including queued ones.
    pub settled: Option<FixReport>,
}

/// Health of the firmware since the session began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// Received requests.
    pub link: Counters,
    /// Bytes lost because the receive queue was full or the UART overran.
    pub bytes_lost: u32,
    /// Lines lost because the log buffer was full.
    pub log_lines_lost: u32,
    /// Deepest stack since the last status, bytes.
    pub stack_bytes: u32,
    /// Deepest stack of a call of the core, bytes; zero unless the firmware measures it.
    pub call_stack_bytes: u32,
}
