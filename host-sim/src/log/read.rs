//! Reading a log folder.

use std::path::{Path, PathBuf};

use ins_core::attitude::{Euler, from_euler};
use ins_core::earth::{Geodetic, LatLon};
use ins_core::{BaroHeight, FixSigma, GnssFix, ImuSample, Solution};
use nalgebra::{Vector2, Vector3};

use super::Log;
use super::barometer;
use super::check::check;
use super::error::LogError;
use super::meta::{BodyAxes, Meta};
use super::order::{MAX_LEFT_OUT, outside_samples, rows};
use super::samples::{Samples, Store};
use super::table::{Row, Table};
use crate::statistics::rms_of_any;

/// Reads and checks a log. Suspicious data give warnings, impossible data an error.
pub fn read(folder: &Path) -> Result<(Log, Vec<LogError>), LogError> {
    const FOLDER: &str = "a log is a folder with imu.csv, gnss.csv and meta.toml";
    if !folder.exists() {
        let (expected, found) = ("a log or a recording", "nothing of this name");
        let cause = "a wrong or misspelt path";
        return Err(LogError::file(folder, expected, found, cause));
    }
    if !folder.is_dir() {
        return Err(LogError::file(folder, "a folder", "a file", FOLDER));
    }
    if !folder.join("meta.toml").exists() && find_table(folder, "imu.csv")?.is_none() {
        let found = "neither meta.toml nor imu.csv";
        return Err(LogError::file(folder, "a log", found, FOLDER));
    }
    let mut warnings = Vec::new();
    let meta = Meta::read(&folder.join("meta.toml"), &mut warnings)?;
    let table = |name: &str| {
        find_table(folder, name)?.ok_or_else(|| {
            let (expected, cause) = (
                format!("{name} or {name}.gz"),
                "a wrong folder or a misspelt name",
            );
            LogError::file(folder, expected, "neither", cause)
        })
    };
    let (imu, gnss) = (table("imu.csv")?, table("gnss.csv")?);
    let [baro, truth] = [
        find_table(folder, "baro.csv")?,
        find_table(folder, "truth.csv")?,
    ];
    let mut log = Log {
        imu: read_imu(&imu, meta.body_axes, &mut warnings)?,
        gnss: read_gnss(&gnss, &mut warnings)?,
        baro: match &baro {
            Some(baro) => read_baro(baro, &mut warnings)?,
            None => Vec::new(),
        },
        truth: match &truth {
            Some(truth) => read_truth(truth, &mut warnings)?,
            None => Vec::new(),
        },
        meta,
    };
    check(&mut log, &imu, &gnss, &mut warnings)?;
    if let Some(baro) = &baro {
        barometer::check(&mut log, baro, &mut warnings);
    }
    if let Some(path) = &truth {
        let outside = outside_samples(path, "a reference", &log.truth, |row| row.time, &log);
        warnings.extend(outside);
    }
    Ok((log, warnings))
}

/// The plain or the gzip file, whichever is present.
pub(super) fn find_table(folder: &Path, name: &str) -> Result<Option<PathBuf>, LogError> {
    let (plain, gzip) = (folder.join(name), folder.join(format!("{name}.gz")));
    if plain.is_file() && gzip.is_file() {
        let expected = format!("one of {name} and {name}.gz");
        let cause = "a packed copy was left beside the file: remove the one not meant";
        return Err(LogError::file(folder, expected, "both", cause));
    }
    Ok([plain, gzip].into_iter().find(|path| path.is_file()))
}

fn read_imu(
    path: &Path,
    axes: BodyAxes,
    warnings: &mut Vec<LogError>,
) -> Result<Samples, LogError> {
    let table = Table::open(path)?;
    let gyro = columns(&table, ["gyro_x", "gyro_y", "gyro_z"])?;
    let accel = columns(&table, ["accel_x", "accel_y", "accel_z"])?;
    let time = |sample: &ImuSample| sample.time;
    let store: Store = rows(table, MAX_LEFT_OUT, warnings, time, |row, time| {
        Ok(axes.sample(time, numbers(row, gyro)?, numbers(row, accel)?))
    })?;
    Ok(store.into())
}

const NOT_POSITIVE: &str = "a receiver that knows none, or another quantity";

/// All parts of a fix are optional.
fn read_gnss(path: &Path, warnings: &mut Vec<LogError>) -> Result<Vec<GnssFix>, LogError> {
    let table = Table::open(path)?;
    let present = |names: &[&str]| -> Vec<usize> {
        let columns = names.iter().map(|name| table.optional_column(name));
        columns.flatten().collect()
    };
    let both = |names: [&str; 2]| match present(&names).len() {
        0 => Ok(None),
        _ => columns(&table, names).map(Some),
    };
    let (position, velocity) = (both(["lat_deg", "lon_deg"])?, both(["ve", "vn"])?);
    if position.is_none() && velocity.is_none() {
        table.column("lat_deg")?;
    }
    let (height_column, up) = (table.optional_column("h_m"), table.optional_column("vu"));
    let (position_sigma, height_sigma) = (present(&["sd_n", "sd_e"]), present(&["sd_u"]));
    let (velocity_sigma, up_sigma) = (present(&["sd_ve", "sd_vn", "sd_v"]), present(&["sd_vu"]));
    rows(
        table,
        MAX_LEFT_OUT,
        warnings,
        |fix: &GnssFix| fix.time,
        |row, time| {
            let optional = |column: Option<usize>| column.map_or(Ok(None), |at| row.optional(at));
            let both =
                |columns: Option<[usize; 2]>| columns.map_or(Ok(None), |at| both_or_none(row, at));
            Ok(GnssFix {
                time,
                position: match (position, both(position)?) {
                    (Some(columns), Some(cells)) => Some(lat_lon(row, columns, cells)?),
                    _ => None,
                },
                height_m: match (height_column, optional(height_column)?) {
                    (Some(column), Some(height_m)) => Some(height(row, column, height_m)?),
                    _ => None,
                },
                velocity_en_mps: both(velocity)?.map(Vector2::from),
                velocity_up_mps: optional(up)?,
                sigma: FixSigma {
                    position_m: sigma(row, &position_sigma)?,
                    height_m: sigma(row, &height_sigma)?,
                    velocity_mps: sigma(row, &velocity_sigma)?,
                    velocity_up_mps: sigma(row, &up_sigma)?,
                },
            })
        },
    )
}

pub(super) fn read_baro(
    path: &Path,
    warnings: &mut Vec<LogError>,
) -> Result<Vec<BaroHeight>, LogError> {
    let table = Table::open(path)?;
    let column = table.column("h_m")?;
    let sigma_column: Vec<usize> = table.optional_column("sd_h").into_iter().collect();
    rows(
        table,
        MAX_LEFT_OUT,
        warnings,
        |height: &BaroHeight| height.time,
        |row, time| {
            Ok(BaroHeight {
                time,
                height_m: height(row, column, row.number(column)?)?,
                sigma_m: sigma(row, &sigma_column)?.unwrap_or(barometer::SIGMA_M),
            })
        },
    )
}

pub(super) fn read_truth(
    path: &Path,
    warnings: &mut Vec<LogError>,
) -> Result<Vec<Solution>, LogError> {
    let table = Table::open(path)?;
    let position = columns(&table, ["lat_deg", "lon_deg", "h_m"])?;
    let velocity = columns(&table, ["ve", "vn", "vu"])?;
    let angles = columns(&table, ["roll_deg", "pitch_deg", "heading_deg"])?;
    // References have gaps, and a comparison does not need all rows.
    rows(
        table,
        1.0,
        warnings,
        |truth: &Solution| truth.time,
        |row, time| {
            let [roll, pitch, heading] = numbers(row, angles)?.into();
            Ok(Solution {
                time,
                position: geodetic(row, position)?,
                velocity_enu_mps: numbers(row, velocity)?,
                attitude: from_euler(&Euler {
                    roll_rad: roll.to_radians(),
                    pitch_rad: pitch.to_radians(),
                    heading_rad: heading.to_radians(),
                }),
            })
        },
    )
}

fn columns<const N: usize>(table: &Table, names: [&str; N]) -> Result<[usize; N], LogError> {
    let mut found = [0; N];
    for (index, name) in found.iter_mut().zip(names) {
        *index = table.column(name)?;
    }
    Ok(found)
}

fn numbers(row: &Row, columns: [usize; 3]) -> Result<Vector3<f64>, LogError> {
    let [x, y, z] = columns;
    Ok(Vector3::new(row.number(x)?, row.number(y)?, row.number(z)?))
}

/// A pair of cells: both, or none.
fn both_or_none(row: &Row, columns: [usize; 2]) -> Result<Option<[f64; 2]>, LogError> {
    let [first, second] = columns;
    match (row.optional(first)?, row.optional(second)?) {
        (Some(a), Some(b)) => Ok(Some([a, b])),
        (None, None) => Ok(None),
        (present, _) => {
            let column = if present.is_some() { second } else { first };
            let cause = "a position needs latitude and longitude, a velocity east and north: the \
                         other half alone is not used";
            let expected = "a number as in the cell beside";
            row.note_lost(row.defect(column, expected, "an empty cell", cause));
            Ok(None)
        }
    }
}

fn geodetic(row: &Row, columns: [usize; 3]) -> Result<Geodetic, LogError> {
    let [latitude, longitude, up] = columns;
    let cells = numbers(row, columns)?;
    let position = lat_lon(row, [latitude, longitude], [cells.x, cells.y])?;
    Ok(Geodetic {
        latitude_rad: position.latitude_rad,
        longitude_rad: position.longitude_rad,
        height_m: height(row, up, cells.z)?,
    })
}

fn lat_lon(row: &Row, columns: [usize; 2], cells: [f64; 2]) -> Result<LatLon, LogError> {
    let [latitude, longitude] = columns;
    from_degrees(cells.into()).ok_or_else(|| {
        if cells[0].abs() > 90.0 {
            out_of_range(row, latitude, "a latitude from -90 to 90 deg")
        } else {
            out_of_range(row, longitude, "a longitude from -180 to 180 deg")
        }
    })
}

/// A position from degrees, longitudes also from 0 to 360; none if out of range.
pub(super) fn from_degrees((latitude, mut longitude): (f64, f64)) -> Option<LatLon> {
    let possible = latitude.abs() <= 90.0 && longitude.abs() <= 360.0;
    if longitude.abs() > 180.0 {
        longitude -= 360.0_f64.copysign(longitude);
    }
    possible.then(|| LatLon {
        latitude_rad: latitude.to_radians(),
        longitude_rad: longitude.to_radians(),
    })
}

fn height(row: &Row, column: usize, height_m: f64) -> Result<f64, LogError> {
    if height_m.abs() <= 1e5 {
        return Ok(height_m);
    }
    Err(out_of_range(
        row,
        column,
        "a height within 100 km of the ellipsoid",
    ))
}

/// A number out of the range of its quantity.
fn out_of_range(row: &Row, column: usize, expected: &str) -> LogError {
    let cause = "columns swapped, or another unit: 1e-7 deg, ddmm.mm, millimetres";
    row.defect(column, expected, row.cell(column), cause)
}

/// Sigma per component: the root mean square of those stated.
fn sigma(row: &Row, columns: &[usize]) -> Result<Option<f64>, LogError> {
    let not_positive = |column: usize| {
        let expected = "a spread above zero";
        row.note_lost(row.defect(column, expected, row.cell(column), NOT_POSITIVE));
    };
    let mut stated = Vec::new();
    for &column in columns {
        match row.optional(column)? {
            Some(sigma) if sigma > 0.0 => stated.push(sigma),
            Some(_) => not_positive(column),
            None => {}
        }
    }
    Ok(rms_of_any(stated.into_iter()))
}
