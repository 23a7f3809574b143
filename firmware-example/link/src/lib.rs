//! Protocol between a host and firmware that runs `ins-core`, over any byte stream.
//!
//! A frame is COBS(version, sequence number, message, CRC-32) and a zero byte, so a receiver resynchronizes at the
//! next zero. Numbers are transmitted bit for bit. Each side numbers its frames; the firmware answers every request
//! with one reply that contains the request's number, and sends its log in between.
#![no_std]

mod frame;
mod message;
mod receive;
mod responder;

pub use frame::{Counters, Decoder, EncodeError, MAX_FRAME, Message, VERSION, encode};
pub use message::{
    Answer, FromBoard, Hello, LOG_BYTES, NotStarted, Reply, Report, Request, StartError, Started,
    Status,
};
pub use receive::Receiver;
pub use responder::{Responder, Timer};
