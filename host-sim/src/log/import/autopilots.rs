//! Logs of autopilots: PX4's `ULog`, and `ArduPilot`'s `DataFlash` of any age. In both messages
//! describe themselves, and names have changed.

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
    Recording, Stamped, bytes, decompressed_file, east_north, from_degrees, joined, over_ground,
    stated, unreadable,
};
use crate::log::{BodyAxes, LogError};

/// Fix with a position in three dimensions.
const FIX_3D: f64 = 3.0;

/// Parameters about inertial sensors and GNSS, of either autopilot; the other thousand are left.
fn concerns_sensors(parameter: &str) -> bool {
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
        // Its words are those of the parser.
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
    // In logs of before 2018 among the samples.
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
        let place = damage.map_or(String::new(), |at| {
            format!(" at byte {at} of {}", bytes.len())
        });
        let found = match log.0.completeness {
            Completeness::MalformedRecord(_) => {
                format!("one with a damaged record{place}: read up to there")
            }
            Completeness::Truncated => format!("one that ends too early, or is damaged{place}"),
            Completeness::Complete => format!("one that is damaged{place}"),
        };
        let cause = "the logger lost power, or the file is damaged; what is whole is used";
        let defect = LogError::file(path, "a whole log", found, cause);
        recording.notes.push(defect);
    }
    Ok(recording)
}

/// The byte at which records no longer follow each other, if they break: the parser skips those of kinds that
/// it does not know, and with a wrong length whatever is behind.
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
            // A crash cuts the records off, and appends what it leaves.
            _ => return (parser.appended_offsets()[0] == 0).then_some(at),
        };
    }
}

/// As set when the log began. What can be read of them is enough: they only help to print more.
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
        if concerns_sensors(name) {
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

/// Columns of one message of one source.
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

    /// When it was sampled, where that is written, or else published.
    fn stamps(&self) -> Vec<Time> {
        let sampled = self
            .column("timestamp_sample")
            .filter(|t| t.iter().all(|us| *us > 0.0));
        let micros = sampled.or_else(|| self.column("timestamp"));
        let seconds = micros.unwrap_or_default().into_iter().map(|us| 1e-6 * us);
        seconds.filter_map(Time::from_seconds).collect()
    }

    fn vectors(&self, name: &str) -> Vec<Stamped> {
        self.three([0, 1, 2].map(|axis| format!("{name}[{axis}]")))
    }

    fn axes(&self) -> Vec<Stamped> {
        self.three(["x", "y", "z"].map(str::to_owned))
    }

    fn three(&self, names: [String; 3]) -> Vec<Stamped> {
        let [x, y, z] = names.map(|name| self.column(&name).unwrap_or_default());
        let vectors = x.into_iter().zip(y).zip(z);
        let vectors = vectors.map(|((x, y), z)| Vector3::new(x, y, z));
        self.stamps().into_iter().zip(vectors).collect()
    }

    /// Means over the intervals of increments.
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
        // Integers before 2024.
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
            let level = at(&east, row).zip(at(&north, row)).filter(|_| velocity);
            let place = at(&latitude, row).zip(at(&longitude, row));
            GnssFix {
                time: stamps[row],
                position: place.and_then(from_degrees),
                height_m: at(&height, row),
                velocity_en_mps: level.map(east_north),
                velocity_up_mps: at(&down, row).filter(|_| velocity).map(|down| -down),
                sigma: stated([at(&eph, row), at(&epv, row), at(&speed, row), None]),
            }
        };
        let fixed = |row: &usize| at(&kind, *row).is_none_or(|kind| kind >= FIX_3D);
        (0..stamps.len()).filter(fixed).map(fix).collect()
    }
}

// --- DataFlash ---

/// The head of the first message, which describes messages.
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
    // The reader skips what is damaged, and says nothing.
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
    // The last message breaks off where power is lost, as ever.
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
                let set = set.filter(|(name, _)| concerns_sensors(name));
                let set = set.map(|(name, value)| (name.to_owned(), value));
                self.parameters.extend(set);
            }
            _ => {}
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
    let place = ["Lat", "Lng"].map(|name| entry.get_f64(name).map(|angle| 1e-7 * angle));
    let speed = entry.get_f64("Spd").zip(entry.get_f64("GCrs"));
    Some(GnssFix {
        time: time(entry)?,
        position: from_degrees((place[0]?, place[1]?)),
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

/// Whether the driver was told to give heights above the ellipsoid instead of the sea.
fn is_ellipsoidal(driver_options: f64) -> bool {
    (driver_options / 16.0).rem_euclid(2.0) >= 1.0
}

/// `ArduPilot`'s undulation is the height above the sea less that above the ellipsoid: elsewhere it
/// is the other way round.
fn above_the_ellipsoid(entry: &Entry, fix: &mut GnssFix) {
    let undulation_m = entry.get_f64("Und").unwrap_or_default();
    fix.height_m = fix.height_m.map(|height_m| height_m - undulation_m);
}
