//! The messages. The first field that changes here changes [`VERSION`](crate::VERSION) too.

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
    /// Opens a session: sequence numbers begin anew, counters go to zero.
    Hello {
        /// Any number that the last session did not have.
        session: u32,
    },
    /// A new navigator.
    Start {
        /// Its configuration.
        config: Config,
        /// After every so many inertial samples, and fixes that follow them at once, estimates are
        /// sent if they have changed; 0: never.
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
    /// The next piece of the log as defmt encodes it, cut anywhere.
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

/// Who is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello {
    /// The session of the request.
    pub session: u32,
    /// Bytes that may be on their way to the firmware before it has answered.
    pub window_bytes: u32,
    /// Unit of [`Answer::ticks`]: a divider of the processor clock.
    pub clocks_per_tick: u32,
}

/// The navigator is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Started {
    /// RAM of the navigator.
    pub state_bytes: u32,
}

/// Why [`Config`] was refused.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StartError(pub heapless::String<128>);

/// Samples need a [`Request::Start`] first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NotStarted;

/// After an inertial sample or a GNSS fix.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Answer<O> {
    /// What became of it.
    pub outcome: O,
    /// The navigator now.
    pub report: Report,
    /// Time that the core took.
    pub ticks: u32,
}

/// What the navigator has to say.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// How far the alignment has come.
    pub phase: Phase,
    /// The manoeuvre going on.
    pub manoeuvre: Manoeuvre,
    /// The solution, once there is one.
    pub solution: Option<Solution>,
    /// The estimates, if they have changed.
    pub estimates: Option<Estimates>,
    /// The damping signals of the last fix used, if they have changed.
    pub signals: Option<DampingSignals>,
    /// What became of fixes, one that was queued among them, if more is known of them.
    pub settled: Option<FixReport>,
}

/// Health of the firmware since the session began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// Requests as they came in.
    pub link: Counters,
    /// Bytes that found the receive queue full or overran the UART.
    pub bytes_lost: u32,
    /// Lines that the log had no room for.
    pub log_lines_lost: u32,
    /// Deepest stack since the last status, bytes.
    pub stack_bytes: u32,
    /// Deepest stack of a call of the core, bytes; zero unless the firmware measures it.
    pub call_stack_bytes: u32,
}
