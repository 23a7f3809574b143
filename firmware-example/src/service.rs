//! Bytes in, bytes out: what the firmware does, whatever carries them.

use core::cell::Cell;

use ins_link::{Decoder, Hello, MAX_FRAME, Reply, Request, Status};

use crate::board::{self, Clock};
use crate::navigation::{Navigation, Timer};

/// Answers requests.
pub struct Service {
    decoder: Decoder,
    navigation: Navigation,
    gauge: Gauge,
    bytes_lost: u32,
}

impl Service {
    pub const fn new(clock: Clock) -> Self {
        Self {
            decoder: Decoder::new(),
            navigation: Navigation::new(),
            gauge: Gauge {
                clock,
                stack_bytes: Cell::new(0),
            },
            bytes_lost: 0,
        }
    }

    /// Takes the next byte; with the last one of a request gives the frame of the reply.
    pub fn on_byte(&mut self, byte: u8) -> Option<heapless::Vec<u8, MAX_FRAME>> {
        let (sequence, request) = self.decoder.push(byte)?;
        let reply = self.answer(&request);
        let frame = ins_link::encode(sequence, &reply);
        if frame.is_err() {
            defmt::error!("a reply is longer than a frame");
        }
        frame.ok()
    }

    /// Bytes have come and found no room.
    pub fn on_lost(&mut self, bytes: u32) {
        self.bytes_lost = self.bytes_lost.saturating_add(bytes);
    }

    fn answer(&mut self, request: &Request) -> Reply {
        match *request {
            Request::Hello { session } => {
                self.bytes_lost = 0;
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
                stack_bytes: board::take_deepest_stack_bytes(),
                stack_at_call_bytes: self.gauge.stack_bytes.get(),
            }),
        }
    }
}

/// Looks at calls from outside: their time, and how much stack is in use when they begin.
struct Gauge {
    clock: Clock,
    stack_bytes: Cell<u32>,
}

impl Timer for Gauge {
    fn time<T>(&self, work: impl FnOnce() -> T) -> (T, u32) {
        self.stack_bytes.set(board::stack_bytes());
        self.clock.time(work)
    }
}
