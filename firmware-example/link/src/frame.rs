//! Framing: messages over a byte stream with losses and errors.

use crc::{CRC_32_ISCSI, Crc};
use heapless::Vec;
use serde::{Deserialize, Serialize, de::DeserializeOwned};

/// Version of messages and framing; frames of another are counted and dropped.
pub const VERSION: u8 = 5;
/// Longest frame on the wire, with its closing zero, bytes.
pub const MAX_FRAME: usize = 768;

/// With a table of 1 KiB: bit by bit would take longer than the navigator.
static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);
const CRC_BYTES: usize = 4;
/// COBS adds one byte, and another for every 254.
const MAX_CONTENT: usize = MAX_FRAME - MAX_FRAME.div_ceil(254) - 1;

/// A message that can be sent.
pub trait Message: Serialize + DeserializeOwned {
    /// The session that the message opens, if it opens one.
    fn session(&self) -> Option<u32>;
}

#[derive(Serialize, Deserialize)]
struct Content<M> {
    version: u8,
    sequence: u32,
    message: M,
}

/// The message is too long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncodeError;

/// Writes the frame of a message, closing zero included.
///
/// # Errors
/// If it does not fit into [`MAX_FRAME`]; no message of this crate is so long.
pub fn encode<M: Message>(sequence: u32, message: &M) -> Result<Vec<u8, MAX_FRAME>, EncodeError> {
    let mut content = [0; MAX_CONTENT];
    let content = Content {
        version: VERSION,
        sequence,
        message,
    }
    .write(&mut content)?;
    let mut frame = Vec::new();
    frame.resize_default(MAX_FRAME).map_err(|_| EncodeError)?;
    let length = cobs::try_encode(content, &mut frame).map_err(|_| EncodeError)?;
    frame.truncate(length);
    frame.push(0).map_err(|_| EncodeError)?;
    Ok(frame)
}

impl<M: Message> Content<&M> {
    fn write<'b>(&self, buffer: &'b mut [u8]) -> Result<&'b [u8], EncodeError> {
        let length = postcard::to_slice(self, buffer)
            .map_err(|_| EncodeError)?
            .len();
        let (written, rest) = buffer.split_at_mut_checked(length).ok_or(EncodeError)?;
        let crc_bytes = rest.get_mut(..CRC_BYTES).ok_or(EncodeError)?;
        crc_bytes.copy_from_slice(&CRC.checksum(written).to_le_bytes());
        buffer.get(..length + CRC_BYTES).ok_or(EncodeError)
    }
}

/// Received frames since the session began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counters {
    /// Messages accepted.
    pub accepted: u32,
    /// Frames whose coding or checksum is wrong.
    pub corrupt: u32,
    /// Frames of another [`VERSION`].
    pub other_version: u32,
    /// Complete frames without a valid message.
    pub malformed: u32,
    /// Frames repeated or later than their successors.
    pub out_of_order: u32,
    /// Sequence numbers skipped: frames lost or dropped as corrupt.
    pub skipped: u32,
}

/// Decodes messages from bytes. Invalid frames are dropped and counted.
#[derive(Clone, Debug, Default)]
pub struct Decoder {
    frame: Vec<u8, MAX_FRAME>,
    too_long: bool,
    session: Option<u32>,
    last: Option<u32>,
    /// Counters of received frames.
    pub counters: Counters,
}

impl Decoder {
    /// A decoder between two frames.
    pub const fn new() -> Self {
        Self {
            frame: Vec::new(),
            too_long: false,
            session: None,
            last: None,
            counters: Counters {
                accepted: 0,
                corrupt: 0,
                other_version: 0,
                malformed: 0,
                out_of_order: 0,
                skipped: 0,
            },
        }
    }

    /// Takes the next byte; after the last one of a valid frame returns its sequence number and message.
    pub fn push<M: Message>(&mut self, byte: u8) -> Option<(u32, M)> {
        if byte != 0 {
            self.too_long |= self.frame.push(byte).is_err();
            return None;
        }
        let too_long = core::mem::take(&mut self.too_long);
        let message = if too_long {
            count(&mut self.counters.corrupt);
            None
        } else if self.frame.is_empty() {
            // Zeros between frames are allowed, and may be used to end an incomplete frame.
            None
        } else {
            self.decode()
        };
        self.frame.clear();
        message
    }

    fn decode<M: Message>(&mut self) -> Option<(u32, M)> {
        let Some(content) = checked(&mut self.frame) else {
            count(&mut self.counters.corrupt);
            return None;
        };
        if content.first() != Some(&VERSION) {
            count(&mut self.counters.other_version);
            return None;
        }
        let Ok((
            Content {
                sequence, message, ..
            },
            [],
        )) = postcard::take_from_bytes::<Content<M>>(content)
        else {
            count(&mut self.counters.malformed);
            return None;
        };
        if !self.in_order(sequence, message.session()) {
            count(&mut self.counters.out_of_order);
            return None;
        }
        count(&mut self.counters.accepted);
        Some((sequence, message))
    }

    /// Whether the frame is later than the last one, or opens another session.
    fn in_order(&mut self, sequence: u32, session: Option<u32>) -> bool {
        if session.is_some() && session != self.session {
            self.session = session;
            self.counters = Counters::default();
        } else if let Some(last) = self.last {
            let ahead = sequence.wrapping_sub(last);
            // Half of the number range is ahead, half behind.
            if ahead == 0 || ahead > u32::MAX / 2 {
                return false;
            }
            self.counters.skipped = self.counters.skipped.saturating_add(ahead - 1);
        }
        self.last = Some(sequence);
        true
    }
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

/// The content of a frame without its checksum, if that is right.
fn checked(frame: &mut [u8]) -> Option<&[u8]> {
    let length = cobs::decode_in_place(frame).ok()?;
    let (content, checksum) = frame.get(..length)?.split_last_chunk::<CRC_BYTES>()?;
    (CRC.checksum(content) == u32::from_le_bytes(*checksum)).then_some(content)
}
