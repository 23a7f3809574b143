//! What ROS messages hold, of either generation: samples, positions, velocities. Axes are those of
//! REP 103: x forward, y left, z up; velocities east, north, up.

use std::path::Path;

use ins_core::{GnssFix, ImuSample, Time};
use nalgebra::{Vector2, Vector3};

use super::recording::{Imu, Receiver, Recording, degrees, merged, stated};
use crate::log::BodyAxes;

/// What a topic carries, as it comes.
pub(super) enum Stream {
    Imu(Vec<ImuSample>),
    Position(Vec<GnssFix>),
    Velocity(Vec<GnssFix>),
}

/// What a topic carries. A twist may also be the body's own, so its name has to speak of GNSS.
pub(super) fn stream(kind: &str, topic: &str) -> Option<Stream> {
    let gnss = ["gps", "gnss", "navsat", "fix", "ublox"]
        .iter()
        .any(|word| topic.contains(word));
    // The second generation says what kind of type it is.
    match kind.replace("/msg/", "/").as_str() {
        "sensor_msgs/Imu" => Some(Stream::Imu(Vec::new())),
        "sensor_msgs/NavSatFix" => Some(Stream::Position(Vec::new())),
        "geometry_msgs/TwistStamped" | "geometry_msgs/TwistWithCovarianceStamped" if gnss => {
            Some(Stream::Velocity(Vec::new()))
        }
        _ => None,
    }
}

/// One sensor for each topic of samples; one receiver for each of positions, with the velocities.
pub(super) fn recording(path: &Path, streams: impl Iterator<Item = (String, Stream)>) -> Recording {
    let (mut imus, mut receivers, mut velocities) = (Vec::new(), Vec::new(), Vec::new());
    for (name, stream) in streams {
        match stream {
            Stream::Imu(samples) => imus.push(Imu::of_rates(path, name, BodyAxes::Flu, samples)),
            Stream::Position(fixes) => receivers.push(Receiver::new(path, name, fixes)),
            Stream::Velocity(fixes) => velocities.extend(fixes),
        }
    }
    for receiver in &mut receivers {
        receiver.fixes.extend(&velocities);
        receiver.fixes = merged(std::mem::take(&mut receiver.fixes));
    }
    Recording::of(imus, receivers)
}

/// How numbers follow each other.
#[derive(Clone, Copy)]
pub(super) enum Layout {
    /// One after the other, the header with a number.
    Ros1,
    /// CDR behind four bytes: each at a multiple of its size.
    Cdr,
}

impl Stream {
    pub(super) fn take(&mut self, bytes: &[u8], layout: Layout) {
        let bytes = match layout {
            Layout::Ros1 => bytes,
            Layout::Cdr => bytes.get(4..).unwrap_or_default(),
        };
        let mut message = Message {
            bytes,
            at: 0,
            layout,
        };
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
    message.skip_f64(13)?;
    let gyro = message.vector()?;
    message.skip_f64(9)?;
    let accel = message.vector()?;
    let finite = gyro.iter().chain(&accel).all(|x| x.is_finite());
    finite.then(|| BodyAxes::Flu.sample(time, gyro, accel))
}

fn position(message: &mut Message) -> Option<GnssFix> {
    let time = message.header()?;
    let [status] = message.take()?;
    // Service.
    let _: [u8; 2] = message.take()?;
    let (latitude, longitude, altitude) = (message.f64()?, message.f64()?, message.f64()?);
    let mut covariance = [0.0; 9];
    for element in &mut covariance {
        *element = message.f64()?;
    }
    let [known] = message.take()?;
    let sigma = |variance: f64| Some(variance.sqrt()).filter(|_| known > 0);
    let level = sigma(0.5 * (covariance[0] + covariance[4]));
    // Below zero: no fix.
    (status.cast_signed() >= 0).then(|| GnssFix {
        time,
        position: degrees((latitude, longitude)),
        height_m: Some(altitude).filter(|height| height.is_finite()),
        sigma: stated([level, sigma(covariance[8]), None, None]),
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

/// A message's bytes, little end first, and how far they are read.
struct Message<'a> {
    bytes: &'a [u8],
    at: usize,
    layout: Layout,
}

impl Message<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        if let Layout::Cdr = self.layout {
            self.at = self.at.next_multiple_of(N);
        }
        let bytes = *self.bytes.get(self.at..)?.first_chunk::<N>()?;
        self.at += N;
        Some(bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.take().map(f64::from_le_bytes)
    }

    fn skip_f64(&mut self, count: usize) -> Option<()> {
        (0..count).try_for_each(|_| self.f64().map(drop))
    }

    fn vector(&mut self) -> Option<Vector3<f64>> {
        Some(Vector3::new(self.f64()?, self.f64()?, self.f64()?))
    }

    /// Stamp of the header; number and frame are passed over.
    fn header(&mut self) -> Option<Time> {
        if let Layout::Ros1 = self.layout {
            self.u32()?;
        }
        let (seconds, nanoseconds) = (self.u32()?, self.u32()?);
        let frame = self.u32()?;
        self.at += usize::try_from(frame).ok()?;
        let micros = i64::from(seconds) * 1_000_000 + i64::from(nanoseconds / 1000);
        Some(Time::from_micros(micros))
    }
}
