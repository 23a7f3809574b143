//! `meta.toml`: form of the inertial data, axes, class of the sensors.

use std::path::Path;
use std::{fmt, fs};

use clap::ValueEnum;
use ins_core::{ImuOutput, ImuSample, Time};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::error::LogError;

const KNOWN_KEYS: [&str; 6] = [
    "body_axes",
    "imu",
    "initial_heading_deg",
    "grade",
    "lever_arm_m",
    "gnss_clock_offset_s",
];

/// Largest latency of a receiver, s: more is a difference of clocks.
const MAX_LATENCY_S: f64 = 1.0;

/// Directions of the x, y and z columns of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum BodyAxes {
    /// x forward, y right, z down.
    #[serde(rename = "FRD", alias = "frd")]
    Frd,
    /// x right, y forward, z up.
    #[serde(rename = "RFU", alias = "rfu")]
    Rfu,
    /// x forward, y left, z up.
    #[serde(rename = "FLU", alias = "flu")]
    Flu,
}

impl BodyAxes {
    pub const ALL: [Self; 3] = [Self::Frd, Self::Rfu, Self::Flu];

    /// A vector in these axes, turned to right-forward-up.
    pub fn to_rfu(self, v: Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Frd => Vector3::new(v.y, v.x, -v.z),
            Self::Rfu => v,
            Self::Flu => Vector3::new(-v.y, v.x, v.z),
        }
    }

    /// A sample in these axes, turned to right-forward-up.
    pub(super) fn sample(self, time: Time, gyro: Vector3<f64>, accel: Vector3<f64>) -> ImuSample {
        ImuSample {
            time,
            gyro: self.to_rfu(gyro),
            accel: self.to_rfu(accel),
        }
    }

    /// A right-forward-up vector, turned to these axes.
    pub fn from_rfu(self, v: Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Frd => Vector3::new(v.y, v.x, -v.z),
            Self::Rfu => v,
            Self::Flu => Vector3::new(v.y, -v.x, v.z),
        }
    }

    /// Component of a right-forward-up vector along an axis (0, 1, 2), and its sign.
    pub fn rfu_component(self, axis: usize) -> (usize, f64) {
        let along = self.to_rfu(Vector3::ith(axis, 1.0));
        (along.iamax(), along.sum())
    }

    /// The axis along a component of a right-forward-up vector.
    pub(super) fn letter(self, component: usize) -> &'static str {
        let own = (0..3).find(|&axis| self.rfu_component(axis).0 == component);
        ["x", "y", "z"][own.unwrap_or(component)]
    }

    /// Which way an axis (0, 1, 2) points on the vehicle.
    pub fn direction(self, axis: usize) -> &'static str {
        match self.rfu_component(axis) {
            (0, 1.0) => "right",
            (0, _) => "left",
            (1, _) => "forward",
            (_, 1.0) => "up",
            _ => "down",
        }
    }
}

impl fmt::Display for BodyAxes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Frd => "FRD",
            Self::Rfu => "RFU",
            Self::Flu => "FLU",
        })
    }
}

/// Class of the inertial sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Grade {
    /// Ring lasers of 1 deg/h.
    Hg1700,
    /// Consumer MEMS.
    Mems,
}

impl Grade {
    /// As in `meta.toml`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hg1700 => "hg1700",
            Self::Mems => "mems",
        }
    }
}

/// Contents of `meta.toml`.
#[derive(Clone, Debug, PartialEq)]
pub struct Meta {
    /// Axes of the columns in the files.
    pub body_axes: BodyAxes,
    /// Whether the inertial columns are rates or increments.
    pub imu: ImuOutput,
    /// Heading at the first sample, if known, deg clockwise from north.
    pub initial_heading_deg: Option<f64>,
    pub grade: Option<Grade>,
    /// Lever arm from the inertial sensors to the antenna, right-forward-up, m, if stated.
    pub lever_arm_rfu_m: Option<Vector3<f64>>,
    /// Subtracted from the times of the fixes, s: latency, or the difference of the clocks.
    pub gnss_clock_offset_s: f64,
    /// The whole file, so that foreign keys survive a rewrite.
    pub document: toml::Table,
}

#[derive(Deserialize)]
struct File {
    log: LogTable,
}

#[derive(Serialize, Deserialize)]
struct LogTable {
    body_axes: BodyAxes,
    #[serde(with = "Output")]
    imu: ImuOutput,
    initial_heading_deg: Option<f64>,
    grade: Option<Grade>,
    lever_arm_m: Option<[f64; 3]>,
    gnss_clock_offset_s: Option<f64>,
}

/// As in `meta.toml`.
#[derive(Serialize, Deserialize)]
#[serde(remote = "ImuOutput", rename_all = "lowercase")]
pub(super) enum Output {
    Rates,
    Increments,
}

impl Meta {
    /// The required keys only.
    pub fn new(body_axes: BodyAxes, imu: ImuOutput) -> Self {
        Self {
            body_axes,
            imu,
            initial_heading_deg: None,
            grade: None,
            lever_arm_rfu_m: None,
            gnss_clock_offset_s: 0.0,
            document: toml::Table::new(),
        }
    }

    /// Latency subtracted from the times of the fixes, s.
    pub fn latency_offset_s(&self) -> f64 {
        let offset_s = self.gnss_clock_offset_s;
        if offset_s.abs() <= MAX_LATENCY_S {
            offset_s
        } else {
            0.0
        }
    }

    /// Difference of the clocks subtracted from the times of the fixes, s.
    pub fn clock_offset_s(&self) -> f64 {
        self.gnss_clock_offset_s - self.latency_offset_s()
    }

    pub fn name(&self) -> Option<&str> {
        self.document.get("name")?.as_str()
    }

    pub(super) fn read(path: &Path, warnings: &mut Vec<LogError>) -> Result<Self, LogError> {
        let bytes = fs::read(path).map_err(|error| {
            let cause = "write one with: [log], body_axes = \"FRD\", \"RFU\" or \"FLU\", \
                         imu = \"rates\" or \"increments\"";
            LogError::file(path, "a readable meta.toml", error.to_string(), cause)
        })?;
        let text = String::from_utf8(bytes).map_err(|_| {
            let cause = "saved in another encoding: save as UTF-8";
            LogError::file(path, "UTF-8 text", "other bytes", cause)
        })?;
        let document: toml::Table =
            toml::from_str(&text).map_err(|e| invalid_toml(path, &text, &e))?;
        let file: File = toml::from_str(&text).map_err(|e| invalid_toml(path, &text, &e))?;
        warnings.extend(unknown_keys(path, &document));
        let table = file.log;
        let arm = table.lever_arm_m;
        let meta = Self {
            body_axes: table.body_axes,
            imu: table.imu,
            initial_heading_deg: table.initial_heading_deg,
            grade: table.grade,
            lever_arm_rfu_m: arm.map(|arm| table.body_axes.to_rfu(arm.into())),
            gnss_clock_offset_s: table.gnss_clock_offset_s.unwrap_or(0.0),
            document,
        };
        meta.check_numbers(path)?;
        warnings.extend(meta.large_clock_offset(path));
        Ok(meta)
    }

    fn check_numbers(&self, path: &Path) -> Result<(), LogError> {
        let wrong = |key: &str, expected: &str, found: String| {
            let cause = "a typing error or another unit";
            Err(LogError::file(path, expected, found, cause).in_column(key))
        };
        if let Some(heading) = self.initial_heading_deg
            && !(-360.0..=360.0).contains(&heading)
        {
            let expected = "degrees clockwise from north, -360 to 360";
            return wrong("initial_heading_deg", expected, heading.to_string());
        }
        if let Some(arm) = self.lever_arm_rfu_m
            && !arm.iter().all(|x| x.abs() <= 100.0)
        {
            let found = format!("{:?}", self.body_axes.from_rfu(arm).as_slice());
            return wrong("lever_arm_m", "metres, up to 100 per axis", found);
        }
        let offset_s = self.gnss_clock_offset_s;
        if !offset_s.is_finite() {
            return wrong("gnss_clock_offset_s", "seconds", offset_s.to_string());
        }
        Ok(())
    }

    /// Clocks of one origin differ by minutes at most; `import` subtracts differences of origin, too.
    fn large_clock_offset(&self, path: &Path) -> Option<LogError> {
        let expected = "seconds by which clocks differ, up to 300";
        let cause = "a typing error or another unit, unless one clock counts from another origin";
        let key = "gnss_clock_offset_s";
        let offset_s = self.gnss_clock_offset_s;
        let defect = || LogError::file(path, expected, offset_s.to_string(), cause).in_column(key);
        (offset_s.abs() > 300.0).then(defect)
    }

    pub(super) fn to_toml(&self) -> String {
        let arm = self.lever_arm_rfu_m;
        let known = LogTable {
            body_axes: self.body_axes,
            imu: self.imu,
            initial_heading_deg: self.initial_heading_deg,
            grade: self.grade,
            lever_arm_m: arm.map(|arm| self.body_axes.from_rfu(arm).into()),
            gnss_clock_offset_s: Some(self.gnss_clock_offset_s).filter(|s| *s != 0.0),
        };
        let mut document = self.document.clone();
        let mut log = match document.remove("log") {
            Some(toml::Value::Table(log)) => log,
            _ => toml::Table::new(),
        };
        log.retain(|key, _| !KNOWN_KEYS.contains(&key));
        // Names and numbers can always be serialized.
        log.extend(toml::Table::try_from(known).unwrap_or_default());
        document.insert("log".to_owned(), log.into());
        document.to_string()
    }
}

fn invalid_toml(path: &Path, text: &str, error: &toml::de::Error) -> LogError {
    let cause = format!(
        "[log] needs body_axes = \"FRD\", \"RFU\" or \"FLU\" and imu = \"rates\" or \
         \"increments\"; known keys: {}",
        KNOWN_KEYS.join(", ")
    );
    LogError::toml(path, text, error, &cause)
}

fn unknown_keys(path: &Path, document: &toml::Table) -> Vec<LogError> {
    let log = document.get("log").and_then(toml::Value::as_table);
    let keys = log.into_iter().flat_map(toml::Table::keys);
    keys.filter(|key| !KNOWN_KEYS.contains(&key.as_str()))
        .map(|key| {
            let expected = format!("one of the keys {}", KNOWN_KEYS.join(", "));
            let cause = "not read; harmless if intended";
            LogError::file(path, expected, format!("`{key}`"), cause).in_column(key)
        })
        .collect()
}
