//! Any tables, by names of their columns in meta.toml:
//!
//! ```toml
//! [log]
//! body_axes = "FLU"
//! imu = "rates"
//! [columns.imu]
//! file = "raw.csv"
//! t_s = { column = "stamp", unit = "ms" }
//! gyro_x = { column = "wx", unit = "deg/s" }
//! accel_z = { column = "az", unit = "g", sign = -1 }
//! # ... the names on the left are those of a log's own tables, a text on the right is a name
//! [columns.gnss]
//! file = "gps.txt"
//! t_s = "time"
//! lat_deg = { column = "lat", unit = "1e-7 deg" }
//! speed_mps = { column = "speed", unit = "km/h" } # for ve and vn, with course_deg
//! ```

use std::collections::BTreeMap;
use std::path::Path;

use ins_core::{GnssFix, ImuOutput, Time};
use nalgebra::Vector3;
use serde::Deserialize;

use super::recording::{Recording, degrees, east_north, over_ground, stated};
use super::texts::{Table, content};
use crate::log::meta::Output;
use crate::log::{BodyAxes, LogError};

const META: &str = "meta.toml";

pub(super) fn recognised(path: &Path, _: &[u8]) -> bool {
    let Ok(text) = content(&path.join(META)) else {
        return false;
    };
    toml::from_str::<toml::Table>(&text).is_ok_and(|document| document.contains_key("columns"))
}

#[derive(Deserialize)]
struct Document {
    log: About,
    columns: Tables,
}

#[derive(Deserialize)]
struct About {
    body_axes: BodyAxes,
    #[serde(with = "Output")]
    imu: ImuOutput,
}

#[derive(Deserialize)]
struct Tables {
    imu: TableColumns,
    gnss: TableColumns,
}

#[derive(Deserialize)]
struct TableColumns {
    file: String,
    #[serde(flatten)]
    columns: BTreeMap<String, Source>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Source {
    Name(String),
    Scaled {
        column: String,
        unit: Option<String>,
        sign: Option<f64>,
    },
}

/// What one of a unit is in the log's own.
const UNITS: [(&str, f64); 24] = [
    ("s", 1.0),
    ("ms", 1e-3),
    ("us", 1e-6),
    ("ns", 1e-9),
    ("min", 60.0),
    ("rad/s", 1.0),
    ("deg/s", 0.017_453_292_519_943_295),
    ("mdeg/s", 1.745_329_251_994_329_5e-5),
    ("deg/h", 4.848_136_811_095_36e-6),
    ("rad", 1.0),
    ("m/s^2", 1.0),
    ("g", 9.806_65),
    ("mg", 9.806_65e-3),
    ("m/s", 1.0),
    ("cm/s", 1e-2),
    ("mm/s", 1e-3),
    ("km/h", 1.0 / 3.6),
    ("kn", 1852.0 / 3600.0),
    ("deg", 1.0),
    ("1e-7 deg", 1e-7),
    ("m", 1.0),
    ("cm", 1e-2),
    ("mm", 1e-3),
    ("ft", 0.3048),
];

pub(super) fn read(folder: &Path) -> Result<Recording, LogError> {
    let path = folder.join(META);
    let text = content(&path)?;
    let cause = "[columns.imu] and [columns.gnss] need file = \"...\", and names of columns, or \
                 { column = \"...\", unit = \"...\", sign = -1 }";
    let document: Document =
        toml::from_str(&text).map_err(|e| LogError::toml(&path, &text, &e, cause))?;
    let axes = document.log.body_axes;
    let imu = Columns::open(folder, &document.columns.imu, &path)?;
    let gnss = Columns::open(folder, &document.columns.gnss, &path)?;
    let [gyro, accel] = [
        ["gyro_x", "gyro_y", "gyro_z"],
        ["accel_x", "accel_y", "accel_z"],
    ];
    imu.require(&[&["t_s"], &gyro[..], &accel].concat(), &path)?;
    gnss.require(&["t_s"], &path)?;
    let sample = |row: &Vec<f64>| {
        let vector = |names: [&str; 3]| {
            let [x, y, z] = names.map(|name| imu.cell(row, name));
            Some(Vector3::new(x?, y?, z?))
        };
        let time = Time::from_seconds(imu.cell(row, "t_s")?)?;
        Some(axes.sample(time, vector(gyro)?, vector(accel)?))
    };
    let samples = imu.table.rows.iter().filter_map(sample).collect();
    let file = &document.columns.imu.file;
    let mut recording = Recording::default();
    recording.add_imu(&folder.join(file), file, axes, samples);
    recording.imus[0].output = document.log.imu;
    let rows = gnss.table.rows.iter();
    let fixes = rows.filter_map(|row| fix(&gnss, row)).collect();
    let file = &document.columns.gnss.file;
    recording.add_receiver(&folder.join(file), file, fixes);
    Ok(recording)
}

fn fix(gnss: &Columns, row: &[f64]) -> Option<GnssFix> {
    let cell = |name: &str| gnss.cell(row, name);
    let level = cell("ve").zip(cell("vn")).map(east_north);
    let ground = cell("speed_mps").zip(cell("course_deg"));
    Some(GnssFix {
        time: Time::from_seconds(cell("t_s")?)?,
        position: cell("lat_deg").zip(cell("lon_deg")).and_then(degrees),
        height_m: cell("h_m"),
        velocity_en_mps: level.or_else(|| ground.map(over_ground)),
        velocity_up_mps: cell("vu"),
        sigma: stated(["sd_n", "sd_u", "sd_v", "sd_vu"].map(cell)),
    })
}

/// A table, and where the log's own columns stand in it with what they are multiplied by.
struct Columns {
    table: Table,
    of: BTreeMap<String, (usize, f64)>,
}

impl Columns {
    fn open(folder: &Path, columns: &TableColumns, meta: &Path) -> Result<Self, LogError> {
        let path = folder.join(&columns.file);
        let table = Table::read(&path)?;
        let mut of = BTreeMap::new();
        for (name, source) in &columns.columns {
            let (column, unit, sign) = match source {
                Source::Name(column) => (column, None, 1.0),
                Source::Scaled { column, unit, sign } => {
                    (column, unit.as_deref(), sign.unwrap_or(1.0))
                }
            };
            let scale = match unit {
                None => 1.0,
                Some(unit) => factor(unit).ok_or_else(|| unknown_unit(unit, name, meta))?,
            };
            of.insert(name.clone(), (table.required(column, &path)?, sign * scale));
        }
        Ok(Self { table, of })
    }

    fn require(&self, names: &[&str], meta: &Path) -> Result<(), LogError> {
        match names.iter().find(|name| !self.of.contains_key(**name)) {
            None => Ok(()),
            Some(name) => {
                let cause = "say which column of the file it is";
                let expected = format!("a key `{name}`");
                Err(LogError::file(meta, expected, "none", cause))
            }
        }
    }

    fn cell(&self, row: &[f64], name: &str) -> Option<f64> {
        let (index, scale) = self.of.get(name)?;
        row.get(*index)
            .map(|value| scale * value)
            .filter(|value| value.is_finite())
    }
}

fn factor(unit: &str) -> Option<f64> {
    UNITS
        .iter()
        .find(|(name, _)| *name == unit)
        .map(|(_, factor)| *factor)
}

fn unknown_unit(unit: &str, name: &str, meta: &Path) -> LogError {
    let units: Vec<&str> = UNITS.iter().map(|(name, _)| *name).collect();
    let cause = format!("known units: {}", units.join(", "));
    LogError::file(meta, format!("a unit of `{name}`"), unit, cause)
}
