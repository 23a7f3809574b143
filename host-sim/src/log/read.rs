//! Reading a log folder.

use std::path::{Path, PathBuf};

use ins_core::attitude::{Euler, from_euler};
use ins_core::earth::{Geodetic, LatLon};
use ins_core::{FixSigma, GnssFix, ImuSample, Solution, Time};
use nalgebra::{Vector2, Vector3};

use super::Log;
use super::axes::BodyAxes;
use super::check::check;
use super::error::LogError;
use super::meta::Meta;
use super::table::{Row, Table};

/// Reads and checks a log. Warnings say what looks suspicious, an error what cannot be meant.
pub fn read(folder: &Path) -> Result<(Log, Vec<LogError>), LogError> {
    if !folder.is_dir() {
        let cause = "a log is a folder with imu.csv, gnss.csv and meta.toml";
        let found = if folder.exists() {
            "a file"
        } else {
            "nothing of this name"
        };
        return Err(LogError::file(folder, "a folder", found, cause));
    }
    let mut warnings = Vec::new();
    let meta = Meta::read(&folder.join("meta.toml"), &mut warnings)?;
    let files = Files {
        imu: one_of(folder, "imu.csv")?,
        gnss: one_of(folder, "gnss.csv")?,
    };
    let log = Log {
        imu: read_imu(&files.imu, meta.body_axes)?,
        gnss: read_gnss(&files.gnss)?,
        truth: optional_truth(folder)?,
        meta,
    };
    check(&log, &files, &mut warnings)?;
    Ok((log, warnings))
}

/// Where the tables came from, for messages.
pub(super) struct Files {
    pub(super) imu: PathBuf,
    pub(super) gnss: PathBuf,
}

/// The plain or the packed file, whichever is there.
fn one_of(folder: &Path, name: &str) -> Result<PathBuf, LogError> {
    let (plain, packed) = (folder.join(name), folder.join(format!("{name}.gz")));
    match (plain.is_file(), packed.is_file()) {
        (true, true) => Err(LogError::file(
            folder,
            format!("one of {name} and {name}.gz"),
            "both",
            "a packed copy was left beside the file: remove the one not meant",
        )),
        (false, false) => Err(LogError::file(
            folder,
            format!("{name} or {name}.gz"),
            "neither",
            "a wrong folder or a misspelt name",
        )),
        (false, true) => Ok(packed),
        (true, false) => Ok(plain),
    }
}

fn optional_truth(folder: &Path) -> Result<Vec<Solution>, LogError> {
    let present = ["truth.csv", "truth.csv.gz"]
        .iter()
        .any(|name| folder.join(name).is_file());
    if present {
        read_truth(&one_of(folder, "truth.csv")?)
    } else {
        Ok(Vec::new())
    }
}

fn read_imu(path: &Path, axes: BodyAxes) -> Result<Vec<ImuSample>, LogError> {
    let table = Table::open(path)?;
    let gyro = columns(&table, ["gyro_x", "gyro_y", "gyro_z"])?;
    let accel = columns(&table, ["accel_x", "accel_y", "accel_z"])?;
    rows(table, path, |row, time| {
        Ok(ImuSample {
            time,
            gyro: axes.to_rfu(numbers(row, gyro)?),
            accel: axes.to_rfu(numbers(row, accel)?),
        })
    })
}

fn read_gnss(path: &Path) -> Result<Vec<GnssFix>, LogError> {
    let table = Table::open(path)?;
    let parts = FixColumns::find(&table)?;
    rows(table, path, |row, time| {
        let cell = |column: Option<usize>| column.map_or(Ok(None), |c| row.optional(c));
        Ok(GnssFix {
            time,
            position: match parts.position {
                Some(columns) => lat_lon(row, columns)?,
                None => None,
            },
            height_m: match parts.height {
                Some(column) => row
                    .optional(column)?
                    .map(|h| height(row, column, h))
                    .transpose()?,
                None => None,
            },
            velocity_en_mps: match parts.velocity {
                Some(columns) => all_or_none(row, columns)?.map(Vector2::from),
                None => None,
            },
            velocity_up_mps: cell(parts.up)?,
            sigma: FixSigma {
                position_m: sigma(row, &parts.position_sigma)?,
                height_m: sigma(row, &parts.height_sigma)?,
                velocity_mps: sigma(row, &parts.velocity_sigma)?,
                velocity_up_mps: sigma(row, &parts.up_sigma)?,
            },
        })
    })
}

/// Where the parts of a fix stand; a receiver need not have all of them.
struct FixColumns {
    position: Option<[usize; 2]>,
    height: Option<usize>,
    velocity: Option<[usize; 2]>,
    up: Option<usize>,
    position_sigma: Vec<usize>,
    height_sigma: Vec<usize>,
    velocity_sigma: Vec<usize>,
    up_sigma: Vec<usize>,
}

impl FixColumns {
    fn find(table: &Table) -> Result<Self, LogError> {
        let there = |names: &[&str]| -> Vec<usize> {
            let columns = names.iter().map(|name| table.optional_column(name));
            columns.flatten().collect()
        };
        let both = |names: [&str; 2]| match there(&names).len() {
            0 => Ok(None),
            _ => columns(table, names).map(Some),
        };
        let (position, velocity) = (both(["lat_deg", "lon_deg"])?, both(["ve", "vn"])?);
        if position.is_none() && velocity.is_none() {
            table.column("lat_deg")?;
        }
        Ok(Self {
            position,
            height: table.optional_column("h_m"),
            velocity,
            up: table.optional_column("vu"),
            position_sigma: there(&["sd_n", "sd_e"]),
            height_sigma: there(&["sd_u"]),
            velocity_sigma: there(&["sd_ve", "sd_vn", "sd_v"]),
            up_sigma: there(&["sd_vu"]),
        })
    }
}

fn read_truth(path: &Path) -> Result<Vec<Solution>, LogError> {
    let table = Table::open(path)?;
    let position = columns(&table, ["lat_deg", "lon_deg", "h_m"])?;
    let velocity = columns(&table, ["ve", "vn", "vu"])?;
    let angles = columns(&table, ["roll_deg", "pitch_deg", "heading_deg"])?;
    rows(table, path, |row, time| {
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
    })
}

/// Every row of a table, with its stamp, which has to increase.
fn rows<T>(
    mut table: Table,
    path: &Path,
    mut parse: impl FnMut(&Row, Time) -> Result<T, LogError>,
) -> Result<Vec<T>, LogError> {
    let stamp = table.column("t_s")?;
    let mut parsed = Vec::new();
    let mut last: Option<Time> = None;
    while let Some(row) = table.next_row()? {
        let time = time(&row, stamp)?;
        if let Some(last) = last.filter(|&last| time <= last) {
            return Err(not_increasing(&row, stamp, last, time));
        }
        last = Some(time);
        parsed.push(parse(&row, time)?);
    }
    if parsed.is_empty() {
        let cause = "the logger stopped at the header";
        return Err(LogError::file(path, "rows under the header", "none", cause));
    }
    Ok(parsed)
}

fn not_increasing(row: &Row, column: usize, last: Time, time: Time) -> LogError {
    let cause = if time == last {
        "a sample written twice, or stamps of too few digits"
    } else {
        "rows out of order, two logs joined, or a clock that was set back"
    };
    let expected = format!("a time after {} s, that of the row before", decimal(last));
    row.defect(column, &expected, &format!("{} s", decimal(time)), cause)
}

fn time(row: &Row, column: usize) -> Result<Time, LogError> {
    let seconds = row.number(column)?;
    exact_micros(row.cell(column))
        .map(Time::from_micros)
        .or_else(|| Time::from_seconds(seconds))
        .ok_or_else(|| {
            let cause = "another unit: nanoseconds, say";
            row.defect(column, "seconds within 1e12", row.cell(column), cause)
        })
}

/// Microseconds of a plain decimal, exactly: f64 loses the last one after some decades.
fn exact_micros(text: &str) -> Option<i64> {
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let negative = whole.starts_with('-');
    let digits = |s: &str| s.len() <= 12 && s.bytes().all(|b| b.is_ascii_digit());
    let whole = whole.strip_prefix('-').unwrap_or(whole);
    // Finer fractions need rounding: left to `Time::from_seconds`.
    if whole.is_empty() || !digits(whole) || !digits(fraction) || fraction.len() > 6 {
        return None;
    }
    let micros: i64 = format!("{whole}{fraction:0<6}").parse().ok()?;
    Some(if negative { -micros } else { micros })
}

/// Seconds with all six decimals.
pub(super) fn decimal(time: Time) -> String {
    let micros = time.as_micros();
    let (whole, fraction) = (
        micros.unsigned_abs() / 1_000_000,
        micros.unsigned_abs() % 1_000_000,
    );
    format!("{}{whole}.{fraction:06}", if micros < 0 { "-" } else { "" })
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

/// Cells that belong together: numbers in all of them, or in none.
fn all_or_none<const N: usize>(
    row: &Row,
    columns: [usize; N],
) -> Result<Option<[f64; N]>, LogError> {
    let mut values = [0.0; N];
    let mut empty = None;
    for (value, &column) in values.iter_mut().zip(&columns) {
        match row.optional(column)? {
            Some(number) => *value = number,
            None => empty = Some(column),
        }
    }
    match empty {
        None => Ok(Some(values)),
        Some(_) if columns.iter().all(|&column| row.cell(column).is_empty()) => Ok(None),
        Some(column) => {
            let cause = "a position needs latitude and longitude, a velocity east and north: \
                         fill both or leave both empty";
            Err(row.defect(
                column,
                "a number as in the cell beside",
                "an empty cell",
                cause,
            ))
        }
    }
}

fn geodetic(row: &Row, columns: [usize; 3]) -> Result<Geodetic, LogError> {
    let [latitude, longitude, up] = columns;
    let cells = numbers(row, columns)?;
    let LatLon {
        latitude_rad,
        longitude_rad,
    } = on_earth(row, [latitude, longitude], [cells.x, cells.y])?;
    Ok(Geodetic {
        latitude_rad,
        longitude_rad,
        height_m: height(row, up, cells.z)?,
    })
}

fn lat_lon(row: &Row, columns: [usize; 2]) -> Result<Option<LatLon>, LogError> {
    all_or_none(row, columns)?
        .map(|cells| on_earth(row, columns, cells))
        .transpose()
}

fn on_earth(row: &Row, columns: [usize; 2], cells: [f64; 2]) -> Result<LatLon, LogError> {
    let [latitude, longitude] = cells;
    if latitude.abs() > 90.0 {
        return Err(out_of_range(
            row,
            columns[0],
            "a latitude from -90 to 90 deg",
        ));
    }
    if longitude.abs() > 360.0 {
        return Err(out_of_range(
            row,
            columns[1],
            "a longitude from -180 to 180 deg",
        ));
    }
    Ok(LatLon {
        latitude_rad: latitude.to_radians(),
        longitude_rad: if longitude.abs() > 180.0 {
            (longitude - 360.0_f64.copysign(longitude)).to_radians()
        } else {
            longitude.to_radians()
        },
    })
}

fn height(row: &Row, column: usize, height_m: f64) -> Result<f64, LogError> {
    if height_m.abs() > 1e5 {
        return Err(out_of_range(
            row,
            column,
            "a height within 100 km of the ellipsoid",
        ));
    }
    Ok(height_m)
}

fn out_of_range(row: &Row, column: usize, expected: &str) -> LogError {
    let cause = "columns swapped, or another unit: 1e-7 deg, millimetres";
    row.defect(column, expected, row.cell(column), cause)
}

/// One sigma of a component: the root mean square of those stated.
fn sigma(row: &Row, columns: &[usize]) -> Result<Option<f64>, LogError> {
    let mut sum = 0.0;
    let mut count = 0;
    for &column in columns {
        if let Some(sigma) = row.optional(column)?.filter(|&sigma| sigma > 0.0) {
            sum += sigma * sigma;
            count += 1;
        }
    }
    Ok((count > 0).then(|| (sum / f64::from(count)).sqrt()))
}
