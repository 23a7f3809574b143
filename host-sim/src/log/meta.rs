//! `meta.toml`: how the log was recorded.

use std::fs;
use std::path::Path;

use clap::ValueEnum;
use ins_core::ImuOutput;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::axes::BodyAxes;
use super::error::LogError;

const KNOWN_KEYS: [&str; 6] = [
    "body_axes",
    "imu",
    "initial_heading_deg",
    "grade",
    "lever_arm_m",
    "gnss_clock_offset_s",
];

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
    /// As it is written.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hg1700 => "hg1700",
            Self::Mems => "mems",
        }
    }
}

/// What `meta.toml` says.
#[derive(Clone, Debug, PartialEq)]
pub struct Meta {
    /// Axes of the columns in the files.
    pub body_axes: BodyAxes,
    /// Whether the inertial columns are rates or increments.
    pub imu: ImuOutput,
    /// Heading at the first sample, if the logger knew it, deg clockwise from north.
    pub initial_heading_deg: Option<f64>,
    /// Class of the sensors, if stated.
    pub grade: Option<Grade>,
    /// Antenna position from the inertial sensors, right-forward-up, m, if stated.
    pub lever_arm_rfu_m: Option<Vector3<f64>>,
    /// What has been taken off the stamps of the fixes, s: a part of their latency.
    pub gnss_clock_offset_s: f64,
    /// The whole file, so that what is not ours survives a rewrite.
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

/// As it is written.
#[derive(Serialize, Deserialize)]
#[serde(remote = "ImuOutput", rename_all = "lowercase")]
pub(super) enum Output {
    Rates,
    Increments,
}

impl Meta {
    /// The least that a log says of itself.
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

    /// Name of the log, if the file gives one.
    pub fn name(&self) -> Option<&str> {
        self.document.get("name")?.as_str()
    }

    pub(super) fn read(path: &Path, warnings: &mut Vec<LogError>) -> Result<Self, LogError> {
        let bytes = fs::read(path).map_err(|e| missing(path, &e))?;
        let text = String::from_utf8(bytes).map_err(|_| not_utf8(path))?;
        let document: toml::Table = toml::from_str(&text).map_err(|e| bad(path, &text, &e))?;
        let file: File = toml::from_str(&text).map_err(|e| bad(path, &text, &e))?;
        warnings.extend(unread_keys(path, &document));
        let table = file.log;
        let meta = Self {
            body_axes: table.body_axes,
            imu: table.imu,
            initial_heading_deg: table.initial_heading_deg,
            grade: table.grade,
            lever_arm_rfu_m: table
                .lever_arm_m
                .map(|arm| table.body_axes.to_rfu(arm.into())),
            gnss_clock_offset_s: table.gnss_clock_offset_s.unwrap_or(0.0),
            document,
        };
        meta.check_numbers(path)?;
        Ok(meta)
    }

    fn check_numbers(&self, path: &Path) -> Result<(), LogError> {
        let out = |key: &str, expected: &str, found: String| {
            LogError::file(path, expected, found, "a slip of the pen or another unit")
                .in_column(key)
        };
        if let Some(heading) = self
            .initial_heading_deg
            .filter(|h| !(-360.0..=360.0).contains(h))
        {
            let expected = "degrees clockwise from north, -360 to 360";
            return Err(out("initial_heading_deg", expected, heading.to_string()));
        }
        match self.lever_arm_rfu_m {
            Some(arm) if !arm.iter().all(|x| x.abs() <= 100.0) => {
                let found = format!("{:?}", self.body_axes.from_rfu(arm).as_slice());
                Err(out("lever_arm_m", "metres, up to 100 per axis", found))
            }
            _ => Ok(()),
        }
    }

    pub(super) fn to_toml(&self) -> String {
        let mut document = self.document.clone();
        let log = document
            .entry("log")
            .or_insert_with(|| toml::Table::new().into());
        if !log.is_table() {
            *log = toml::Table::new().into();
        }
        if let Some(log) = log.as_table_mut() {
            self.fill(log);
        }
        document.to_string()
    }

    fn fill(&self, log: &mut toml::Table) {
        let arm = self.lever_arm_rfu_m;
        let table = LogTable {
            body_axes: self.body_axes,
            imu: self.imu,
            initial_heading_deg: self.initial_heading_deg,
            grade: self.grade,
            lever_arm_m: arm.map(|arm| self.body_axes.from_rfu(arm).into()),
            gnss_clock_offset_s: Some(self.gnss_clock_offset_s).filter(|s| *s != 0.0),
        };
        log.retain(|key, _| !KNOWN_KEYS.contains(&key));
        // Names and numbers can always be written.
        log.extend(toml::Table::try_from(table).unwrap_or_default());
    }
}

fn missing(path: &Path, error: &std::io::Error) -> LogError {
    LogError::file(
        path,
        "a readable meta.toml",
        error.to_string(),
        "write one with: [log], body_axes = \"FRD\", \"RFU\" or \"FLU\", \
         imu = \"rates\" or \"increments\"",
    )
}

fn not_utf8(path: &Path) -> LogError {
    LogError::file(
        path,
        "UTF-8 text",
        "other bytes",
        "saved in another encoding: save as UTF-8",
    )
}

fn bad(path: &Path, text: &str, error: &toml::de::Error) -> LogError {
    let cause = format!(
        "[log] needs body_axes = \"FRD\", \"RFU\" or \"FLU\" and imu = \"rates\" or \
         \"increments\"; known keys: {}",
        KNOWN_KEYS.join(", ")
    );
    LogError::toml(path, text, error, &cause)
}

fn unread_keys(path: &Path, document: &toml::Table) -> Vec<LogError> {
    let log = document.get("log").and_then(toml::Value::as_table);
    let unknown = |key: &&String| !KNOWN_KEYS.contains(&key.as_str());
    log.into_iter()
        .flat_map(|table| table.keys().filter(unknown))
        .map(|key| {
            let known = format!("one of the keys {}", KNOWN_KEYS.join(", "));
            LogError::file(
                path,
                known,
                format!("`{key}`"),
                "not read; harmless if meant so",
            )
            .in_column(key)
        })
        .collect()
}
