//! What a host and firmware that runs `ins-core` say to each other, over any byte stream.
//!
//! A frame is COBS(version, sequence number, message, CRC-32) and a zero byte, so a receiver is in
//! step again after the next zero. Numbers cross bit for bit. The firmware answers every request
//! with one reply of the same sequence number.
#![no_std]

mod frame;
mod message;

pub use frame::{Counters, Decoder, EncodeError, MAX_FRAME, Message, VERSION, encode};
pub use message::{
    FixReply, Hello, NotStarted, Reply, Request, SampleReply, StartError, Started, Status,
};
