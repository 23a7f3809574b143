//! Tables of numbers of datasets, simulators and other programs: `EuRoC`, KITTI,
//! gnss-ins-sim, KF-GINS.

use std::fs;
use std::path::Path;

use ins_core::{GnssFix, ImuOutput, ImuSample, Time};
use nalgebra::{Vector2, Vector3};

use super::recording::{Recording, bytes, fix_sigma, from_degrees, horizontal_sigma, unreadable};
use crate::log::order::MAX_LEFT_OUT;
use crate::log::{BodyAxes, LogError};

/// Named columns of numbers; NaN where a cell is no number.
pub(super) struct Table {
    pub(super) names: Vec<String>,
    pub(super) rows: Vec<Vec<f64>>,
}

impl Table {
    /// Reads a file; the first line names the columns if it holds a letter.
    pub(super) fn read(path: &Path) -> Result<Self, LogError> {
        let text = content(path)?;
        let lines = text.lines().filter(|line| !line.trim().is_empty());
        let mut lines = lines.peekable();
        let is_text = |line: &&str| cells(line).iter().any(|cell| number(cell).is_nan());
        let is_names = |line: &&str| cells(line).iter().all(|cell| number(cell).is_nan());
        let mut header = lines.next_if(is_text);
        // Above the names there may be comments, and the separator for a spreadsheet.
        while let Some(above) = header
            && (above.starts_with("sep=") || above.starts_with('#'))
            && let Some(names) = lines.next_if(is_names)
        {
            header = Some(names);
        }
        let names = header
            .map(|line| cells(line.trim_start_matches(['#', '%', '\u{feff}'])))
            .unwrap_or_default();
        let row = |line: &str| cells(line).iter().map(|cell| number(cell)).collect();
        Ok(Self {
            names: names.iter().map(|name| (*name).to_owned()).collect(),
            rows: lines.map(row).collect(),
        })
    }

    pub(super) fn column(&self, name: &str) -> Option<usize> {
        let is = |own: &String| own.eq_ignore_ascii_case(name);
        self.names.iter().position(is)
    }

    /// Number of cells in most rows.
    pub(super) fn width(&self) -> usize {
        let mut widths: Vec<usize> = self.rows.iter().map(Vec::len).collect();
        widths.sort_unstable();
        widths.get(widths.len() / 2).copied().unwrap_or_default()
    }

    /// All rows that can be read: see [`Self::each_row`].
    pub(super) fn parsed<T>(
        &self,
        of_row: impl Fn(&[f64]) -> Option<T>,
        path: &Path,
        notes: &mut Vec<LogError>,
    ) -> Result<Vec<T>, LogError> {
        let rows = self.each_row(of_row, path, notes)?;
        Ok(rows.into_iter().flatten().collect())
    }

    /// Each row as read, none where that cannot be, or where it has another number of cells than most: with a
    /// warning, or an error if they are many.
    fn each_row<T>(
        &self,
        of_row: impl Fn(&[f64]) -> Option<T>,
        path: &Path,
        notes: &mut Vec<LogError>,
    ) -> Result<Vec<Option<T>>, LogError> {
        let width = self.width();
        let whole = |row: &&Vec<f64>| row.len() == width;
        let read = |row| Some(row).filter(whole).and_then(|row| of_row(row));
        let rows: Vec<Option<T>> = self.rows.iter().map(read).collect();
        let lost = rows.iter().filter(|row| row.is_none()).count();
        if let Some(first) = rows.iter().position(Option::is_none) {
            let found = format!(
                "others in {lost} of {} rows, first in row {}",
                rows.len(),
                first + 1
            );
            let cause = format!(
                "rows cut off, or with a separator within a cell; text, empty cells or another unit in the \
                 columns that are read, or dates for seconds; left out, at most {} % of the rows",
                100.0 * MAX_LEFT_OUT
            );
            let defect = LogError::file(path, "rows of numbers", found, cause);
            // One never is too many, even in a short file: often the last line.
            if lost > 1 && lost as f64 > MAX_LEFT_OUT * rows.len() as f64 {
                return Err(defect);
            }
            notes.push(defect);
        }
        Ok(rows)
    }

    /// Index of a required column.
    pub(super) fn required(&self, name: &str, path: &Path) -> Result<usize, LogError> {
        self.column(name).ok_or_else(|| {
            let found = format!("columns {}", self.names.join(", "));
            let cause = "another version of the program, or another file";
            LogError::file(path, format!("a column `{name}`"), found, cause)
        })
    }
}

/// Text of any encoding: numbers are ASCII.
pub(super) fn content(path: &Path) -> Result<String, LogError> {
    Ok(String::from_utf8_lossy(&bytes(path)?).into_owned())
}

/// Cells separated by semicolons, tabs or commas, or else by blanks.
fn cells(line: &str) -> Vec<&str> {
    let (whole, line) = (line.trim_start().trim_end_matches([' ', '\r']), line.trim());
    let quotes: &[char] = &['"', ' '];
    let mut separators = [';', '\t', ','].into_iter();
    match separators.find(|separator| line.contains(*separator)) {
        Some(separator) => {
            // Tabs at the end separate empty cells.
            let cells = if separator == '\t' { whole } else { line }.split(separator);
            cells.map(|cell| cell.trim_matches(quotes)).collect()
        }
        None => line.split_whitespace().collect(),
    }
}

/// A comma within a cell is a decimal one.
pub(super) fn number(cell: &str) -> f64 {
    cell.replace(',', ".").parse().unwrap_or(f64::NAN)
}

fn vector(row: &[f64], at: usize) -> Option<Vector3<f64>> {
    let vector: &[f64; 3] = row.get(at..)?.first_chunk()?;
    let finite = vector.iter().all(|x| x.is_finite());
    finite.then(|| Vector3::from(*vector))
}

// --- EuRoC (ASL), as used by Kalibr and VINS: inertial samples; GNSS is in another file ---

/// The format defines none; the check of gravity finds others.
const EUROC_AXES: BodyAxes = BodyAxes::Flu;

/// The header names stamp and rates.
pub(super) fn is_euroc(_: &Path, start: &[u8]) -> bool {
    let text = String::from_utf8_lossy(start);
    let header = text.lines().next().unwrap_or_default();
    header.starts_with("#timestamp") && header.contains("w_RS_S_x")
}

pub(super) fn read_euroc(path: &Path) -> Result<Recording, LogError> {
    let sample = |row: &[f64]| {
        let (gyro, accel) = (vector(row, 1)?, vector(row, 4)?);
        let time = Time::from_seconds(1e-9 * row.first()?)?;
        Some(EUROC_AXES.sample(time, gyro, accel))
    };
    let mut recording = Recording::default();
    let samples = Table::read(path)?.parsed(sample, path, &mut recording.notes)?;
    recording.add_imu(path, "EuRoC", EUROC_AXES, samples);
    Ok(recording)
}

// --- KITTI raw drives: a folder `oxts` with times and a file of numbers per epoch; forward, left, up.
// Position and velocity are the OXTS unit's own solution, not those of a receiver. ---

pub(super) fn is_kitti(path: &Path, _: &[u8]) -> bool {
    path.join("oxts/timestamps.txt").is_file()
}

pub(super) fn read_kitti(path: &Path) -> Result<Recording, LogError> {
    let folder = path.join("oxts");
    let stamps = content(&folder.join("timestamps.txt"))?;
    let data = folder.join("data");
    let entries = fs::read_dir(&data).map_err(|e| unreadable(&data, &e))?;
    let mut files: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
    files.sort();
    let (mut samples, mut fixes) = (Vec::new(), Vec::new());
    let stamps: Vec<&str> = stamps.lines().collect();
    for file in &files {
        // The name is the number of the epoch: some may be missing.
        let epoch = file
            .file_stem()
            .and_then(|stem| stem.to_str()?.parse::<usize>().ok());
        let Some(stamp) = epoch.and_then(|epoch| stamps.get(epoch)) else {
            continue;
        };
        let cells: Vec<f64> = content(file)?.split_whitespace().map(number).collect();
        let time = date_and_time(stamp.trim(), "%Y-%m-%d %H:%M:%S%.f");
        let (Some(time), Some(cells)) = (time, cells.first_chunk::<25>()) else {
            continue;
        };
        let vector = |at: usize| Vector3::new(cells[at], cells[at + 1], cells[at + 2]);
        samples.push(BodyAxes::Flu.sample(time, vector(17), vector(11)));
        fixes.push(GnssFix {
            time,
            position: from_degrees((cells[0], cells[1])),
            height_m: Some(cells[2]),
            velocity_en_mps: Some(Vector2::new(cells[7], cells[6])),
            velocity_up_mps: Some(cells[10]),
            sigma: fix_sigma([Some(cells[23]), None, Some(cells[24]), None]),
        });
    }
    let mut recording = Recording::default();
    recording.add_imu(&folder, "OXTS", BodyAxes::Flu, samples);
    recording.add_receiver(&folder, "OXTS", fixes);
    Ok(recording)
}

/// Time since 1970.
pub(super) fn date_and_time(text: &str, format: &str) -> Option<Time> {
    let time = chrono::NaiveDateTime::parse_from_str(text, format).ok()?;
    Some(Time::from_micros(time.and_utc().timestamp_micros()))
}

// --- gnss-ins-sim: a folder with a table per quantity, units in the headers, forward-right-down ---

pub(super) fn is_gnss_ins_sim(path: &Path, _: &[u8]) -> bool {
    let tables = ["time.csv", "gyro-0.csv", "accel-0.csv"];
    tables.iter().all(|name| path.join(name).is_file())
}

pub(super) fn read_gnss_ins_sim(path: &Path) -> Result<Recording, LogError> {
    let mut recording = Recording::default();
    let clock = path.join("time.csv");
    let times = column(&clock, &mut recording.notes)?;
    // Files are numbered by runs of the simulation.
    for run in 0.. {
        let of = |name: &str| path.join(format!("{name}-{run}.csv"));
        let (gyro, accel, gps) = (of("gyro"), of("accel"), of("gps"));
        if !gyro.is_file() || !accel.is_file() {
            break;
        }
        let notes = &mut recording.notes;
        let rates = in_step(vectors(&gyro, notes)?, &gyro, &times, &clock)?;
        let forces = in_step(vectors(&accel, notes)?, &accel, &times, &clock)?;
        let rows = times.iter().zip(rates).zip(forces);
        let samples = rows.filter_map(|((time, gyro), accel)| {
            Some(BodyAxes::Frd.sample((*time)?, gyro?, accel?))
        });
        let samples = samples.collect();
        let name = format!("run {run}");
        if gps.is_file() {
            let clock = path.join("gps_time.csv");
            let times = column(&clock, notes)?;
            let fixes = Table::read(&gps)?.each_row(simulated_fix, &gps, notes)?;
            let fixes = times.iter().zip(in_step(fixes, &gps, &times, &clock)?);
            let fixes = fixes.filter_map(|(time, fix)| {
                Some(GnssFix {
                    time: (*time)?,
                    ..fix?
                })
            });
            recording.add_receiver(&gps, &name, fixes.collect());
        }
        recording.add_imu(&gyro, &name, BodyAxes::Frd, samples);
    }
    Ok(recording)
}

/// Rows of a table, if it has as many as its stamps: else they would be of other times.
fn in_step<T>(
    rows: Vec<T>,
    path: &Path,
    times: &[Option<Time>],
    clock: &Path,
) -> Result<Vec<T>, LogError> {
    if rows.len() == times.len() {
        return Ok(rows);
    }
    let expected = format!("{} rows as in {}", times.len(), clock.display());
    let cause = "rows are missing from one of the two, or they are of different simulations";
    Err(LogError::file(
        path,
        expected,
        rows.len().to_string(),
        cause,
    ))
}

/// Without its time, which is in another table.
fn simulated_fix(row: &[f64]) -> Option<GnssFix> {
    let [latitude, longitude, height, north, east, down] = *row.first_chunk::<6>()?;
    let finite = row.iter().all(|x| x.is_finite());
    finite.then(|| GnssFix {
        position: from_degrees((latitude, longitude)),
        height_m: Some(height),
        velocity_en_mps: Some(Vector2::new(east, north)),
        velocity_up_mps: Some(-down),
        ..GnssFix::default()
    })
}

fn column(path: &Path, notes: &mut Vec<LogError>) -> Result<Vec<Option<Time>>, LogError> {
    let time = |row: &[f64]| Time::from_seconds(*row.first()?);
    Table::read(path)?.each_row(time, path, notes)
}

/// Rates in rad/s where the header has degrees.
fn vectors(path: &Path, notes: &mut Vec<LogError>) -> Result<Vec<Option<Vector3<f64>>>, LogError> {
    let table = Table::read(path)?;
    let in_degrees = table.names.first().is_some_and(|name| name.contains("deg"));
    let scale = if in_degrees { 1_f64.to_radians() } else { 1.0 };
    table.each_row(|row| vector(row, 0).map(|v| scale * v), path, notes)
}

// --- KF-GINS: GPS seconds of week with increments of angle and velocity, forward-right-down; or with fixes
// and their sigmas ---

/// Seven numbers separated by blanks, or thirteen for fixes with velocity, and no header.
pub(super) fn is_kf_gins(_: &Path, start: &[u8]) -> bool {
    let text = String::from_utf8_lossy(start);
    let mut rows = text.lines().take(3).map(cells);
    let fits = |row: Vec<&str>| {
        let numbers = row.iter().all(|cell| number(cell).is_finite());
        matches!(row.len(), 7 | 13) && numbers && (0.0..604_800.0).contains(&number(row[0]))
    };
    text.lines().nth(2).is_some() && !text.contains(',') && rows.all(fits)
}

pub(super) fn read_kf_gins(path: &Path) -> Result<Recording, LogError> {
    let table = Table::read(path)?;
    let rows = &table.rows;
    // Sigmas are positive, increments of velocity have either sign.
    let is_fix = |row: &Vec<f64>| row.get(4..7).is_some_and(|s| s.iter().all(|x| *x > 0.0));
    let fixes = rows.first().is_some_and(|row| row.len() == 13) || rows.iter().all(is_fix);
    let mut recording = Recording::default();
    let notes = &mut recording.notes;
    if fixes {
        let fixes = table.parsed(kf_gins_fix, path, notes)?;
        recording.add_receiver(path, "KF-GINS", fixes);
    } else {
        let samples = table.parsed(kf_gins_sample, path, notes)?;
        recording.add_imu(path, "KF-GINS", BodyAxes::Frd, samples);
        recording.imus[0].output = ImuOutput::Increments;
    }
    Ok(recording)
}

fn kf_gins_sample(row: &[f64]) -> Option<ImuSample> {
    let time = Time::from_seconds(*row.first()?)?;
    Some(BodyAxes::Frd.sample(time, vector(row, 1)?, vector(row, 4)?))
}

fn kf_gins_fix(row: &[f64]) -> Option<GnssFix> {
    let [time, latitude, longitude, height, north, east, down] = *row.first_chunk::<7>()?;
    let mut fix = GnssFix {
        time: Time::from_seconds(time)?,
        position: from_degrees((latitude, longitude)),
        height_m: Some(height),
        ..GnssFix::default()
    };
    let mut sigmas = [
        Some(horizontal_sigma((north, east))),
        Some(down),
        None,
        None,
    ];
    if let Some([vn, ve, vd, sn, se, sd]) = row.get(7..).and_then(|rest| rest.first_chunk::<6>()) {
        fix.velocity_en_mps = Some(Vector2::new(*ve, *vn));
        fix.velocity_up_mps = Some(-vd);
        [sigmas[2], sigmas[3]] = [Some(horizontal_sigma((*sn, *se))), Some(*sd)];
    }
    fix.sigma = fix_sigma(sigmas);
    Some(fix)
}
