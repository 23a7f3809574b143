//! ROS 1 bags.

use std::collections::BTreeMap;
use std::io::{self, Read};
use std::path::Path;

use bzip2::read::BzDecoder;
use lz4_flex::frame::FrameDecoder;

use super::recording::{Recording, bytes, unreadable};
use super::ros_messages::{Layout, Stream, recording, stream};
use crate::log::LogError;

/// The head of the file.
pub(super) const MAGIC: &[u8] = b"#ROSBAG V2.0";

pub(super) fn read(path: &Path) -> Result<Recording, LogError> {
    let bytes = bytes(path)?;
    let body = &bytes[bytes.len().min(MAGIC.len() + 1)..];
    let mut bag = Bag::default();
    // Where the recording broke off there is no index, and what is whole is used.
    for record in Records(body).filter(|record| record.operation() == Some(CONNECTION)) {
        bag.connect(&record);
    }
    for record in Records(body).filter(|record| record.operation() == Some(CHUNK)) {
        let chunk = record.unpacked().map_err(|e| unreadable(path, &e))?;
        for record in Records(&chunk) {
            match record.operation() {
                Some(CONNECTION) => bag.connect(&record),
                Some(MESSAGE) => bag.take(&record),
                _ => {}
            }
        }
    }
    Ok(recording(path, bag.streams.into_values()))
}

const MESSAGE: u8 = 2;
const CHUNK: u8 = 5;
const CONNECTION: u8 = 7;

/// By connection: topic, and what it carries.
#[derive(Default)]
struct Bag {
    streams: BTreeMap<u32, (String, Stream)>,
}

impl Bag {
    fn connect(&mut self, record: &Record) {
        let text = |name| field(record.data, name).and_then(|f| std::str::from_utf8(f).ok());
        let topic = field(record.header, "topic").and_then(|f| std::str::from_utf8(f).ok());
        if let (Some(id), Some(topic), Some(kind)) = (record.connection(), topic, text("type"))
            && let Some(stream) = stream(kind, topic)
        {
            let topic = || (topic.to_owned(), stream);
            self.streams.entry(id).or_insert_with(topic);
        }
    }

    fn take(&mut self, record: &Record) {
        let stream = record.connection().and_then(|id| self.streams.get_mut(&id));
        if let Some((_, stream)) = stream {
            stream.take(record.data, Layout::Ros1);
        }
    }
}

/// The records one after the other, as far as they are whole.
struct Records<'a>(&'a [u8]);

struct Record<'a> {
    header: &'a [u8],
    data: &'a [u8],
}

impl<'a> Iterator for Records<'a> {
    type Item = Record<'a>;

    fn next(&mut self) -> Option<Record<'a>> {
        let (header, rest) = sized(self.0)?;
        let (data, rest) = sized(rest)?;
        self.0 = rest;
        Some(Record { header, data })
    }
}

impl Record<'_> {
    fn operation(&self) -> Option<u8> {
        field(self.header, "op")?.first().copied()
    }

    fn connection(&self) -> Option<u32> {
        let id = field(self.header, "conn")?.first_chunk()?;
        Some(u32::from_le_bytes(*id))
    }

    fn unpacked(&self) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        match field(self.header, "compression") {
            Some(b"bz2") => BzDecoder::new(self.data).read_to_end(&mut bytes)?,
            Some(b"lz4") => FrameDecoder::new(self.data).read_to_end(&mut bytes)?,
            _ => return Ok(self.data.to_vec()),
        };
        Ok(bytes)
    }
}

/// Bytes behind their number, and the rest.
fn sized(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk()?;
    rest.split_at_checked(usize::try_from(u32::from_le_bytes(*length)).ok()?)
}

/// The value of a field among others, each `name=value` behind its length.
fn field<'a>(mut fields: &'a [u8], name: &str) -> Option<&'a [u8]> {
    while let Some((field, rest)) = sized(fields) {
        let value = field.strip_prefix(name.as_bytes());
        if let Some(value) = value.and_then(|value| value.strip_prefix(b"=")) {
            return Some(value);
        }
        fields = rest;
    }
    None
}
