//! The messages. The first field that changes here changes [`VERSION`](crate::VERSION) too.

use ins_core::damping::DampingSignals;
use ins_core::manoeuvre::Manoeuvre;
use ins_core::{
    Config, Estimates, GnssFix, GnssOutcome, ImuOutcome, ImuSample, Navigator, Phase, Solution,
};
use serde::{Deserialize, Serialize};

use crate::frame::{Counters, Message};

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
        /// After every so many inertial samples, estimates are sent if they have changed; 0: never.
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

/// Firmware to host: one for each request.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant)]
pub enum Reply {
    /// To [`Request::Hello`].
    Hello(Hello),
    /// To [`Request::Start`].
    Start(Result<Started, StartError>),
    /// To [`Request::Imu`].
    Imu(Result<SampleReply, NotStarted>),
    /// To [`Request::Gnss`].
    Gnss(Result<FixReply, NotStarted>),
    /// To [`Request::Status`].
    Status(Status),
}

impl Message for Reply {
    fn session(&self) -> Option<u32> {
        if let Self::Hello(hello) = self {
            Some(hello.session)
        } else {
            None
        }
    }
}

/// Who is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello {
    /// The session of the request.
    pub session: u32,
    /// Bytes that may be on their way to the firmware before it has answered.
    pub window_bytes: u32,
    /// Unit of [`SampleReply::ticks`]: a divider of the processor clock.
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

/// After an inertial sample.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SampleReply {
    /// What became of the sample.
    pub outcome: ImuOutcome,
    /// How far the alignment has come.
    pub phase: Phase,
    /// The manoeuvre going on.
    pub manoeuvre: Manoeuvre,
    /// The solution, once there is one.
    pub solution: Option<Solution>,
    /// The estimates, if they have changed.
    pub estimates: Option<Estimates>,
    /// Time that the core took.
    pub ticks: u32,
}

impl SampleReply {
    /// What `navigator` has to say after a sample.
    pub fn of(
        navigator: &Navigator,
        outcome: ImuOutcome,
        changes: &mut Changes,
        ticks: u32,
    ) -> Self {
        Self {
            outcome,
            phase: navigator.phase(),
            manoeuvre: navigator.manoeuvre(),
            solution: navigator.solution(),
            estimates: changes.after_sample(navigator),
            ticks,
        }
    }
}

/// Sees when the estimates have changed: that is once or so a second, and they are long.
#[derive(Clone, Debug)]
pub struct Changes {
    every: u32,
    samples: u32,
    last: Option<Estimates>,
}

impl Changes {
    /// Looks after every so many samples; 0: never.
    pub const fn new(every: u32) -> Self {
        Self {
            every,
            samples: 0,
            last: None,
        }
    }

    fn after_sample(&mut self, navigator: &Navigator) -> Option<Estimates> {
        self.samples = self.samples.wrapping_add(1);
        if self.samples.checked_rem(self.every) != Some(0) {
            return None;
        }
        let now = Some(navigator.estimates());
        if now == self.last {
            return None;
        }
        self.last = now;
        now
    }
}

/// After a GNSS fix.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FixReply {
    /// What became of the fix.
    pub outcome: GnssOutcome,
    /// The damping signals of the last fix used.
    pub signals: DampingSignals,
    /// Time that the core took.
    pub ticks: u32,
}

impl FixReply {
    /// What `navigator` has to say after a fix.
    pub fn of(navigator: &Navigator, outcome: GnssOutcome, ticks: u32) -> Self {
        Self {
            outcome,
            signals: navigator.damping_signals(),
            ticks,
        }
    }
}

/// Health of the firmware since the session began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// Requests as they came in.
    pub link: Counters,
    /// Bytes that found the receive queue full or overran the UART.
    pub bytes_lost: u32,
    /// Deepest stack since the last status, bytes.
    pub stack_bytes: u32,
    /// Stack in use when the core was called last, bytes.
    pub stack_at_call_bytes: u32,
}
