//! MCAP, as ROS 2 records, and ROS 1 bags that were converted.

use std::collections::HashMap;
use std::io::{self, Read};
use std::path::Path;

use lz4_flex::frame::FrameDecoder;
use ruzstd::decoding::StreamingDecoder;

use super::recording::{Recording, bytes, unreadable};
use super::ros_messages::{Layout, Stream, recording, stream};
use crate::log::LogError;

/// The head of the file.
pub(super) const MAGIC: &[u8] = b"\x89MCAP0\r\n";

const SCHEMA: u8 = 3;
const CHANNEL: u8 = 4;
const MESSAGE: u8 = 5;
const CHUNK: u8 = 6;

pub(super) fn read(path: &Path) -> Result<Recording, LogError> {
    let bytes = bytes(path)?;
    let mut log = Mcap::default();
    log.records(bytes.get(MAGIC.len()..).unwrap_or_default(), false)
        .map_err(|e| unreadable(path, &e))?;
    let mut streams: Vec<_> = log.channels.into_iter().collect();
    streams.sort_by_key(|(id, _)| *id);
    let named = streams
        .into_iter()
        .map(|(_, channel)| (channel.topic, channel.stream));
    Ok(recording(path, named))
}

#[derive(Default)]
struct Mcap {
    /// Names of types.
    schemas: HashMap<u16, String>,
    channels: HashMap<u16, Channel>,
}

struct Channel {
    topic: String,
    layout: Layout,
    stream: Stream,
}

impl Mcap {
    /// Records one after the other, as far as they are whole: without the index at the end, which a
    /// recording that broke off has not.
    fn records(&mut self, bytes: &[u8], in_chunk: bool) -> io::Result<()> {
        let mut rest = Fields(bytes);
        while let Some((operation, content)) = rest.record() {
            let mut fields = Fields(content);
            match operation {
                SCHEMA => {
                    if let (Some(id), Some(name)) = (fields.u16(), fields.text()) {
                        self.schemas.insert(id, name.to_owned());
                    }
                }
                CHANNEL => {
                    self.channel(&mut fields);
                }
                MESSAGE => {
                    self.message(&mut fields);
                }
                // The format has none, and each level would take more of the stack.
                CHUNK if in_chunk => return Err(io::Error::other("a chunk within a chunk")),
                CHUNK => {
                    if let Some(records) = fields.chunk() {
                        self.records(&records?, true)?;
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn channel(&mut self, fields: &mut Fields) -> Option<()> {
        let (id, schema) = (fields.u16()?, fields.u16()?);
        let (topic, encoding) = (fields.text()?, fields.text()?);
        let layout = match encoding {
            "cdr" => Layout::Cdr,
            "ros1" => Layout::Ros1,
            _ => return None,
        };
        let stream = stream(self.schemas.get(&schema)?, topic)?;
        self.channels.entry(id).or_insert_with(|| Channel {
            topic: topic.to_owned(),
            layout,
            stream,
        });
        Some(())
    }

    fn message(&mut self, fields: &mut Fields) -> Option<()> {
        let channel = self.channels.get_mut(&fields.u16()?)?;
        // Number, and times of recording and of sending.
        fields.take::<20>()?;
        channel.stream.take(fields.0, channel.layout);
        Some(())
    }
}

/// What is left of some fields, little end first.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*first)
    }

    fn u16(&mut self) -> Option<u16> {
        self.take().map(u16::from_le_bytes)
    }

    fn bytes(&mut self, length: u64) -> Option<&'a [u8]> {
        let (bytes, rest) = self.0.split_at_checked(usize::try_from(length).ok()?)?;
        self.0 = rest;
        Some(bytes)
    }

    fn text(&mut self) -> Option<&'a str> {
        let length = u32::from_le_bytes(self.take()?);
        std::str::from_utf8(self.bytes(length.into())?).ok()
    }

    fn record(&mut self) -> Option<(u8, &'a [u8])> {
        let [operation] = self.take()?;
        let length = u64::from_le_bytes(self.take()?);
        Some((operation, self.bytes(length)?))
    }

    /// The records of a chunk, unpacked.
    fn chunk(&mut self) -> Option<io::Result<Vec<u8>>> {
        // First and last time, size and checksum.
        self.take::<28>()?;
        let compression = self.text()?;
        let length = u64::from_le_bytes(self.take()?);
        let packed = self.bytes(length)?;
        let mut records = Vec::new();
        Some(match compression {
            "zstd" => StreamingDecoder::new(packed)
                .map_err(io::Error::other)
                .and_then(|mut decoder| decoder.read_to_end(&mut records))
                .map(|_| records),
            "lz4" => FrameDecoder::new(packed)
                .read_to_end(&mut records)
                .map(|_| records),
            _ => Ok(packed.to_vec()),
        })
    }
}
