//! Any tables, whose columns are named in meta.toml:
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
//! # ... the keys are the columns of a log's own tables, a string is the name of a column
//! [columns.gnss]
//! file = "gps.txt"
//! t_s = "time"
//! lat_deg = { column = "lat", unit = "1e-7 deg" }
//! speed_mps = { column = "speed", unit = "km/h" } # for ve and vn, with course_deg
//! ```
//!
//! `baro.csv` and `truth.csv` beside it are those of a log.

use std::collections::BTreeMap;
use std::path::Path;

use ins_core::{GnssFix, ImuOutput, Time};
use nalgebra::Vector3;
use serde::Deserialize;

use super::recording::{Recording, east_north, fix_sigma, from_course, from_degrees};
use super::texts::{Table, content};
use crate::log::read::{find_table, read_baro, read_truth};
use crate::log::{LogError, Meta};
use crate::statistics::rms_of_any;

const META: &str = "meta.toml";

pub(super) fn recognised(path: &Path, _: &[u8]) -> bool {
    let Ok(text) = content(&path.join(META)) else {
        return false;
    };
    toml::from_str::<toml::Table>(&text).is_ok_and(|document| document.contains_key("columns"))
}

#[derive(Deserialize)]
struct Document {
    columns: Tables,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
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
#[serde(untagged, deny_unknown_fields)]
enum Source {
    Name(String),
    Scaled {
        column: String,
        unit: Option<String>,
        sign: Option<f64>,
    },
}

/// Units, and their factors to the units of a log.
type Units = &'static [(&'static str, f64)];

const TIME: Units = &[
    ("s", 1.0),
    ("ms", 1e-3),
    ("us", 1e-6),
    ("ns", 1e-9),
    ("min", 60.0),
];
const RATE: Units = &[
    ("rad/s", 1.0),
    ("deg/s", 0.017_453_292_519_943_295),
    ("mdeg/s", 1.745_329_251_994_329_5e-5),
    ("deg/h", 4.848_136_811_095_36e-6),
];
const ROTATION: Units = &[("rad", 1.0), ("deg", 0.017_453_292_519_943_295)];
const FORCE: Units = &[("m/s^2", 1.0), ("g", 9.806_65), ("mg", 9.806_65e-3)];
const SPEED: Units = &[
    ("m/s", 1.0),
    ("cm/s", 1e-2),
    ("mm/s", 1e-3),
    ("km/h", 1.0 / 3.6),
    ("kn", 1852.0 / 3600.0),
];
const ANGLE: Units = &[
    ("deg", 1.0),
    ("1e-7 deg", 1e-7),
    ("rad", 57.295_779_513_082_32),
];
const LENGTH: Units = &[("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("ft", 0.3048)];

const GYRO: [&str; 3] = ["gyro_x", "gyro_y", "gyro_z"];
const ACCEL: [&str; 3] = ["accel_x", "accel_y", "accel_z"];
const GNSS: [(&str, Units); 16] = [
    ("t_s", TIME),
    ("lat_deg", ANGLE),
    ("lon_deg", ANGLE),
    ("h_m", LENGTH),
    ("ve", SPEED),
    ("vn", SPEED),
    ("vu", SPEED),
    ("speed_mps", SPEED),
    ("course_deg", ANGLE),
    ("sd_n", LENGTH),
    ("sd_e", LENGTH),
    ("sd_u", LENGTH),
    ("sd_ve", SPEED),
    ("sd_vn", SPEED),
    ("sd_v", SPEED),
    ("sd_vu", SPEED),
];

/// Columns of the inertial table; increments are of angle and velocity.
fn inertial(output: ImuOutput) -> Vec<(&'static str, Units)> {
    let (gyro, accel) = match output {
        ImuOutput::Rates => (RATE, FORCE),
        ImuOutput::Increments => (ROTATION, SPEED),
    };
    let gyro = GYRO.map(|name| (name, gyro));
    let accel = ACCEL.map(|name| (name, accel));
    [("t_s", TIME)]
        .into_iter()
        .chain(gyro)
        .chain(accel)
        .collect()
}

pub(super) fn read(folder: &Path) -> Result<Recording, LogError> {
    let path = folder.join(META);
    let text = content(&path)?;
    let cause = "[columns.imu] and [columns.gnss] need file = \"...\", and names of columns, or \
                 { column = \"...\", unit = \"...\", sign = -1 }";
    let document: Document =
        toml::from_str(&text).map_err(|e| LogError::toml(&path, &text, &e, cause))?;
    let mut recording = Recording::default();
    let mut meta = Meta::read(&path, &mut recording.notes)?;
    // The converted log has standard columns.
    meta.document.remove("columns");
    let axes = meta.body_axes;
    let imu = Columns::open(folder, &document.columns.imu, &inertial(meta.imu), &path)?;
    let gnss = Columns::open(folder, &document.columns.gnss, &GNSS, &path)?;
    imu.require(&[&["t_s"], &GYRO[..], &ACCEL].concat(), &path)?;
    gnss.require(&["t_s"], &path)?;
    for pair in [
        ["lat_deg", "lon_deg"],
        ["ve", "vn"],
        ["speed_mps", "course_deg"],
    ] {
        if pair.iter().any(|name| gnss.columns.contains_key(*name)) {
            gnss.require(&pair, &path)?;
        }
    }
    let sample = |row: &[f64]| {
        let vector = |names: [&str; 3]| {
            let [x, y, z] = names.map(|name| imu.cell(row, name));
            Some(Vector3::new(x?, y?, z?))
        };
        let time = Time::from_seconds(imu.cell(row, "t_s")?)?;
        Some(axes.sample(time, vector(GYRO)?, vector(ACCEL)?))
    };
    let file = &document.columns.imu.file;
    let path = folder.join(file);
    let samples = imu.table.parsed(sample, &path, &mut recording.notes)?;
    recording.add_imu(&path, file, axes, samples);
    recording.imus[0].output = meta.imu;
    recording.meta = Some(meta);
    let file = &document.columns.gnss.file;
    let path = folder.join(file);
    let fixes = gnss
        .table
        .parsed(|row| fix(&gnss, row), &path, &mut recording.notes)?;
    recording.add_receiver(&path, file, fixes);
    let notes = &mut recording.notes;
    if let Some(baro) = find_table(folder, "baro.csv")? {
        recording.baro = read_baro(&baro, notes)?;
    }
    if let Some(truth) = find_table(folder, "truth.csv")? {
        recording.truth = read_truth(&truth, notes)?;
    }
    Ok(recording)
}

fn fix(gnss: &Columns, row: &[f64]) -> Option<GnssFix> {
    let cell = |name: &str| gnss.cell(row, name);
    // As for a log's own columns: the root mean square of those stated.
    let sigma = |names: &[&str]| {
        let stated = names.iter().filter_map(|name| cell(name));
        rms_of_any(stated.filter(|sigma| *sigma > 0.0))
    };
    let velocity = cell("ve").zip(cell("vn")).map(east_north);
    let place = cell("lat_deg").zip(cell("lon_deg"));
    let position = place.and_then(from_degrees);
    if position.is_none() && place.is_some() {
        return None;
    }
    let speed_and_course = cell("speed_mps").zip(cell("course_deg"));
    Some(GnssFix {
        time: Time::from_seconds(cell("t_s")?)?,
        position,
        height_m: cell("h_m"),
        velocity_en_mps: velocity.or_else(|| speed_and_course.map(from_course)),
        velocity_up_mps: cell("vu"),
        sigma: fix_sigma([
            sigma(&["sd_n", "sd_e"]),
            sigma(&["sd_u"]),
            sigma(&["sd_ve", "sd_vn", "sd_v"]),
            sigma(&["sd_vu"]),
        ]),
    })
}

/// A table, with index and factor of each of a log's own columns.
struct Columns {
    table: Table,
    columns: BTreeMap<String, (usize, f64)>,
}

impl Columns {
    fn open(
        folder: &Path,
        named: &TableColumns,
        known: &[(&str, Units)],
        meta: &Path,
    ) -> Result<Self, LogError> {
        let path = folder.join(&named.file);
        let table = Table::read(&path)?;
        let (width, names) = (table.width(), table.names.len());
        // A separator at the end of a row, or of the names, makes no column.
        let ends_empty = table
            .rows
            .iter()
            .all(|row| row.last().is_some_and(|x| x.is_nan()));
        let names = names - usize::from(table.names.last().is_some_and(String::is_empty));
        if names > 0 && width != names && !(ends_empty && width == names + 1) {
            let found = format!("{width} in most rows, and {names} names");
            let cause = "decimal commas in a table separated by commas, or a column without a name";
            return Err(LogError::file(&path, "a name for each cell", found, cause));
        }
        let mut columns: BTreeMap<String, (usize, f64)> = BTreeMap::new();
        for (name, source) in &named.columns {
            let own = known.iter().find(|(own, _)| own == name);
            let (_, units) = own.ok_or_else(|| unknown_name(name, known, meta))?;
            let (column, unit, sign) = match source {
                Source::Name(column) => (column, None, 1.0),
                Source::Scaled { column, unit, sign } => {
                    (column, unit.as_deref(), sign.unwrap_or(1.0))
                }
            };
            if ![1.0, -1.0].contains(&sign) {
                let (expected, found) = (format!("a sign of `{name}`, 1 or -1"), sign.to_string());
                let cause = "a factor is the unit's: say which unit it is";
                return Err(LogError::file(meta, expected, found, cause));
            }
            let scale = match unit {
                None => 1.0,
                Some(unit) => factor(unit, units).ok_or_else(|| {
                    let cause = format!("known units: {}", listed(units));
                    LogError::file(meta, format!("a unit of `{name}`"), unit, cause)
                })?,
            };
            let index = table.required(column, &path).map_err(|defect| LogError {
                cause: "misspelt in [columns] of meta.toml, or another file".into(),
                ..defect
            })?;
            // One spread may be that of several axes.
            let twice = columns.iter().find(|(other, (own, _))| {
                *own == index && !(name.starts_with("sd_") && other.starts_with("sd_"))
            });
            if let Some((other, _)) = twice {
                let found = format!("the column of `{other}`, `{column}`");
                let cause = "copied and not changed";
                let expected = format!("a column of its own for `{name}`");
                return Err(LogError::file(meta, expected, found, cause));
            }
            columns.insert(name.clone(), (index, sign * scale));
        }
        Ok(Self { table, columns })
    }

    fn require(&self, names: &[&str], meta: &Path) -> Result<(), LogError> {
        match names.iter().find(|name| !self.columns.contains_key(**name)) {
            None => Ok(()),
            Some(name) => {
                let cause = "say which column of the file it is";
                let expected = format!("a key `{name}`");
                Err(LogError::file(meta, expected, "none", cause))
            }
        }
    }

    fn cell(&self, row: &[f64], name: &str) -> Option<f64> {
        let (index, scale) = self.columns.get(name)?;
        row.get(*index)
            .map(|value| scale * value)
            .filter(|value| value.is_finite())
    }
}

fn factor(unit: &str, units: Units) -> Option<f64> {
    let own = units.iter().find(|(name, _)| *name == unit);
    own.map(|(_, factor)| *factor)
}

fn unknown_name(name: &str, known: &[(&str, Units)], meta: &Path) -> LogError {
    let expected = format!("one of the columns {}", listed(known));
    let cause = "misspelt, or of the other table: nothing would be read from it";
    LogError::file(meta, expected, format!("`{name}`"), cause)
}

fn listed<T>(named: &[(&str, T)]) -> String {
    let names: Vec<&str> = named.iter().map(|(name, _)| *name).collect();
    names.join(", ")
}
