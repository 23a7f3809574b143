//! A session with the firmware over any byte stream.

use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use ins_core::{Config, Time};
use ins_link::{Counters, Decoder, FromBoard, Hello, Reply, Request, Started, Status};
use miette::Diagnostic;
use thiserror::Error;

/// Timeout of a read of a port.
pub const POLL: Duration = Duration::from_millis(1);
/// Timeout of an answer, and the number of attempts.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(2);
const ATTEMPTS: usize = 6;
/// Timeout of a stream without answers; long, for a busy computer.
const STREAM_TIMEOUT: Duration = Duration::from_secs(10);

#[derive(Debug, Error, Diagnostic)]
pub enum HilError {
    #[error("the board cannot be reached: {0}")]
    #[diagnostic(help("the port's name, its permissions, the cable; for --qemu, the image"))]
    Port(#[from] io::Error),
    #[error("{}: there is no such image", .image.display())]
    #[diagnostic(help(
        "in the folder firmware-example:\n\
         cargo build --release --config {config} --target-dir target/{name}\n\
         or say where it is with --image"
    ))]
    NoImage {
        image: PathBuf,
        name: &'static str,
        /// Cargo's, to build it with.
        config: &'static str,
    },
    /// Nothing is received, or nothing that can be decoded.
    #[error(
        "the board does not answer (frames from it: {} corrupt, {} of another version, {} without a message, \
         {} out of order)",
        .0.corrupt, .0.other_version, .0.malformed, .0.out_of_order
    )]
    #[diagnostic(help(
        "is it powered, does it run this version of the firmware, is the baud rate right? \
         With --qemu the image must be the program `console`, built for that board"
    ))]
    Silent(Counters),
    #[error("the board refuses the configuration: {0}")]
    Refused(String),
    #[error("a request is longer than a frame")]
    TooLong,
}

/// When requests of a stream are sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Rate {
    /// By their stamps, whether the board keeps up or not.
    Realtime,
    /// As fast as the board answers.
    Max,
}

#[derive(Clone, Debug)]
#[allow(
    clippy::large_enum_variant,
    reason = "few at a time, and nearly all of them answers"
)]
pub enum Event {
    /// The result of a request.
    Answer {
        request: Request,
        /// None if the request or its reply was lost.
        reply: Option<Reply>,
        /// Requests that are still waiting for a reply.
        waiting: usize,
    },
    /// A piece of the log, encoded by defmt.
    Log(Vec<u8>),
}

#[derive(Debug)]
struct Waiting {
    sequence: u32,
    bytes: usize,
    request: Request,
}

/// Sends requests, as many at once as the board can hold, and receives the answers in order.
#[derive(Debug)]
pub struct Session<P> {
    port: P,
    decoder: Decoder,
    events: VecDeque<Event>,
    waiting: VecDeque<Waiting>,
    sequence: u32,
    last_received: Instant,
    /// Properties of the board.
    pub hello: Hello,
    /// Largest stack use in any status.
    stack_bytes: u32,
}

impl<P: Read + Write> Session<P> {
    /// Opens a session. Reads of `port` must time out after about [`POLL`]; `session` must differ from that of
    /// the last session.
    pub fn open(port: P, session: u32) -> Result<Self, HilError> {
        let mut this = Self {
            port,
            decoder: Decoder::new(),
            events: VecDeque::new(),
            waiting: VecDeque::new(),
            sequence: 0,
            last_received: Instant::now(),
            hello: Hello {
                session,
                window_bytes: 0,
                clocks_per_tick: 1,
            },
            stack_bytes: 0,
        };
        // Ends an incomplete frame at the board.
        this.port.write_all(&[0])?;
        // Replies to an earlier session may still arrive.
        this.hello = this.query(&Request::Hello { session }, |reply| match reply {
            Reply::Hello(hello) if hello.session == session => Some(hello),
            _ => None,
        })?;
        Ok(this)
    }

    pub fn start(&mut self, config: Config, estimates_every: u32) -> Result<Started, HilError> {
        let start = Request::Start {
            config,
            estimates_every,
        };
        let started = self.query(&start, |reply| match reply {
            Reply::Start(started) => Some(started),
            _ => None,
        })?;
        started.map_err(|refusal| HilError::Refused(refusal.0.as_str().into()))
    }

    /// Status of the board, with the largest stack use of all statuses: the board reports that since the last.
    pub fn status(&mut self) -> Result<Status, HilError> {
        let status = self.query(&Request::Status, |reply| match reply {
            Reply::Status(status) => Some(status),
            _ => None,
        })?;
        self.stack_bytes = self.stack_bytes.max(status.stack_bytes);
        Ok(Status {
            stack_bytes: self.stack_bytes,
            ..status
        })
    }

    /// Counters of the frames received from the board.
    pub fn counters(&self) -> Counters {
        self.decoder.counters
    }

    /// Streams requests and passes on the events, until every request has its answer or is known to be lost;
    /// then returns the status of the board.
    pub fn stream(
        &mut self,
        requests: impl IntoIterator<Item = Request>,
        rate: Rate,
        mut on_event: impl FnMut(Event),
    ) -> Result<Status, HilError> {
        let mut clock = None;
        for request in requests {
            match rate {
                Rate::Realtime => self.wait_for(due(&mut clock, &request), &mut on_event)?,
                Rate::Max => self.wait_while(Self::is_full, &mut on_event)?,
            }
            self.send(&request)?;
        }
        self.wait_while(|this| !this.waiting.is_empty(), &mut on_event)?;
        // Log pieces about the last request arrive after its answer, and before the status.
        let status = self.status()?;
        self.events.drain(..).for_each(&mut on_event);
        Ok(status)
    }

    /// Whether the queue of the board may be full.
    fn is_full(&self) -> bool {
        let bytes: usize = self.waiting.iter().map(|waiting| waiting.bytes).sum();
        bytes > self.hello.window_bytes as usize / 2
    }

    fn wait_for(&mut self, due: Instant, on_event: &mut impl FnMut(Event)) -> Result<(), HilError> {
        while let Some(event) = self.receive(due)? {
            on_event(event);
        }
        if !self.waiting.is_empty() && self.last_received.elapsed() > STREAM_TIMEOUT {
            self.drop_waiting()?;
        }
        Ok(())
    }

    fn wait_while(
        &mut self,
        condition: impl Fn(&Self) -> bool,
        on_event: &mut impl FnMut(Event),
    ) -> Result<(), HilError> {
        while condition(self) || !self.events.is_empty() {
            match self.receive(Instant::now() + STREAM_TIMEOUT)? {
                Some(event) => on_event(event),
                None => self.drop_waiting()?,
            }
        }
        Ok(())
    }

    /// After a timeout: the waiting requests are lost, if the board still answers.
    fn drop_waiting(&mut self) -> Result<(), HilError> {
        let lost = self.waiting.len();
        self.mark_lost(lost);
        self.status().map(|_| ())
    }

    /// Marks the first `count` requests as lost.
    fn mark_lost(&mut self, count: usize) {
        for _ in 0..count {
            self.answer(None);
        }
    }

    /// Completes the first waiting request.
    fn answer(&mut self, reply: Option<Reply>) {
        if let Some(Waiting { request, .. }) = self.waiting.pop_front() {
            self.events.push_back(Event::Answer {
                request,
                reply,
                waiting: self.waiting.len(),
            });
        }
    }

    /// One request and its answer, as selected by `pick`; no other may be waiting.
    fn query<T>(
        &mut self,
        question: &Request,
        pick: impl Fn(Reply) -> Option<T>,
    ) -> Result<T, HilError> {
        let mut others = std::mem::take(&mut self.events);
        for _ in 0..ATTEMPTS {
            self.send(question)?;
            while let Some(event) = self.receive(Instant::now() + ANSWER_TIMEOUT)? {
                match event {
                    Event::Answer { reply, .. } => {
                        if let Some(answer) = reply.and_then(&pick) {
                            self.waiting.clear();
                            others.append(&mut self.events);
                            self.events = others;
                            return Ok(answer);
                        }
                    }
                    log @ Event::Log(_) => others.push_back(log),
                }
            }
        }
        Err(HilError::Silent(self.decoder.counters))
    }

    fn send(&mut self, request: &Request) -> Result<(), HilError> {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        let frame = ins_link::encode(sequence, request).map_err(|_| HilError::TooLong)?;
        self.port.write_all(&frame)?;
        if self.waiting.is_empty() {
            self.last_received = Instant::now();
        }
        self.waiting.push_back(Waiting {
            sequence,
            bytes: frame.len(),
            request: request.clone(),
        });
        Ok(())
    }

    /// The next event; none if there is none until `until`.
    fn receive(&mut self, until: Instant) -> Result<Option<Event>, HilError> {
        let mut buffer = [0; 4096];
        loop {
            if let Some(event) = self.events.pop_front() {
                return Ok(Some(event));
            }
            match self.port.read(&mut buffer) {
                Ok(0) => return Err(io::Error::other("it has closed the connection").into()),
                Ok(length) => {
                    buffer[..length].iter().for_each(|byte| self.take(*byte));
                    // Everything received is processed first, unless it is an endless stream of no board.
                    if self.last_received.elapsed() < STREAM_TIMEOUT {
                        continue;
                    }
                }
                Err(error) if is_timeout(&error) => {}
                Err(error) => return Err(error.into()),
            }
            if self.events.is_empty() && Instant::now() >= until {
                return Ok(None);
            }
        }
    }

    fn take(&mut self, byte: u8) {
        let Some((_, message)) = self.decoder.push(byte) else {
            return;
        };
        self.last_received = Instant::now();
        match message {
            FromBoard::Log(piece) => self.events.push_back(Event::Log(piece.to_vec())),
            FromBoard::Reply { to, reply } => {
                let index = self.waiting.iter().position(|w| w.sequence == to);
                // Replies come in order: requests before are lost. Replies to dropped requests are ignored.
                if let Some(index) = index {
                    self.mark_lost(index);
                    self.answer(Some(reply));
                }
            }
        }
    }
}

/// Time to send a request by its stamp; `clock` has the first stamp and its time.
fn due(clock: &mut Option<(Time, Instant)>, request: &Request) -> Instant {
    let now = Instant::now();
    let stamp = match request {
        Request::Imu(sample) => sample.time,
        Request::Gnss(fix) => fix.time,
        Request::Hello { .. } | Request::Start { .. } | Request::Status => return now,
    };
    let (first, start) = *clock.get_or_insert((stamp, now));
    start + Duration::from_secs_f64(stamp.seconds_since(first).max(0.0))
}

fn is_timeout(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Answers hello, and status with the stack use since the last.
    struct Board {
        decoder: Decoder,
        sent: VecDeque<u8>,
        stacks: VecDeque<u32>,
    }

    impl Board {
        fn reply(&mut self, request: &Request) -> Reply {
            if let Request::Hello { session } = *request {
                return Reply::Hello(Hello {
                    session,
                    window_bytes: 2048,
                    clocks_per_tick: 1,
                });
            }
            Reply::Status(Status {
                stack_bytes: self.stacks.pop_front().unwrap(),
                ..Status::default()
            })
        }
    }

    impl Read for Board {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            match self.sent.read(buffer)? {
                0 => Err(io::ErrorKind::TimedOut.into()),
                length => Ok(length),
            }
        }
    }

    impl Write for Board {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            for byte in bytes {
                if let Some((to, request)) = self.decoder.push(*byte) {
                    let reply = self.reply(&request);
                    let frame = ins_link::encode(to, &FromBoard::Reply { to, reply }).unwrap();
                    self.sent.extend(frame);
                }
            }
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn status_has_the_largest_stack_use() {
        let board = Board {
            decoder: Decoder::new(),
            sent: VecDeque::new(),
            stacks: [700, 900, 100].into(),
        };
        let mut session = Session::open(board, 1).unwrap();
        let stacks = [(); 3].map(|()| session.status().unwrap().stack_bytes);
        assert_eq!(stacks, [700, 900, 900]);
    }
}
