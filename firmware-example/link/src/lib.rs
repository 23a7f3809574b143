//! What a host and firmware that runs `ins-core` say to each other, over any byte stream.
//!
//! A frame is COBS(version, sequence number, message, CRC-32) and a zero byte, so a receiver is in
//! step again after the next zero. Numbers cross bit for bit. Each side numbers its frames; the
//! firmware answers every request with one reply that names the request's number, and sends its log
//! in between.
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
