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
use super::files::Files;
use super::meta::Meta;
use super::table::{Few, Row, Table};

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
    let mut log = Log {
        imu: read_imu(&files.imu, meta.body_axes, &mut warnings)?,
        gnss: read_gnss(&files.gnss, &mut warnings)?,
        truth: optional_truth(folder, &mut warnings)?,
        meta,
    };
    check(&mut log, &files, &mut warnings)?;
    Ok((log, warnings))
}

/// Checks and mends a log that was read elsewhere.
pub(crate) fn settle(
    log: &mut Log,
    imu: &Path,
    gnss: &Path,
    warnings: &mut Vec<LogError>,
) -> Result<(), LogError> {
    let files = Files {
        imu: imu.to_owned(),
        gnss: gnss.to_owned(),
    };
    check(log, &files, warnings)
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

fn optional_truth(folder: &Path, warnings: &mut Vec<LogError>) -> Result<Vec<Solution>, LogError> {
    let present = ["truth.csv", "truth.csv.gz"]
        .iter()
        .any(|name| folder.join(name).is_file());
    if present {
        read_truth(&one_of(folder, "truth.csv")?, warnings)
    } else {
        Ok(Vec::new())
    }
}

fn read_imu(
    path: &Path,
    axes: BodyAxes,
    warnings: &mut Vec<LogError>,
) -> Result<Vec<ImuSample>, LogError> {
    let table = Table::open(path)?;
    let gyro = columns(&table, ["gyro_x", "gyro_y", "gyro_z"])?;
    let accel = columns(&table, ["accel_x", "accel_y", "accel_z"])?;
    rows(table, MOST_LEFT_OUT, warnings, |row, time| {
        Ok(ImuSample {
            time,
            gyro: axes.to_rfu(numbers(row, gyro)?),
            accel: axes.to_rfu(numbers(row, accel)?),
        })
    })
}

fn read_gnss(path: &Path, warnings: &mut Vec<LogError>) -> Result<Vec<GnssFix>, LogError> {
    let table = Table::open(path)?;
    let parts = FixColumns::find(&table)?;
    rows(table, MOST_LEFT_OUT, warnings, |row, time| {
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
                Some(columns) => both_or_none(row, columns)?.map(Vector2::from),
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

fn read_truth(path: &Path, warnings: &mut Vec<LogError>) -> Result<Vec<Solution>, LogError> {
    let table = Table::open(path)?;
    let position = columns(&table, ["lat_deg", "lon_deg", "h_m"])?;
    let velocity = columns(&table, ["ve", "vn", "vu"])?;
    let angles = columns(&table, ["roll_deg", "pitch_deg", "heading_deg"])?;
    // Reference systems have holes, and a comparison needs no more than the rest.
    rows(table, 1.0, warnings, |row, time| {
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

/// Largest share of rows that may be unusable: a slip of the logger is rare, more is a format that
/// is not understood.
const MOST_LEFT_OUT: f64 = 0.05;

/// Every usable row of a table, in order of time.
fn rows<T: PartialEq>(
    mut table: Table,
    most_left_out: f64,
    warnings: &mut Vec<LogError>,
    mut parse: impl FnMut(&Row, Time) -> Result<T, LogError>,
) -> Result<Vec<T>, LogError> {
    let stamp = table.column("t_s")?;
    let mut order = Order::default();
    let mut unusable = Few::default();
    while let Some(row) = table.next_row()? {
        let parsed = row.and_then(|row| {
            let time = order.time(&row, stamp)?;
            let value = parse(&row, time)?;
            order.take(&row, stamp, time, value);
            Ok(())
        });
        if let Err(defect) = parsed {
            unusable.add(defect);
        }
    }
    let rows = order.rows.len() + unusable.count;
    order.settle();
    // One is a slip even in a short file: the last line, usually.
    let too_many = |few: &Few| few.count > 1 && few.count as f64 > most_left_out * rows as f64;
    if order.rows.is_empty() || too_many(&unusable) {
        return Err(unusable.first.unwrap_or_else(|| table.no_rows()));
    }
    for few in [&mut order.clashes, &mut order.disorder] {
        if too_many(few) {
            return Err(few.first.take().unwrap_or_else(|| table.no_rows()));
        }
    }
    warnings.extend(table.warnings());
    warnings.extend(unusable.warning("left out"));
    Ok(order.in_order(warnings))
}

/// Puts rows into the order of their stamps.
struct Order<T> {
    rows: Vec<(Time, T)>,
    /// Of clocks that begin anew with the week or the day, added so far.
    rollovers: Few,
    added_s: f64,
    repeated: Few,
    clashes: Few,
    disorder: Few,
}

impl<T> Default for Order<T> {
    fn default() -> Self {
        Self {
            rows: Vec::new(),
            rollovers: Few::default(),
            added_s: 0.0,
            repeated: Few::default(),
            clashes: Few::default(),
            disorder: Few::default(),
        }
    }
}

impl<T: PartialEq> Order<T> {
    /// Stamp of a row, after those that came before where the clock has begun anew.
    fn time(&mut self, row: &Row, stamp: usize) -> Result<Time, LogError> {
        let time = time(row, stamp)?;
        let written = time.plus_seconds(self.added_s);
        let Some((last, _)) = self.rows.last() else {
            return Ok(written);
        };
        let (now_s, last_s) = (time.as_seconds(), last.as_seconds() - self.added_s);
        let period_s = PERIODS_S.into_iter().find(|period_s| {
            (0.0..MARGIN_S).contains(&now_s) && (period_s - MARGIN_S..=*period_s).contains(&last_s)
        });
        let Some(period_s) = period_s else {
            return Ok(written);
        };
        let defect = not_increasing(row, stamp, *last, written);
        let cause = "the clock began anew with the GPS week or the day".into();
        self.rollovers.add(LogError { cause, ..defect });
        self.added_s += period_s;
        Ok(time.plus_seconds(self.added_s))
    }

    fn take(&mut self, row: &Row, stamp: usize, time: Time, value: T) {
        match self.rows.last() {
            Some((last, same)) if *last == time && *same == value => {
                self.repeated.add(not_increasing(row, stamp, time, time));
                return;
            }
            Some((last, _)) if *last == time => {
                self.clashes.add(not_increasing(row, stamp, time, time));
                return;
            }
            Some((last, _)) if *last > time => {
                self.disorder.add(not_increasing(row, stamp, *last, time));
            }
            _ => {}
        }
        self.rows.push((time, value));
    }

    /// Leaves out the rows that stand between others of their time.
    fn settle(&mut self) {
        if self.disorder.count == 0 {
            return;
        }
        let before = self.rows.len();
        let mut keep = longest_increasing(&self.rows).into_iter();
        self.rows.retain(|_| keep.next() == Some(true));
        self.disorder.count = before - self.rows.len();
    }

    fn in_order(self, warnings: &mut Vec<LogError>) -> Vec<T> {
        warnings.extend(self.rollovers.warning("its period was added"));
        warnings.extend(self.repeated.warning("left out"));
        warnings.extend(self.clashes.warning("left out"));
        warnings.extend(self.disorder.warning("left out"));
        self.rows.into_iter().map(|(_, value)| value).collect()
    }
}

/// Which rows belong to the longest sequence of increasing stamps.
fn longest_increasing<T>(rows: &[(Time, T)]) -> Vec<bool> {
    // Last rows of the best sequence of each length, and the row before each.
    let mut ends: Vec<usize> = Vec::new();
    let mut before: Vec<Option<usize>> = Vec::with_capacity(rows.len());
    for (index, (time, _)) in rows.iter().enumerate() {
        let length = ends.partition_point(|&end| rows[end].0 < *time);
        before.push(length.checked_sub(1).map(|shorter| ends[shorter]));
        if length == ends.len() {
            ends.push(index);
        } else {
            ends[length] = index;
        }
    }
    let mut keep = vec![false; rows.len()];
    let mut next = ends.last().copied();
    while let Some(index) = next {
        keep[index] = true;
        next = before[index];
    }
    keep
}

/// Periods of clocks that begin anew, s: the GPS week and the day.
const PERIODS_S: [f64; 2] = [604_800.0, 86_400.0];
/// Longest hole at such a moment, s.
const MARGIN_S: f64 = 60.0;

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

/// Two cells that belong together: numbers in both, or nothing.
fn both_or_none(row: &Row, columns: [usize; 2]) -> Result<Option<[f64; 2]>, LogError> {
    let [first, second] = columns;
    match (row.optional(first)?, row.optional(second)?) {
        (Some(a), Some(b)) => Ok(Some([a, b])),
        (None, None) => Ok(None),
        (there, _) => {
            let column = if there.is_some() { second } else { first };
            let cause = "a position needs latitude and longitude, a velocity east and north: the \
                         other half alone is not used";
            let expected = "a number as in the cell beside";
            row.lose(row.defect(column, expected, "an empty cell", cause));
            Ok(None)
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
    both_or_none(row, columns)?
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
