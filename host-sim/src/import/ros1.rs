//! ROS 1 bags: `sensor_msgs/Imu`, `sensor_msgs/NavSatFix` and the twists of GNSS. Axes are those of
//! REP 103: x forward, y left, z up; velocities east, north, up.

use std::collections::BTreeMap;
use std::io::{self, Read};
use std::path::Path;

use bzip2::read::BzDecoder;
use ins_core::{FixSigma, GnssFix, ImuOutput, ImuSample, Time};
use lz4_flex::frame::FrameDecoder;
use nalgebra::{Vector2, Vector3};

use super::{Imu, Receiver, Recording, bytes, degrees, merged, stated, unreadable};
use crate::log::{BodyAxes, LogError};

/// The head of the file.
pub(super) const MAGIC: &[u8] = b"#ROSBAG V2.0";

enum Stream {
    Imu(Vec<ImuSample>),
    Position(Vec<GnssFix>),
    Velocity(Vec<GnssFix>),
}

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
            stream.take(record.data);
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

/// What a topic carries. A twist may also be the body's own, so its name has to speak of GNSS.
fn stream(kind: &str, topic: &str) -> Option<Stream> {
    let gnss = ["gps", "gnss", "navsat", "fix", "ublox"]
        .iter()
        .any(|word| topic.contains(word));
    match kind {
        "sensor_msgs/Imu" => Some(Stream::Imu(Vec::new())),
        "sensor_msgs/NavSatFix" => Some(Stream::Position(Vec::new())),
        "geometry_msgs/TwistStamped" | "geometry_msgs/TwistWithCovarianceStamped" if gnss => {
            Some(Stream::Velocity(Vec::new()))
        }
        _ => None,
    }
}

/// One sensor for each topic of samples; one receiver for each of positions, with the velocities.
fn recording(path: &Path, streams: impl Iterator<Item = (String, Stream)>) -> Recording {
    let (mut imus, mut receivers, mut velocities) = (Vec::new(), Vec::new(), Vec::new());
    for (name, stream) in streams {
        match stream {
            Stream::Imu(samples) => imus.push(Imu {
                path: path.to_owned(),
                name,
                axes: BodyAxes::Flu,
                output: ImuOutput::Rates,
                samples,
            }),
            Stream::Position(fixes) => receivers.push(Receiver {
                path: path.to_owned(),
                name,
                fixes,
            }),
            Stream::Velocity(fixes) => velocities.extend(fixes),
        }
    }
    for receiver in &mut receivers {
        receiver.fixes.extend(&velocities);
        receiver.fixes = merged(std::mem::take(&mut receiver.fixes));
    }
    Recording::of(imus, receivers)
}

impl Stream {
    fn take(&mut self, bytes: &[u8]) {
        let mut message = Message(bytes);
        match self {
            Self::Imu(samples) => samples.extend(imu(&mut message)),
            Self::Position(fixes) => fixes.extend(position(&mut message)),
            Self::Velocity(fixes) => fixes.extend(velocity(&mut message)),
        }
    }
}

fn imu(message: &mut Message) -> Option<ImuSample> {
    let time = message.header()?;
    // Orientation and its covariance.
    message.skip(13 * 8)?;
    let gyro = message.vector()?;
    message.skip(9 * 8)?;
    let accel = message.vector()?;
    let finite = gyro.iter().chain(&accel).all(|x| x.is_finite());
    finite.then(|| ImuSample {
        time,
        gyro: BodyAxes::Flu.to_rfu(gyro),
        accel: BodyAxes::Flu.to_rfu(accel),
    })
}

fn position(message: &mut Message) -> Option<GnssFix> {
    let time = message.header()?;
    let [status] = message.take()?;
    // Service.
    message.skip(2)?;
    let (latitude, longitude, altitude) = (message.f64()?, message.f64()?, message.f64()?);
    let mut covariance = [0.0; 9];
    for element in &mut covariance {
        *element = message.f64()?;
    }
    let [known] = message.take()?;
    let sigma = |variance: f64| Some(variance.sqrt()).filter(|_| known > 0).and_then(stated);
    // Below zero: no fix.
    (status.cast_signed() >= 0).then(|| GnssFix {
        time,
        position: degrees(latitude, longitude),
        height_m: Some(altitude).filter(|height| height.is_finite()),
        sigma: FixSigma {
            position_m: sigma(0.5 * (covariance[0] + covariance[4])),
            height_m: sigma(covariance[8]),
            ..FixSigma::default()
        },
        ..GnssFix::default()
    })
}

fn velocity(message: &mut Message) -> Option<GnssFix> {
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

/// What is left of a message's bytes, little end first.
struct Message<'a>(&'a [u8]);

impl Message<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*first)
    }

    fn skip(&mut self, bytes: usize) -> Option<()> {
        self.0 = self.0.get(bytes..)?;
        Some(())
    }

    fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.take().map(f64::from_le_bytes)
    }

    fn vector(&mut self) -> Option<Vector3<f64>> {
        Some(Vector3::new(self.f64()?, self.f64()?, self.f64()?))
    }

    /// Stamp of the header; number and frame are passed over.
    fn header(&mut self) -> Option<Time> {
        self.u32()?;
        let (seconds, nanoseconds) = (self.u32()?, self.u32()?);
        let frame = self.u32()?;
        self.skip(usize::try_from(frame).ok()?)?;
        let micros = i64::from(seconds) * 1_000_000 + i64::from(nanoseconds / 1000);
        Some(Time::from_micros(micros))
    }
}
