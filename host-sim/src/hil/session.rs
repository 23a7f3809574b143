//! A conversation with the firmware over any byte stream.

use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use ins_core::{Config, Time};
use ins_link::{Counters, Decoder, FromBoard, Hello, Reply, Request, Started, Status};
use miette::Diagnostic;
use thiserror::Error;

/// How long a read of a port waits for bytes before it times out.
pub const POLL: Duration = Duration::from_millis(1);
/// How long a question waits for its answer, and how often it is asked.
const PATIENCE: Duration = Duration::from_secs(2);
const TRIES: usize = 6;
/// Longest that a stream may go without an answer, on a busy computer.
const SILENCE: Duration = Duration::from_secs(10);

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
    /// Nothing comes, or nothing that can be understood.
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
    /// What became of a request.
    Answer {
        request: Request,
        /// None if the request or its reply was lost.
        reply: Option<Reply>,
        /// Requests that are still on their way.
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
    heard: Instant,
    /// What the board said of itself.
    pub hello: Hello,
    /// Deepest stack it has told of, in any status.
    stack_bytes: u32,
}

impl<P: Read + Write> Session<P> {
    /// Opens a session. Reads of `port` must time out, after [`POLL`] or so; `session` may be any
    /// number that the last session did not have.
    pub fn open(port: P, session: u32) -> Result<Self, HilError> {
        let mut this = Self {
            port,
            decoder: Decoder::new(),
            events: VecDeque::new(),
            waiting: VecDeque::new(),
            sequence: 0,
            heard: Instant::now(),
            hello: Hello {
                session,
                window_bytes: 0,
                clocks_per_tick: 1,
            },
            stack_bytes: 0,
        };
        // Ends whatever half a frame the board may have.
        this.port.write_all(&[0])?;
        // Replies to an earlier session may still be on their way.
        this.hello = this.ask(&Request::Hello { session }, |reply| match reply {
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
        let started = self.ask(&start, |reply| match reply {
            Reply::Start(started) => Some(started),
            _ => None,
        })?;
        started.map_err(|refusal| HilError::Refused(refusal.0.as_str().into()))
    }

    /// How the board is. It tells of the stack since it was last asked; this, of that of all statuses.
    pub fn status(&mut self) -> Result<Status, HilError> {
        let status = self.ask(&Request::Status, |reply| match reply {
            Reply::Status(status) => Some(status),
            _ => None,
        })?;
        self.stack_bytes = self.stack_bytes.max(status.stack_bytes);
        Ok(Status {
            stack_bytes: self.stack_bytes,
            ..status
        })
    }

    /// Frames of the board as they came in.
    pub fn counters(&self) -> Counters {
        self.decoder.counters
    }

    /// Streams requests and hands over what comes back, until every request has its answer or is
    /// known to be lost; then asks how the board is.
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
        // What was logged about the last request comes after its answer, and before this one.
        let status = self.status()?;
        self.events.drain(..).for_each(&mut on_event);
        Ok(status)
    }

    /// Whether the board's queue may have no room for another request.
    fn is_full(&self) -> bool {
        let bytes: usize = self.waiting.iter().map(|waiting| waiting.bytes).sum();
        bytes > self.hello.window_bytes as usize / 2
    }

    fn wait_for(&mut self, due: Instant, on_event: &mut impl FnMut(Event)) -> Result<(), HilError> {
        while let Some(event) = self.receive(due)? {
            on_event(event);
        }
        if !self.waiting.is_empty() && self.heard.elapsed() > SILENCE {
            self.give_up_waiting()?;
        }
        Ok(())
    }

    fn wait_while(
        &mut self,
        condition: impl Fn(&Self) -> bool,
        on_event: &mut impl FnMut(Event),
    ) -> Result<(), HilError> {
        while condition(self) || !self.events.is_empty() {
            match self.receive(Instant::now() + SILENCE)? {
                Some(event) => on_event(event),
                None => self.give_up_waiting()?,
            }
        }
        Ok(())
    }

    /// Nothing comes: the requests are lost, if the board is still there.
    fn give_up_waiting(&mut self) -> Result<(), HilError> {
        let lost = self.waiting.len();
        self.lose(lost);
        self.status().map(|_| ())
    }

    /// The first so many requests will have no reply.
    fn lose(&mut self, count: usize) {
        for _ in 0..count {
            self.answer(None);
        }
    }

    /// What became of the first request that waits.
    fn answer(&mut self, reply: Option<Reply>) {
        if let Some(Waiting { request, .. }) = self.waiting.pop_front() {
            self.events.push_back(Event::Answer {
                request,
                reply,
                waiting: self.waiting.len(),
            });
        }
    }

    /// One question and its answer, as `pick` knows it; nothing else may be waiting.
    fn ask<T>(
        &mut self,
        question: &Request,
        pick: impl Fn(Reply) -> Option<T>,
    ) -> Result<T, HilError> {
        let mut others = std::mem::take(&mut self.events);
        for _ in 0..TRIES {
            self.send(question)?;
            while let Some(event) = self.receive(Instant::now() + PATIENCE)? {
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
            self.heard = Instant::now();
        }
        self.waiting.push_back(Waiting {
            sequence,
            bytes: frame.len(),
            request: request.clone(),
        });
        Ok(())
    }

    /// The next event; none if there is none until then.
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
                    // All that has come is taken in first, unless it is no board that goes on and on.
                    if self.heard.elapsed() < SILENCE {
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
        self.heard = Instant::now();
        match message {
            FromBoard::Log(piece) => self.events.push_back(Event::Log(piece.to_vec())),
            FromBoard::Reply { to, reply } => {
                let index = self.waiting.iter().position(|w| w.sequence == to);
                // Replies come in order: what one overtakes is lost. What was given up is ignored.
                if let Some(index) = index {
                    self.lose(index);
                    self.answer(Some(reply));
                }
            }
        }
    }
}

/// When to send a request by its stamp; `clock` holds the first stamp and its moment.
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

    /// Says hello, and the deepest stack since it was last asked.
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
    fn the_deepest_stack_is_not_forgotten() {
        let board = Board {
            decoder: Decoder::new(),
            sent: VecDeque::new(),
            stacks: [700, 900, 100].into(),
        };
        let mut session = Session::open(board, 1).unwrap();
        let told = [(); 3].map(|()| session.status().unwrap().stack_bytes);
        assert_eq!(told, [700, 900, 900]);
    }
}
