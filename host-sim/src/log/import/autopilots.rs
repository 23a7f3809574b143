//! Logs of autopilots: `ULog` of PX4, and `DataFlash` of `ArduPilot`, of any version. Both describe their
//! messages, whose names have changed.

use std::collections::{BTreeMap, HashMap};
use std::io::ErrorKind;
use std::path::Path;

use ardupilot_binlog::{Entry, Reader};
use ins_core::{GnssFix, ImuSample, Time};
use nalgebra::Vector3;
use px4_ulog::full_parser::{Completeness, MultiId, ParsedData, SomeVec, read_file};
use px4_ulog::stream_parser::{
    LogParser, Message, ParameterMessage, SimpleCallbackResult, read_file_with_simple_callback,
};
use tempfile::NamedTempFile;

use super::recording::{
    Recording, Stamped, bytes, decompressed_file, east_north, fix_sigma, from_course, from_degrees,
    joined, unreadable,
};
use crate::log::{BodyAxes, LogError};

/// Least fix type with three dimensions.
const FIX_3D: f64 = 3.0;

/// Whether a parameter is about inertial sensors or GNSS, of either autopilot.
fn is_relevant(parameter: &str) -> bool {
    let starts = [
        "EKF2_", "SENS_", "CAL_ACC", "CAL_GYRO", "GPS", "INS_", "AHRS_", "EK3_",
    ];
    starts.iter().any(|start| parameter.starts_with(start))
}

// --- ULog ---

pub(super) fn is_ulog(_: &Path, start: &[u8]) -> bool {
    start.starts_with(b"ULog\x01\x12\x35")
}

/// Bytes before the first record.
const ULOG_HEADER: usize = 16;

pub(super) fn read_ulog(path: &Path) -> Result<Recording, LogError> {
    let decompressed = decompressed_file(path)?;
    let file = decompressed.as_ref().map_or(path, NamedTempFile::path);
    let name = file.to_str().unwrap_or_default();
    let log = Ulog(read_file(name).map_err(|e| match e.kind() {
        // The parser's own message is about its internals.
        ErrorKind::InvalidData | ErrorKind::Other => {
            let cause =
                "a damaged file, or no ULog: nothing can be read without them; copy it again";
            LogError::file(path, "definitions of what it holds", "damaged ones", cause)
        }
        _ => unreadable(path, &e),
    })?);
    let mut recording = Recording {
        parameters: parameters(name),
        ..Recording::default()
    };
    let mut add = |name: String, gyro: Vec<Stamped>, accel: Vec<Stamped>| {
        let samples = joined(&gyro, &accel, BodyAxes::Frd);
        recording.add_imu(path, name, BodyAxes::Frd, samples);
    };
    if let Some(topic) = log.topic("sensor_combined", 0) {
        let [gyro, accel] = ["gyro_rad", "accelerometer_m_s2"].map(|name| topic.vectors(name));
        add("sensor_combined".to_owned(), gyro, accel);
    }
    for instance in 0..4 {
        if let Some(topic) = log.topic("vehicle_imu", instance) {
            let [gyro, accel] = ["delta_angle", "delta_velocity"].map(|name| topic.rates(name));
            add(format!("vehicle_imu {instance}"), gyro, accel);
        }
        let gyro = log.topic("sensor_gyro", instance);
        if let Some((gyro, accel)) = gyro.zip(log.topic("sensor_accel", instance)) {
            let name = format!("sensor_gyro and sensor_accel {instance}");
            add(name, gyro.axes(), accel.axes());
        }
    }
    for message in ["vehicle_gps_position", "sensor_gps"] {
        for instance in 0..4 {
            if let Some(topic) = log.topic(message, instance) {
                recording.add_receiver(path, format!("{message} {instance}"), topic.fixes());
            }
        }
    }
    // Before 2018 in `sensor_combined`.
    for message in ["vehicle_air_data", "sensor_baro", "sensor_combined"] {
        if let Some(topic) = log.topic(message, 0)
            && let Some(heights) = topic
                .column("baro_alt_meter")
                .or_else(|| topic.column("altitude"))
        {
            recording.add_baro(topic.stamps().into_iter().zip(heights));
        }
    }
    let bytes = std::fs::read(file).map_err(|e| unreadable(path, &e))?;
    let damage = ulog_damage(&bytes);
    if log.0.completeness.is_incomplete() || damage.is_some() {
        let at_byte = damage.map_or(String::new(), |at| {
            format!(" at byte {at} of {}", bytes.len())
        });
        let found = match log.0.completeness {
            Completeness::MalformedRecord(_) => {
                format!("one with a damaged record{at_byte}: read up to there")
            }
            Completeness::Truncated => format!("one that ends too early, or is damaged{at_byte}"),
            Completeness::Complete => format!("one that is damaged{at_byte}"),
        };
        let cause = "the logger lost power, or the file is damaged; what is whole is used";
        let defect = LogError::file(path, "a whole log", found, cause);
        recording.notes.push(defect);
    }
    Ok(recording)
}

/// Offset at which the sequence of records breaks, if it does: the parser skips unknown types, and at a wrong
/// length the records behind it.
fn ulog_damage(bytes: &[u8]) -> Option<usize> {
    let mut parser = LogParser::default();
    let (mut at, mut length) = (0, ULOG_HEADER);
    loop {
        let record = bytes.get(at..at + length);
        let is_whole = record.is_some_and(|record| parser.consume_bytes(record).is_ok());
        if is_whole {
            at += length;
        }
        length = match &bytes[at..] {
            [] => return None,
            [low, high, kind, ..] if is_whole && kind.is_ascii_alphabetic() => {
                3 + usize::from(u16::from_le_bytes([*low, *high]))
            }
            // After a crash records end early, and appended data follow.
            _ => return (parser.appended_offsets()[0] == 0).then_some(at),
        };
    }
}

/// Initial parameters, as far as readable: they are for information only.
fn parameters(file: &str) -> BTreeMap<String, f64> {
    let mut all = BTreeMap::new();
    let mut take = |message: &Message| {
        let (name, value) = match message {
            Message::ParameterMessage(ParameterMessage::Float(name, value, _)) => {
                (name, f64::from(*value))
            }
            Message::ParameterMessage(ParameterMessage::Int32(name, value, _)) => {
                (name, f64::from(*value))
            }
            Message::Data(_) => return SimpleCallbackResult::Stop,
            _ => return SimpleCallbackResult::KeepReading,
        };
        if is_relevant(name) {
            all.insert((*name).to_owned(), value);
        }
        SimpleCallbackResult::KeepReading
    };
    read_file_with_simple_callback(file, &mut take).ok();
    all
}

struct Ulog(ParsedData);

impl Ulog {
    fn topic(&self, name: &str, instance: u8) -> Option<Topic<'_>> {
        let topic = self.0.messages.get(name)?.get(&MultiId::new(instance))?;
        Some(Topic(topic))
    }
}

/// Columns of a message of one instance.
struct Topic<'a>(&'a HashMap<String, SomeVec>);

impl Topic<'_> {
    fn column(&self, name: &str) -> Option<Vec<f64>> {
        let column = self.0.get(name)?;
        Some(match column {
            SomeVec::Int8(v) => v.iter().map(|x| f64::from(*x)).collect(),
            SomeVec::UInt8(v) => v.iter().map(|x| f64::from(*x)).collect(),
            SomeVec::Int16(v) => v.iter().map(|x| f64::from(*x)).collect(),
            SomeVec::UInt16(v) => v.iter().map(|x| f64::from(*x)).collect(),
            SomeVec::Int32(v) => v.iter().map(|x| f64::from(*x)).collect(),
            SomeVec::UInt32(v) => v.iter().map(|x| f64::from(*x)).collect(),
            SomeVec::Int64(v) => v.iter().map(|x| *x as f64).collect(),
            SomeVec::UInt64(v) => v.iter().map(|x| *x as f64).collect(),
            SomeVec::Float(v) => v.iter().map(|x| f64::from(*x)).collect(),
            SomeVec::Double(v) => v.clone(),
            SomeVec::Bool(v) => v.iter().map(|x| f64::from(u8::from(*x))).collect(),
            SomeVec::Char(_) => return None,
        })
    }

    /// Times of sampling where present, or else of publication.
    fn stamps(&self) -> Vec<Time> {
        let sampled = self
            .column("timestamp_sample")
            .filter(|t| t.iter().all(|us| *us > 0.0));
        let micros = sampled.or_else(|| self.column("timestamp"));
        let seconds = micros.unwrap_or_default().into_iter().map(|us| 1e-6 * us);
        seconds.filter_map(Time::from_seconds).collect()
    }

    fn vectors(&self, name: &str) -> Vec<Stamped> {
        self.vectors_of([0, 1, 2].map(|axis| format!("{name}[{axis}]")))
    }

    fn axes(&self) -> Vec<Stamped> {
        self.vectors_of(["x", "y", "z"].map(str::to_owned))
    }

    fn vectors_of(&self, names: [String; 3]) -> Vec<Stamped> {
        let [x, y, z] = names.map(|name| self.column(&name).unwrap_or_default());
        let vectors = x.into_iter().zip(y).zip(z);
        let vectors = vectors.map(|((x, y), z)| Vector3::new(x, y, z));
        self.stamps().into_iter().zip(vectors).collect()
    }

    /// Mean rates over the intervals of increments.
    fn rates(&self, name: &str) -> Vec<Stamped> {
        let micros = self.column(&format!("{name}_dt")).unwrap_or_default();
        let increments = self.vectors(name).into_iter().zip(micros);
        let some = increments.filter(|(_, us)| *us > 0.0);
        some.map(|((time, increment), us)| (time, increment / (1e-6 * us)))
            .collect()
    }

    fn fixes(&self) -> Vec<GnssFix> {
        let stamps = self.stamps();
        let column = |name: &str| self.column(name);
        // Scaled integers before 2024.
        let scaled = |name: &str, by: f64| {
            let column = self.column(name)?;
            Some(column.into_iter().map(|x| by * x).collect::<Vec<_>>())
        };
        let latitude = column("latitude_deg").or_else(|| scaled("lat", 1e-7));
        let longitude = column("longitude_deg").or_else(|| scaled("lon", 1e-7));
        let height = column("altitude_ellipsoid_m").or_else(|| scaled("alt_ellipsoid", 1e-3));
        let [kind, valid] = ["fix_type", "vel_ned_valid"].map(column);
        let [north, east, down] = ["vel_n_m_s", "vel_e_m_s", "vel_d_m_s"].map(column);
        let [eph, epv, speed] = ["eph", "epv", "s_variance_m_s"].map(column);
        let at = |column: &Option<Vec<f64>>, row: usize| {
            let value = column.as_ref()?.get(row).copied();
            value.filter(|x| x.is_finite())
        };
        let fix = |row: usize| {
            let velocity = at(&valid, row).is_none_or(|valid| valid > 0.0);
            let horizontal = at(&east, row).zip(at(&north, row)).filter(|_| velocity);
            let position = at(&latitude, row).zip(at(&longitude, row));
            GnssFix {
                time: stamps[row],
                position: position.and_then(from_degrees),
                height_m: at(&height, row),
                velocity_en_mps: horizontal.map(east_north),
                velocity_up_mps: at(&down, row).filter(|_| velocity).map(|down| -down),
                sigma: fix_sigma([at(&eph, row), at(&epv, row), at(&speed, row), None]),
            }
        };
        let fixed = |row: &usize| at(&kind, *row).is_none_or(|kind| kind >= FIX_3D);
        (0..stamps.len()).filter(fixed).map(fix).collect()
    }
}

// --- DataFlash ---

/// Header of the first message, a format message.
pub(super) fn is_dataflash(_: &Path, start: &[u8]) -> bool {
    start.starts_with(&[0xa3, 0x95, 0x80])
}

#[derive(Default)]
struct Streams {
    imu: BTreeMap<u32, Vec<ImuSample>>,
    gyro: BTreeMap<u32, Vec<Stamped>>,
    accel: BTreeMap<u32, Vec<Stamped>>,
    gnss: BTreeMap<u32, Vec<GnssFix>>,
    baro: BTreeMap<(&'static str, u32), Vec<(Time, f64)>>,
    parameters: BTreeMap<String, f64>,
}

pub(super) fn read_dataflash(path: &Path) -> Result<Recording, LogError> {
    let mut streams = Streams::default();
    let bytes = bytes(path)?;
    let mut reader = Reader::new(bytes.as_slice());
    // The reader skips damaged bytes silently.
    let (mut whole, mut damage) = (0, None);
    while let Some(Ok(entry)) = reader.next() {
        let head = bytes.get(whole..whole + 3);
        if head != Some(&[0xa3, 0x95, entry.msg_type]) {
            damage.get_or_insert(whole);
        }
        let length = reader.formats().get(&entry.msg_type).map(|f| f.msg_len);
        whole += usize::from(length.unwrap_or_default());
        streams.take(&entry);
    }
    let (at, length) = (damage.unwrap_or(whole), bytes.len());
    // An incomplete last message is normal, from power-off.
    let damage = (length > at + usize::from(u8::MAX)).then(|| {
        let lost = length.saturating_sub(whole);
        let found = format!("{lost} of {length} bytes that are no messages, from byte {at} on");
        let cause = "the file is damaged, or filled up: they are skipped";
        LogError::file(path, "a whole log", found, cause)
    });
    let mut recording = Recording {
        notes: damage.into_iter().collect(),
        parameters: streams.parameters,
        ..Recording::default()
    };
    for (instance, samples) in streams.imu {
        recording.add_imu(path, format!("IMU {instance}"), BodyAxes::Frd, samples);
    }
    for (instance, gyro) in &streams.gyro {
        if let Some(accel) = streams.accel.get(instance) {
            let samples = joined(gyro, accel, BodyAxes::Frd);
            let name = format!("GYR and ACC {instance}");
            recording.add_imu(path, name, BodyAxes::Frd, samples);
        }
    }
    for (instance, fixes) in streams.gnss {
        recording.add_receiver(path, format!("GPS {instance}"), fixes);
    }
    for heights in streams.baro.into_values() {
        recording.add_baro(heights.into_iter());
    }
    Ok(recording)
}

impl Streams {
    fn height(&mut self, of: (&'static str, u32), entry: &Entry, name: &str) {
        let height = time(entry).zip(entry.get_f64(name));
        self.baro.entry(of).or_default().extend(height);
    }

    fn take(&mut self, entry: &Entry) {
        let (name, instance) = instance(entry);
        match name {
            "IMU" => {
                let vectors = vector(entry, "Gyr").zip(vector(entry, "Acc"));
                let sample = time(entry).zip(vectors);
                let sample =
                    sample.map(|(time, (gyro, accel))| BodyAxes::Frd.sample(time, gyro, accel));
                self.imu.entry(instance).or_default().extend(sample);
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
                let options = self.parameters.get("GPS_DRV_OPTIONS");
                let ellipsoidal = options.is_some_and(|options| is_ellipsoidal(*options));
                if let Some(last) = self.gnss.get_mut(&instance).and_then(|g| g.last_mut()) {
                    accuracy(entry, last);
                    if !ellipsoidal && time(entry) == Some(last.time) {
                        above_the_ellipsoid(entry, last);
                    }
                }
            }
            "BARO" => self.height(("BARO", instance), entry, "Alt"),
            "CTUN" => self.height(("CTUN", instance), entry, "BarAlt"),
            "PARM" => {
                let set = entry.get_str("Name").zip(entry.get_f64("Value"));
                let set = set.filter(|(name, _)| is_relevant(name));
                let set = set.map(|(name, value)| (name.to_owned(), value));
                self.parameters.extend(set);
            }
            _ => {}
        }
    }
}

/// Message name and instance, from one: a field in new logs; in old ones a digit of the name, from one for
/// gyros and accelerometers, and from two, none for the first, for others.
fn instance(entry: &Entry) -> (&str, u32) {
    let name = entry.name.trim_end_matches(|c: char| c.is_ascii_digit());
    let digit = entry.name[name.len()..].parse().ok();
    let field = entry.get_i64("I").and_then(|i| u32::try_from(i).ok());
    (name, field.map(|i| i + 1).or(digit).unwrap_or(1))
}

/// Time by the autopilot's clock, of sampling where present, or else of the message. In old fixes TimeMS is
/// GPS time, and T the autopilot's.
fn time(entry: &Entry) -> Option<Time> {
    let integer = |name| {
        let unsigned = || i64::try_from(entry.get_u64(name)?).ok();
        entry.get_i64(name).or_else(unsigned)
    };
    let sampled = integer("SampleUS").filter(|us| *us > 0);
    let micros = sampled.or_else(|| integer("TimeUS"));
    let millis = || integer("T").or_else(|| integer("TimeMS"));
    micros
        .or_else(|| Some(1000 * millis()?))
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
    let position = ["Lat", "Lng"].map(|name| entry.get_f64(name).map(|angle| 1e-7 * angle));
    let speed = entry.get_f64("Spd").zip(entry.get_f64("GCrs"));
    Some(GnssFix {
        time: time(entry)?,
        position: from_degrees((position[0]?, position[1]?)),
        height_m: entry.get_f64("Alt"),
        velocity_en_mps: speed.map(from_course),
        velocity_up_mps: entry.get_f64("VZ").map(|down| -down),
        ..GnssFix::default()
    })
}

/// Accuracy of the preceding fix.
fn accuracy(entry: &Entry, fix: &mut GnssFix) {
    let [horizontal, up, speed] = ["HAcc", "VAcc", "SAcc"].map(|name| entry.get_f64(name));
    fix.sigma = fix_sigma([horizontal, up, speed, None]);
    if entry.get_f64("VV") == Some(0.0) {
        fix.velocity_up_mps = None;
    }
}

/// Whether the driver outputs heights above the ellipsoid instead of sea level.
fn is_ellipsoidal(driver_options: f64) -> bool {
    (driver_options / 16.0).rem_euclid(2.0) >= 1.0
}

/// `ArduPilot`'s undulation is the height above sea level minus that above the ellipsoid, opposite to the
/// usual sign convention.
fn above_the_ellipsoid(entry: &Entry, fix: &mut GnssFix) {
    let undulation_m = entry.get_f64("Und").unwrap_or_default();
    fix.height_m = fix.height_m.map(|height_m| height_m - undulation_m);
}
