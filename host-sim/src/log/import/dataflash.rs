//! ArduPilot DataFlash logs, of any age: messages describe themselves, names have changed.

use std::collections::BTreeMap;
use std::path::Path;

use ardupilot_binlog::{Entry, Reader};
use ins_core::{GnssFix, ImuSample, Time};
use nalgebra::Vector3;

use super::recording::{
    Imu, Receiver, Recording, Stamped, concerns_sensors, degrees, joined, over_ground, stated,
    unpacked,
};
use crate::log::{BodyAxes, LogError};

/// The head of the first message, which describes messages.
pub(super) const MAGIC: &[u8] = &[0xa3, 0x95, 0x80];

/// Fix with a position in three dimensions.
const FIX_3D: f64 = 3.0;

#[derive(Default)]
struct Streams {
    imu: BTreeMap<u32, Vec<ImuSample>>,
    gyro: BTreeMap<u32, Vec<Stamped>>,
    accel: BTreeMap<u32, Vec<Stamped>>,
    gnss: BTreeMap<u32, Vec<GnssFix>>,
    parameters: BTreeMap<String, f64>,
}

pub(super) fn read(path: &Path) -> Result<Recording, LogError> {
    let mut streams = Streams::default();
    // The reader skips what is damaged.
    for entry in Reader::new(unpacked(path)?).flatten() {
        streams.take(&entry);
    }
    Ok(streams.recording(path))
}

impl Streams {
    fn take(&mut self, entry: &Entry) {
        let (name, instance) = instance(entry);
        match name {
            "IMU" => {
                let sample = time(entry)
                    .zip(vector(entry, "Gyr"))
                    .zip(vector(entry, "Acc"));
                if let Some(((time, gyro), accel)) = sample {
                    let sample = BodyAxes::Frd.sample(time, gyro, accel);
                    self.imu.entry(instance).or_default().push(sample);
                }
            }
            "GYR" => {
                let stamped = time(entry).zip(vector(entry, "Gyr"));
                self.gyro.entry(instance).or_default().extend(stamped);
            }
            "ACC" => {
                let stamped = time(entry).zip(vector(entry, "Acc"));
                self.accel.entry(instance).or_default().extend(stamped);
            }
            "GPS" => self.gnss.entry(instance).or_default().extend(fix(entry)),
            "GPA" => {
                if let Some(last) = self.gnss.get_mut(&instance).and_then(|g| g.last_mut()) {
                    accuracy(entry, last);
                }
            }
            "PARM" => {
                let set = entry.get_str("Name").zip(entry.get_f64("Value"));
                let set = set.filter(|(name, _)| concerns_sensors(name));
                let set = set.map(|(name, value)| (name.to_owned(), value));
                self.parameters.extend(set);
            }
            _ => {}
        }
    }

    fn recording(self, path: &Path) -> Recording {
        let imu = |name: String, samples: Vec<ImuSample>| {
            Imu::of_rates(path, name, BodyAxes::Frd, samples)
        };
        let mut imus: Vec<Imu> = self
            .imu
            .into_iter()
            .map(|(instance, samples)| imu(format!("IMU {instance}"), samples))
            .collect();
        for (instance, gyro) in &self.gyro {
            if let Some(accel) = self.accel.get(instance) {
                let samples = joined(gyro, accel, BodyAxes::Frd);
                imus.push(imu(format!("GYR and ACC {instance}"), samples));
            }
        }
        let receiver = |(instance, fixes)| Receiver::new(path, format!("GPS {instance}"), fixes);
        Recording {
            parameters: self.parameters,
            ..Recording::of(imus, self.gnss.into_iter().map(receiver).collect())
        }
    }
}

/// Message and number of its source: a field in new logs, a digit of the name in old ones, which
/// counted gyros and accelerometers from one and had no number for the first of the others.
fn instance(entry: &Entry) -> (&str, u32) {
    let name = entry.name.trim_end_matches(|c: char| c.is_ascii_digit());
    let digit = entry.name[name.len()..].parse().ok();
    let field = entry.get_i64("I").and_then(|i| u32::try_from(i).ok());
    (name, field.map(|i| i + 1).or(digit).unwrap_or(1))
}

/// On the autopilot's clock: of the sample, where that is written, or else of the message. In old
/// fixes TimeMS is GPS time, and T the autopilot's.
fn time(entry: &Entry) -> Option<Time> {
    let micros = entry.get_i64("SampleUS").filter(|us| *us > 0);
    let unsigned = |name| entry.get_u64(name).and_then(|us| i64::try_from(us).ok());
    let micros = micros
        .or_else(|| unsigned("SampleUS"))
        .or_else(|| unsigned("TimeUS"));
    let millis = entry.get_i64("T").or_else(|| entry.get_i64("TimeMS"));
    micros
        .or_else(|| entry.get_i64("TimeUS"))
        .or_else(|| millis.map(|ms| 1000 * ms))
        .map(Time::from_micros)
}

fn vector(entry: &Entry, name: &str) -> Option<Vector3<f64>> {
    let axis = |axis| entry.get_f64(&format!("{name}{axis}"));
    Some(Vector3::new(axis('X')?, axis('Y')?, axis('Z')?))
}

fn fix(entry: &Entry) -> Option<GnssFix> {
    if entry.get_f64("Status")? < FIX_3D {
        return None;
    }
    let place = ["Lat", "Lng"].map(|name| entry.get_f64(name).map(|angle| 1e-7 * angle));
    let speed = entry.get_f64("Spd").zip(entry.get_f64("GCrs"));
    Some(GnssFix {
        time: time(entry)?,
        position: degrees((place[0]?, place[1]?)),
        height_m: entry.get_f64("Alt"),
        velocity_en_mps: speed.map(over_ground),
        velocity_up_mps: entry.get_f64("VZ").map(|down| -down),
        ..GnssFix::default()
    })
}

/// The message about the accuracy of the fix before it.
fn accuracy(entry: &Entry, fix: &mut GnssFix) {
    let [level, up, speed] = ["HAcc", "VAcc", "SAcc"].map(|name| entry.get_f64(name));
    fix.sigma = stated([level, up, speed, None]);
    if entry.get_f64("VV") == Some(0.0) {
        fix.velocity_up_mps = None;
    }
}
