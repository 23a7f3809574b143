//! A conversation with the firmware over any byte stream.

use std::collections::VecDeque;
use std::io::{self, Read, Write};

use ins_link::{Counters, Decoder, Hello, Reply, Request, Started, Status};
use thiserror::Error;

/// What can go wrong with a board.
#[derive(Debug, Error)]
pub enum HilError {
    /// The stream broke, or nothing came within its timeout.
    #[error("no answer from the board (is it powered, and does it run this version?): {0}")]
    Port(#[from] io::Error),
    /// An answer that belongs to no request, or to another one.
    #[error("the board answered something else than was asked: {0}")]
    Confused(String),
    /// The firmware refused the configuration.
    #[error("the board refuses the configuration: {0}")]
    Refused(String),
}

/// A request on its way, or its answer.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    sequence: u32,
    bytes: usize,
}

/// Sends requests, as many at once as the board can hold, and receives the answers in order.
#[derive(Debug)]
pub struct Session<P> {
    port: P,
    decoder: Decoder,
    received: VecDeque<u8>,
    waiting: VecDeque<Waiting>,
    sequence: u32,
    /// What the board said of itself.
    pub hello: Hello,
}

impl<P: Read + Write> Session<P> {
    /// Opens a session. Reads of `port` must time out.
    pub fn open(port: P, session: u32) -> Result<Self, HilError> {
        let mut this = Self {
            port,
            decoder: Decoder::new(),
            received: VecDeque::new(),
            waiting: VecDeque::new(),
            sequence: 0,
            hello: Hello {
                session,
                window_bytes: 0,
                clocks_per_tick: 1,
            },
        };
        // Ends whatever half a frame the board may have.
        this.port.write_all(&[0])?;
        match this.ask(&Request::Hello { session })? {
            Reply::Hello(hello) if hello.session == session => this.hello = hello,
            other => return Err(HilError::Confused(format!("{other:?}"))),
        }
        Ok(this)
    }

    /// Sets up a new navigator.
    pub fn start(
        &mut self,
        config: ins_core::Config,
        estimates_every: u32,
    ) -> Result<Started, HilError> {
        match self.ask(&Request::Start {
            config,
            estimates_every,
        })? {
            Reply::Start(Ok(started)) => Ok(started),
            Reply::Start(Err(refusal)) => Err(HilError::Refused(refusal.0.as_str().into())),
            other => Err(HilError::Confused(format!("{other:?}"))),
        }
    }

    /// Health of the board.
    pub fn status(&mut self) -> Result<Status, HilError> {
        match self.ask(&Request::Status)? {
            Reply::Status(status) => Ok(status),
            other => Err(HilError::Confused(format!("{other:?}"))),
        }
    }

    /// One request and its answer; no other may be waiting.
    pub fn ask(&mut self, request: &Request) -> Result<Reply, HilError> {
        self.transmit(request)?;
        let reply = self.receive()?;
        if self.waiting.is_empty() {
            return Ok(reply);
        }
        Err(HilError::Confused(format!(
            "{reply:?} to an earlier request"
        )))
    }

    /// Sends a request; hands over the answers that have to come first to make room for it.
    pub fn send(
        &mut self,
        request: &Request,
        mut on_reply: impl FnMut(Reply) -> Result<(), HilError>,
    ) -> Result<(), HilError> {
        self.transmit(request)?;
        while self.bytes_waiting() > self.hello.window_bytes as usize / 2 {
            on_reply(self.receive()?)?;
        }
        Ok(())
    }

    /// Hands over the answers still missing.
    pub fn finish(
        &mut self,
        mut on_reply: impl FnMut(Reply) -> Result<(), HilError>,
    ) -> Result<(), HilError> {
        while !self.waiting.is_empty() {
            on_reply(self.receive()?)?;
        }
        Ok(())
    }

    /// The board's answers as they came in.
    pub fn counters(&self) -> Counters {
        self.decoder.counters
    }

    fn bytes_waiting(&self) -> usize {
        self.waiting.iter().map(|waiting| waiting.bytes).sum()
    }

    fn transmit(&mut self, request: &Request) -> Result<(), HilError> {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        let frame = ins_link::encode(sequence, request)
            .map_err(|_| HilError::Confused("a request is longer than a frame".into()))?;
        self.port.write_all(&frame)?;
        self.waiting.push_back(Waiting {
            sequence,
            bytes: frame.len(),
        });
        Ok(())
    }

    fn receive(&mut self) -> Result<Reply, HilError> {
        loop {
            while let Some(byte) = self.received.pop_front() {
                let Some((sequence, reply)) = self.decoder.push(byte) else {
                    continue;
                };
                let Some(waiting) = self.waiting.pop_front() else {
                    return Err(HilError::Confused(format!("{reply:?} to nothing")));
                };
                if waiting.sequence != sequence {
                    let text = format!("request {} got no answer", waiting.sequence);
                    return Err(HilError::Confused(text));
                }
                return Ok(reply);
            }
            let mut buffer = [0; 4096];
            let length = self.port.read(&mut buffer)?;
            if length == 0 {
                return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into());
            }
            self.received.extend(&buffer[..length]);
        }
    }
}
