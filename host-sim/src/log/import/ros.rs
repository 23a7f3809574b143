//! ROS 1 bags, and MCAP by ROS 2 or converted from bags.
//!
//! Messages of both versions hold samples, positions and velocities, with the axes of REP 103: x forward, y
//! left, z up; velocities east, north, up.

use std::collections::{BTreeMap, HashMap};
use std::io::{self, Read};
use std::path::Path;

use bzip2::read::BzDecoder;
use ins_core::{GnssFix, ImuSample, Time};
use lz4_flex::frame::FrameDecoder;
use nalgebra::{Vector2, Vector3};
use ruzstd::decoding::StreamingDecoder;

use super::recording::{Recording, bytes, fix_sigma, from_degrees, merged, unreadable};
use crate::log::{BodyAxes, LogError};

/// A topic and its messages so far.
struct Topic {
    name: String,
    stream: Stream,
    /// CDR after four bytes of encapsulation, each number aligned to its size; else ROS 1 serialization,
    /// unaligned, with a sequence number in the header.
    cdr: bool,
}

enum Stream {
    Imu(Vec<ImuSample>),
    Position(Vec<GnssFix>),
    Velocity(Vec<GnssFix>),
}

impl Topic {
    /// None for types that are not read. A twist may be in body axes, so its topic must name GNSS.
    fn new(kind: &str, name: &str, cdr: bool) -> Option<Self> {
        let gnss = names_gnss(name);
        // ROS 2 has `msg` in type names.
        let stream = match kind.replace("/msg/", "/").as_str() {
            "sensor_msgs/Imu" => Stream::Imu(Vec::new()),
            "sensor_msgs/NavSatFix" => Stream::Position(Vec::new()),
            "geometry_msgs/TwistStamped" | "geometry_msgs/TwistWithCovarianceStamped" if gnss => {
                Stream::Velocity(Vec::new())
            }
            _ => return None,
        };
        let name = name.to_owned();
        Some(Self { name, stream, cdr })
    }

    fn take(&mut self, bytes: &[u8]) {
        let head = if self.cdr { 4 } else { 0 };
        let mut message = Cursor {
            bytes: bytes.get(head..).unwrap_or_default(),
            at: 0,
            aligned: self.cdr,
        };
        match &mut self.stream {
            Stream::Imu(samples) => samples.extend(imu(&mut message)),
            Stream::Position(fixes) => fixes.extend(position(&mut message)),
            Stream::Velocity(fixes) => fixes.extend(velocity(&mut message)),
        }
    }
}

fn names_gnss(topic: &str) -> bool {
    let topic = topic.to_ascii_lowercase();
    let names = ["gps", "gnss", "navsat", "ublox"];
    // As a whole word only, not as in `prefix`.
    let mut words = topic.split(|c: char| !c.is_ascii_alphanumeric());
    names.iter().any(|word| topic.contains(word)) || words.any(|word| word == "fix")
}

/// An inertial sensor for each topic of samples; a receiver for each of positions, with its velocities.
fn recording(path: &Path, topics: impl Iterator<Item = Topic>) -> Recording {
    let mut recording = Recording::default();
    let (mut receivers, mut velocities) = (Vec::new(), Vec::new());
    for Topic { name, stream, .. } in topics {
        match stream {
            Stream::Imu(samples) => recording.add_imu(path, name, BodyAxes::Flu, samples),
            Stream::Position(fixes) => receivers.push((name, fixes)),
            Stream::Velocity(fixes) => velocities.push((name, fixes)),
        }
    }
    receivers.retain(|(_, fixes)| !fixes.is_empty());
    for (topic, fixes) in velocities {
        match nearest(&topic, receivers.iter().map(|(name, _)| name.as_str())) {
            Some(index) => receivers[index].1.extend(fixes),
            None if receivers.is_empty() => {}
            None => recording.notes.push(unassigned_velocity(path, topic)),
        }
    }
    for (name, fixes) in receivers {
        recording.add_receiver(path, name, merged(fixes));
    }
    recording
}

/// The topic with the longest common namespace, if only one has it.
fn nearest<'a>(topic: &str, others: impl Iterator<Item = &'a str>) -> Option<usize> {
    let common = |other: &str| {
        let pairs = topic.split('/').zip(other.split('/'));
        let same = |(own, other): &(&str, &str)| own.eq_ignore_ascii_case(other);
        pairs.take_while(same).count()
    };
    let common: Vec<usize> = others.map(common).collect();
    let most = common.iter().max()?;
    let mut nearest = (0..common.len()).filter(|index| common[*index] == *most);
    nearest.next().filter(|_| nearest.next().is_none())
}

fn unassigned_velocity(path: &Path, topic: String) -> LogError {
    let expected = "velocities in the namespace of one receiver's positions";
    let cause = "of which receiver is not known: not used; rename the topic into the namespace of \
                 its NavSatFix";
    LogError::file(path, expected, topic, cause)
}

fn imu(message: &mut Cursor) -> Option<ImuSample> {
    let time = message.header()?;
    // Orientation and its covariance.
    message.f64s::<13>()?;
    let gyro = message.vector()?;
    message.f64s::<9>()?;
    let accel = message.vector()?;
    Some(BodyAxes::Flu.sample(time, gyro, accel))
}

fn position(message: &mut Cursor) -> Option<GnssFix> {
    let time = message.header()?;
    let [status] = message.take()?;
    // Service.
    let _: [u8; 2] = message.take()?;
    let [latitude, longitude, altitude] = message.f64s()?;
    let covariance: [f64; 9] = message.f64s()?;
    let [known] = message.take()?;
    let sigma = |variance: f64| Some(variance.sqrt()).filter(|_| known > 0);
    let horizontal = sigma(0.5 * (covariance[0] + covariance[4]));
    // Below zero: no fix.
    (status.cast_signed() >= 0).then(|| GnssFix {
        time,
        position: from_degrees((latitude, longitude)),
        height_m: Some(altitude).filter(|height| height.is_finite()),
        sigma: fix_sigma([horizontal, sigma(covariance[8]), None, None]),
        ..GnssFix::default()
    })
}

fn velocity(message: &mut Cursor) -> Option<GnssFix> {
    let time = message.header()?;
    let velocity = message.vector()?;
    let finite = velocity.iter().all(|x| x.is_finite());
    finite.then(|| GnssFix {
        time,
        velocity_en_mps: Some(Vector2::new(velocity.x, velocity.y)),
        velocity_up_mps: Some(velocity.z),
        ..GnssFix::default()
    })
}

/// A reading position in little-endian bytes.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    aligned: bool,
}

impl<'a> Cursor<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            at: 0,
            aligned: false,
        }
    }

    fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..).unwrap_or_default()
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        if self.aligned {
            self.at = self.at.next_multiple_of(N);
        }
        let bytes = *self.rest().first_chunk::<N>()?;
        self.at += N;
        Some(bytes)
    }

    fn slice(&mut self, length: u64) -> Option<&'a [u8]> {
        let length = usize::try_from(length).ok()?;
        let (bytes, _) = self.rest().split_at_checked(length)?;
        self.at += length;
        Some(bytes)
    }

    /// Bytes preceded by their number.
    fn sized(&mut self) -> Option<&'a [u8]> {
        let length = self.take().map(u32::from_le_bytes)?;
        self.slice(length.into())
    }

    fn text(&mut self) -> Option<&'a str> {
        std::str::from_utf8(self.sized()?).ok()
    }

    fn u16(&mut self) -> Option<u16> {
        self.take().map(u16::from_le_bytes)
    }

    fn f64s<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.take().map(f64::from_le_bytes)?;
        }
        Some(values)
    }

    fn vector(&mut self) -> Option<Vector3<f64>> {
        self.f64s().map(|values: [f64; 3]| values.into())
    }

    /// Stamp of the header; sequence number and frame are skipped.
    fn header(&mut self) -> Option<Time> {
        if !self.aligned {
            let _: [u8; 4] = self.take()?;
        }
        let [seconds, nanoseconds] = [self.take()?, self.take()?].map(u32::from_le_bytes);
        self.sized()?;
        let micros = i64::from(seconds) * 1_000_000 + i64::from(nanoseconds / 1000);
        Some(Time::from_micros(micros))
    }
}

/// The records of a chunk.
fn decompress(compression: &[u8], data: &[u8]) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    match compression {
        b"bz2" => BzDecoder::new(data).read_to_end(&mut bytes)?,
        b"lz4" => FrameDecoder::new(data).read_to_end(&mut bytes)?,
        b"zstd" => {
            let decoder = StreamingDecoder::new(data);
            decoder.map_err(io::Error::other)?.read_to_end(&mut bytes)?
        }
        _ => return Ok(data.to_vec()),
    };
    Ok(bytes)
}

/// Warnings of bytes not used: of damaged chunks by their offsets, and of all from an offset on.
fn damage(path: &Path, chunks: &[usize], [whole, length]: [usize; 2]) -> Vec<LogError> {
    let cause = "the recorder was stopped, or a copy broke off or was damaged: what is whole is used; \
                 `rosbag reindex` or `mcap recover` may find more";
    let chunks = chunks.first().map(|first| {
        let count = chunks.len();
        format!("{count} of its chunks damaged, the first at byte {first}: left out")
    });
    let end = (whole < length).then(|| format!("one that breaks off at byte {whole} of {length}"));
    let defects = chunks.into_iter().chain(end);
    defects
        .map(|found| LogError::file(path, "a whole recording", found, cause))
        .collect()
}

// --- ROS 1 bags ---

const BAG: &[u8] = b"#ROSBAG V2.0";

pub(super) fn is_bag(_: &Path, start: &[u8]) -> bool {
    start.starts_with(BAG)
}

pub(super) fn read_bag(path: &Path) -> Result<Recording, LogError> {
    const MESSAGE: u8 = 2;
    const CHUNK: u8 = 5;
    const CONNECTION: u8 = 7;
    let bytes = bytes(path)?;
    let start = bytes.len().min(BAG.len() + 1);
    let body = &bytes[start..];
    let (mut bag, mut damaged) = (Bag::default(), Vec::new());
    // A recording that was cut off has no index; all whole records are used.
    for record in records(body).filter(|record| record.operation() == Some(CONNECTION)) {
        bag.connect(&record);
    }
    for record in records(body).filter(|record| record.operation() == Some(CHUNK)) {
        let compression = record.field("compression").unwrap_or_default();
        let Ok(chunk) = decompress(compression, record.data) else {
            damaged.push(start + record.at);
            continue;
        };
        for record in records(&chunk) {
            match record.operation() {
                Some(CONNECTION) => bag.connect(&record),
                Some(MESSAGE) => bag.take(&record),
                _ => {}
            }
        }
    }
    let whole = records(body).last().map_or(0, |record| record.end);
    let mut recording = recording(path, bag.topics.into_values());
    let notes = damage(path, &damaged, [start + whole, bytes.len()]);
    recording.notes.extend(notes);
    Ok(recording)
}

/// Topics by connection.
#[derive(Default)]
struct Bag {
    topics: BTreeMap<u32, Topic>,
}

impl Bag {
    fn connect(&mut self, record: &Record) {
        let text = |bytes| std::str::from_utf8(bytes).ok();
        let kind = field(record.data, "type").and_then(text);
        let name = record.field("topic").and_then(text);
        if let (Some(id), Some(name), Some(kind)) = (record.connection(), name, kind)
            && let Some(topic) = Topic::new(kind, name, false)
        {
            self.topics.entry(id).or_insert(topic);
        }
    }

    fn take(&mut self, record: &Record) {
        let topic = record.connection().and_then(|id| self.topics.get_mut(&id));
        if let Some(topic) = topic {
            topic.take(record.data);
        }
    }
}

struct Record<'a> {
    header: &'a [u8],
    data: &'a [u8],
    /// Offsets of its start and end.
    at: usize,
    end: usize,
}

/// Successive records, until one is not whole.
fn records(bytes: &[u8]) -> impl Iterator<Item = Record<'_>> {
    let mut rest = Cursor::new(bytes);
    std::iter::from_fn(move || {
        let (at, header, data) = (rest.at, rest.sized()?, rest.sized()?);
        Some(Record {
            header,
            data,
            at,
            end: rest.at,
        })
    })
}

impl<'a> Record<'a> {
    fn field(&self, name: &str) -> Option<&'a [u8]> {
        field(self.header, name)
    }

    fn operation(&self) -> Option<u8> {
        self.field("op")?.first().copied()
    }

    fn connection(&self) -> Option<u32> {
        let id = self.field("conn")?.first_chunk()?;
        Some(u32::from_le_bytes(*id))
    }
}

/// The value of a field, of fields `name=value` each preceded by its length.
fn field<'a>(fields: &'a [u8], name: &str) -> Option<&'a [u8]> {
    let mut fields = Cursor::new(fields);
    let mut all = std::iter::from_fn(|| fields.sized());
    all.find_map(|field| field.strip_prefix(name.as_bytes())?.strip_prefix(b"="))
}

// --- MCAP ---

const MCAP: &[u8] = b"\x89MCAP0\r\n";

pub(super) fn is_mcap(_: &Path, start: &[u8]) -> bool {
    start.starts_with(MCAP)
}

pub(super) fn read_mcap(path: &Path) -> Result<Recording, LogError> {
    let bytes = bytes(path)?;
    let mut log = Mcap::default();
    let whole = (log.records(&bytes, MCAP.len())).map_err(|e| unreadable(path, &e))?;
    let mut recording = recording(path, log.channels.into_values());
    let notes = damage(path, &log.damaged, [whole, bytes.len()]);
    recording.notes.extend(notes);
    Ok(recording)
}

#[derive(Default)]
struct Mcap {
    /// Names of types by schema.
    schemas: HashMap<u16, String>,
    channels: BTreeMap<u16, Topic>,
    /// Offsets of chunks that cannot be decompressed.
    damaged: Vec<usize>,
}

impl Mcap {
    /// Reads successive records until one is not whole; not by the index at the end, which a recording that
    /// was cut off lacks. Returns the end of the last one.
    fn records(&mut self, bytes: &[u8], from: usize) -> io::Result<usize> {
        const SCHEMA: u8 = 3;
        const CHANNEL: u8 = 4;
        const MESSAGE: u8 = 5;
        const CHUNK: u8 = 6;
        let mut rest = Cursor::new(bytes);
        rest.at = from;
        let mut end = from;
        while let Some((operation, content)) = record(&mut rest) {
            let at = std::mem::replace(&mut end, rest.at);
            let mut fields = Cursor::new(content);
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
                // Not in the format, and the recursion would be unbounded.
                CHUNK if from == 0 => return Err(io::Error::other("a chunk within a chunk")),
                CHUNK => match chunk(&mut fields).map(|(kind, data)| decompress(kind, data)) {
                    Some(Ok(records)) => {
                        self.records(&records, 0)?;
                    }
                    _ => self.damaged.push(at),
                },
                _ => {}
            }
        }
        // The magic bytes end the file, too.
        Ok(if bytes[end..] == *MCAP {
            bytes.len()
        } else {
            end
        })
    }

    fn channel(&mut self, fields: &mut Cursor) -> Option<()> {
        let (id, schema) = (fields.u16()?, fields.u16()?);
        let (name, encoding) = (fields.text()?, fields.text()?);
        if !["cdr", "ros1"].contains(&encoding) {
            return None;
        }
        let topic = Topic::new(self.schemas.get(&schema)?, name, encoding == "cdr")?;
        self.channels.entry(id).or_insert(topic);
        Some(())
    }

    fn message(&mut self, fields: &mut Cursor) -> Option<()> {
        let topic = self.channels.get_mut(&fields.u16()?)?;
        // Sequence number, log and publish times.
        let _: [u8; 20] = fields.take()?;
        topic.take(fields.rest());
        Some(())
    }
}

fn record<'a>(rest: &mut Cursor<'a>) -> Option<(u8, &'a [u8])> {
    let [operation] = rest.take()?;
    let length = u64::from_le_bytes(rest.take()?);
    Some((operation, rest.slice(length)?))
}

/// Compression and compressed records.
fn chunk<'a>(fields: &mut Cursor<'a>) -> Option<(&'a [u8], &'a [u8])> {
    // First and last time, uncompressed size and checksum.
    let _: [u8; 28] = fields.take()?;
    let compression = fields.sized()?;
    let length = u64::from_le_bytes(fields.take()?);
    Some((compression, fields.slice(length)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topic(name: &str, stream: Stream) -> Topic {
        let name = name.to_owned();
        Topic {
            name,
            stream,
            cdr: false,
        }
    }

    fn positions(name: &str) -> Topic {
        let position = from_degrees((45.0, 9.0));
        topic(
            name,
            Stream::Position(vec![GnssFix {
                position,
                ..GnssFix::default()
            }]),
        )
    }

    fn velocities(name: &str) -> Topic {
        let velocity_en_mps = Some(Vector2::new(1.0, 2.0));
        topic(
            name,
            Stream::Velocity(vec![GnssFix {
                velocity_en_mps,
                ..GnssFix::default()
            }]),
        )
    }

    #[test]
    fn velocity_goes_to_the_receiver_of_its_namespace() {
        let [left, right] = ["/left/gps/fix", "/right/gps/fix"];
        let assigned = |name: &str| {
            let topics = [positions(left), positions(right), velocities(name)];
            let recording = recording(Path::new(""), topics.into_iter());
            let moves = recording.receivers.iter();
            let moves = moves.map(|from| from.fixes[0].velocity_en_mps.is_some());
            (moves.collect::<Vec<_>>(), recording.notes.len())
        };
        assert_eq!(assigned("/Left/GPS/vel"), (vec![true, false], 0));
        assert_eq!(assigned("/right/gps/vel"), (vec![false, true], 0));
        assert_eq!(assigned("/ublox/vel"), (vec![false, false], 1));
    }

    #[test]
    fn topics_that_name_gnss() {
        for name in [
            "/GPS/vel",
            "/ublox_gps/fix_velocity",
            "/fix/vel",
            "/navsat0/vel",
        ] {
            assert!(names_gnss(name), "{name}");
        }
        assert!(!names_gnss("/prefix/twist"));
    }
}
