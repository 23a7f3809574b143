//! Requests and replies as bytes, independent of the transport.

use core::cell::Cell;

use ins_core::{Config, GnssFix, GnssOutcome, ImuOutcome, ImuSample};
use ins_link::{
    Answer, Decoder, FromBoard, Hello, NotStarted, Reply, Request, StartError, Started, Status,
    Timer,
};

use crate::board::{self, Clock};

/// A navigator behind the link.
pub trait Navigates {
    fn start(&mut self, config: Config, estimates_every: u32) -> Result<Started, StartError>;
    fn on_imu(
        &mut self,
        sample: &ImuSample,
        timer: &impl Timer,
    ) -> Result<Answer<ImuOutcome>, NotStarted>;
    fn on_gnss(
        &mut self,
        fix: &GnssFix,
        timer: &impl Timer,
    ) -> Result<Answer<GnssOutcome>, NotStarted>;
}

/// Answers requests.
pub struct Service<N> {
    decoder: Decoder,
    navigation: N,
    gauge: Gauge,
    bytes_lost: u32,
    /// Requests and bytes lost as last logged.
    losses_logged: (u32, u32),
    /// Number of the next frame to the host.
    sequence: u32,
}

impl<N: Navigates> Service<N> {
    pub const fn new(navigation: N, clock: Clock) -> Self {
        Self {
            decoder: Decoder::new(),
            navigation,
            gauge: Gauge {
                clock,
                stack_bytes: Cell::new(0),
            },
            bytes_lost: 0,
            losses_logged: (0, 0),
            sequence: 0,
        }
    }

    /// Constructs one in static memory. Not inlined, so that its stack is released: built for size, the compiler
    /// constructs it on the stack first.
    #[inline(never)]
    pub fn place(
        slot: &'static mut Option<Self>,
        navigation: impl FnOnce() -> N,
        clock: Clock,
    ) -> &'static mut Self {
        slot.insert(Self::new(navigation(), clock))
    }

    /// Takes the next byte; after the last one of a request sends the reply, and the log since the last one.
    pub fn on_byte(&mut self, byte: u8, mut send: impl FnMut(&[u8])) {
        let Some((to, request)) = self.decoder.push(byte) else {
            return;
        };
        let reply = self.answer(&request);
        self.log_losses();
        self.send(&FromBoard::Reply { to, reply }, &mut send);
        loop {
            let piece = board::take_log();
            if piece.is_empty() {
                return;
            }
            self.send(&FromBoard::Log(piece), &mut send);
        }
    }

    /// Bytes were lost because the queue was full.
    pub fn on_lost(&mut self, bytes: u32) {
        self.bytes_lost = self.bytes_lost.saturating_add(bytes);
    }

    fn send(&mut self, message: &FromBoard, send: &mut impl FnMut(&[u8])) {
        if let Ok(frame) = ins_link::encode(self.sequence, message) {
            send(&frame);
        } else {
            defmt::error!("a message is longer than a frame");
        }
        self.sequence = self.sequence.wrapping_add(1);
    }

    fn answer(&mut self, request: &Request) -> Reply {
        match *request {
            Request::Hello { session } => {
                self.bytes_lost = 0;
                self.losses_logged = (0, 0);
                Reply::Hello(Hello {
                    session,
                    window_bytes: board::QUEUE_BYTES as u32,
                    clocks_per_tick: board::CLOCKS_PER_TICK,
                })
            }
            Request::Start {
                config,
                estimates_every,
            } => Reply::Start(self.navigation.start(config, estimates_every)),
            Request::Imu(ref sample) => Reply::Imu(self.navigation.on_imu(sample, &self.gauge)),
            Request::Gnss(ref fix) => Reply::Gnss(self.navigation.on_gnss(fix, &self.gauge)),
            Request::Status => Reply::Status(Status {
                link: self.decoder.counters,
                bytes_lost: self.bytes_lost,
                log_lines_lost: board::log_lines_lost(),
                stack_bytes: board::take_deepest_stack_bytes(),
                call_stack_bytes: self.gauge.stack_bytes.get(),
            }),
        }
    }

    fn log_losses(&mut self) {
        let losses = (self.decoder.counters.skipped, self.bytes_lost);
        if losses != self.losses_logged {
            defmt::warn!(
                "lost on the way here: {} requests, {} bytes",
                losses.0,
                losses.1
            );
            self.losses_logged = losses;
        }
    }
}

/// Measures calls: their time, and with the feature `call-stack` the deepest stack.
struct Gauge {
    clock: Clock,
    stack_bytes: Cell<u32>,
}

impl Timer for Gauge {
    fn time<T>(&self, work: impl FnOnce() -> T) -> (T, u32) {
        if !cfg!(feature = "call-stack") {
            return self.clock.time(work);
        }
        let (timed, bytes) = board::stack_of_call(|| self.clock.time(work));
        self.stack_bytes.set(bytes.max(self.stack_bytes.get()));
        timed
    }
}
