//! PX4 ULog.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use ins_core::{GnssFix, Time};
use nalgebra::Vector3;
use px4_ulog::full_parser::{MultiId, ParsedData, SomeVec, read_file};
use px4_ulog::stream_parser::{
    Message, ParameterMessage, SimpleCallbackResult, read_file_with_simple_callback,
};

use super::recording::{
    Imu, Receiver, Recording, Stamped, concerns_sensors, degrees, east_north, joined, stated,
    unreadable,
};
use crate::log::{BodyAxes, LogError};

/// The head of the file.
pub(super) const MAGIC: &[u8] = b"ULog\x01\x12\x35";

/// Fix with a position in three dimensions.
const FIX_3D: f64 = 3.0;

pub(super) fn read(path: &Path) -> Result<Recording, LogError> {
    let name = path.to_str().unwrap_or_default();
    let log = Ulog(read_file(name).map_err(|e| unreadable(path, &e))?);
    let mut imus = Vec::new();
    let mut push = |name: String, gyro: Vec<Stamped>, accel: Vec<Stamped>| {
        let samples = joined(&gyro, &accel, BodyAxes::Frd);
        imus.push(Imu::of_rates(path, name, BodyAxes::Frd, samples));
    };
    if let Some(topic) = log.topic("sensor_combined", 0) {
        let time = topic.stamps();
        let accel = topic.vectors("accelerometer_m_s2", &time);
        push(
            "sensor_combined".to_owned(),
            topic.vectors("gyro_rad", &time),
            accel,
        );
    }
    for instance in 0..4 {
        if let Some(topic) = log.topic("vehicle_imu", instance) {
            let time = topic.stamps();
            let gyro = topic.rates("delta_angle", &time);
            let accel = topic.rates("delta_velocity", &time);
            push(format!("vehicle_imu {instance}"), gyro, accel);
        }
        let gyro = log.topic("sensor_gyro", instance);
        if let Some((gyro, accel)) = gyro.zip(log.topic("sensor_accel", instance)) {
            let (gyro, accel) = (gyro.axes(), accel.axes());
            push(
                format!("sensor_gyro and sensor_accel {instance}"),
                gyro,
                accel,
            );
        }
    }
    let mut receivers = Vec::new();
    for message in ["vehicle_gps_position", "sensor_gps"] {
        for instance in 0..4 {
            if let Some(topic) = log.topic(message, instance) {
                let name = format!("{message} {instance}");
                receivers.push(Receiver::new(path, name, topic.fixes()));
            }
        }
    }
    let mut recording = Recording {
        parameters: parameters(name),
        ..Recording::of(imus, receivers)
    };
    if log.0.completeness.is_incomplete() {
        let cause = "the logger lost power, or the file is damaged; what is whole is used";
        let defect = LogError::file(path, "a whole log", "one that ends too early", cause);
        recording.notes.push(defect);
    }
    Ok(recording)
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

    fn vectors(&self, name: &str, stamps: &[Time]) -> Vec<Stamped> {
        self.three([0, 1, 2].map(|axis| format!("{name}[{axis}]")), stamps)
    }

    fn axes(&self) -> Vec<Stamped> {
        self.three(["x", "y", "z"].map(str::to_owned), &self.stamps())
    }

    fn three(&self, names: [String; 3], stamps: &[Time]) -> Vec<Stamped> {
        let [x, y, z] = names.map(|name| self.column(&name).unwrap_or_default());
        let vectors = x
            .iter()
            .zip(&y)
            .zip(&z)
            .map(|((x, y), z)| Vector3::new(*x, *y, *z));
        stamps.iter().copied().zip(vectors).collect()
    }

    /// Means over the intervals of increments.
    fn rates(&self, name: &str, stamps: &[Time]) -> Vec<Stamped> {
        let micros = self.column(&format!("{name}_dt")).unwrap_or_default();
        let increments = self.vectors(name, stamps).into_iter().zip(micros);
        let some = increments.filter(|(_, us)| *us > 0.0);
        some.map(|((time, increment), us)| (time, increment / (1e-6 * us)))
            .collect()
    }

    fn fixes(&self) -> Vec<GnssFix> {
        let stamps = self.stamps();
        let column = |name: &str| self.column(name);
        let scaled = |name: &str, by: f64| {
            self.column(name)
                .map(|c| c.into_iter().map(|x| by * x).collect::<Vec<_>>())
        };
        // Integers before 2024.
        let latitude = column("latitude_deg").or_else(|| scaled("lat", 1e-7));
        let longitude = column("longitude_deg").or_else(|| scaled("lon", 1e-7));
        let height = column("altitude_ellipsoid_m").or_else(|| scaled("alt_ellipsoid", 1e-3));
        let [kind, valid] = ["fix_type", "vel_ned_valid"].map(column);
        let [north, east, down] = ["vel_n_m_s", "vel_e_m_s", "vel_d_m_s"].map(column);
        let [eph, epv, speed] = ["eph", "epv", "s_variance_m_s"].map(column);
        let at = |column: &Option<Vec<f64>>, row: usize| {
            column
                .as_ref()
                .and_then(|c| c.get(row))
                .copied()
                .filter(|x| x.is_finite())
        };
        let fix = |row: usize| {
            let velocity = at(&valid, row).is_none_or(|valid| valid > 0.0);
            let level = at(&east, row).zip(at(&north, row)).filter(|_| velocity);
            let place = at(&latitude, row).zip(at(&longitude, row));
            GnssFix {
                time: stamps[row],
                position: place.and_then(degrees),
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
