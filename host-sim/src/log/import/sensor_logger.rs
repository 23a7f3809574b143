//! Sensor Logger for phones: a folder with a table per sensor. Axes are those of the phone on both operating
//! systems: x to the right, y to the upper edge, z out of the screen.

use std::fs::File;
use std::path::Path;

use ins_core::{GnssFix, Time};
use nalgebra::Vector3;
use tempfile::TempDir;
use zip::ZipArchive;

use super::recording::{
    Recording, Stamped, fix_sigma, from_course, from_degrees, joined, unreadable,
};
use super::texts::Table;
use crate::log::{BodyAxes, LogError};

pub(super) fn recognised(path: &Path, start: &[u8]) -> bool {
    let has_all = |present: &dyn Fn(&str) -> bool| {
        present("Gyroscope.csv")
            && (present("TotalAcceleration.csv") || present("Accelerometer.csv"))
    };
    if start.starts_with(ZIP) {
        return archive(path).is_ok_and(|zip| has_all(&|name| zip.index_for_name(name).is_some()));
    }
    has_all(&|name| path.join(name).is_file())
}

/// First bytes of a ZIP file, in which the program exports its folder.
const ZIP: &[u8] = b"PK\x03\x04";

fn decompressed(path: &Path) -> Result<TempDir, LogError> {
    let folder = tempfile::tempdir().map_err(|e| unreadable(path, &e))?;
    archive(path)?
        .extract(&folder)
        .map_err(|e| unreadable(path, &std::io::Error::other(e)))?;
    Ok(folder)
}

fn archive(path: &Path) -> Result<ZipArchive<File>, LogError> {
    let file = File::open(path).map_err(|e| unreadable(path, &e))?;
    ZipArchive::new(file).map_err(|e| unreadable(path, &std::io::Error::other(e)))
}

pub(super) fn read(path: &Path) -> Result<Recording, LogError> {
    if path.is_dir() {
        return tables(path);
    }
    let mut recording = tables(decompressed(path)?.path())?;
    // The unpacked tables are temporary: messages name the file of the user.
    let imus = recording.imus.iter_mut().map(|imu| &mut imu.path);
    let receivers = recording.receivers.iter_mut().map(|from| &mut from.path);
    (imus.chain(receivers)).for_each(|file| path.clone_into(file));
    for note in &mut recording.notes {
        note.path = path.into();
    }
    Ok(recording)
}

fn tables(path: &Path) -> Result<Recording, LogError> {
    let mut recording = Recording::default();
    let notes = &mut recording.notes;
    let sensor = path.join("Gyroscope.csv");
    let samples = joined(
        &vectors(&sensor, notes)?,
        &force(path, notes)?,
        BodyAxes::Rfu,
    );
    recording.add_imu(&sensor, "phone", BodyAxes::Rfu, samples);
    let location = path.join("Location.csv");
    if location.is_file() {
        let fixes = fixes(&location, &mut recording.notes)?;
        recording.add_receiver(&location, "phone", fixes);
    }
    Ok(recording)
}

/// Specific force, or the sum of motion and gravity as the phone separates them.
fn force(path: &Path, notes: &mut Vec<LogError>) -> Result<Vec<Stamped>, LogError> {
    let total = path.join("TotalAcceleration.csv");
    if total.is_file() {
        return vectors(&total, notes);
    }
    let motion = vectors(&path.join("Accelerometer.csv"), notes)?;
    let gravity = vectors(&path.join("Gravity.csv"), notes)?;
    let parts = joined(&motion, &gravity, BodyAxes::Rfu);
    Ok(parts
        .iter()
        .map(|part| (part.time, part.gyro + part.accel))
        .collect())
}

fn vectors(path: &Path, notes: &mut Vec<LogError>) -> Result<Vec<Stamped>, LogError> {
    let table = Table::read(path)?;
    let column = |name| table.required(name, path);
    let (time, x, y, z) = (column("time")?, column("x")?, column("y")?, column("z")?);
    let read = |row: &[f64]| {
        let vector = Vector3::new(*row.get(x)?, *row.get(y)?, *row.get(z)?);
        let finite = vector.iter().all(|x| x.is_finite());
        finite.then_some((nanoseconds(*row.get(time)?)?, vector))
    };
    let mut rows: Vec<Stamped> = table.parsed(read, path, notes)?;
    // Phones deliver some samples twice or out of order.
    rows.sort_by_key(|row| row.0);
    rows.dedup_by_key(|row| row.0);
    Ok(rows)
}

/// Radius of the 68 % circle, in sigmas per axis: sqrt(-2 ln 0.32).
const RADIUS_68_SIGMAS: f64 = 1.51;

fn fixes(path: &Path, notes: &mut Vec<LogError>) -> Result<Vec<GnssFix>, LogError> {
    let table = Table::read(path)?;
    let column = |name| table.required(name, path);
    let (time, latitude, longitude) = (column("time")?, column("latitude")?, column("longitude")?);
    let read = |row: &[f64]| {
        let cell = |name: &str| {
            let value = table.column(name).and_then(|index| row.get(index)).copied();
            value.filter(|x| x.is_finite())
        };
        // Negative if unknown.
        let speed = cell("speed").filter(|speed| *speed >= 0.0);
        let bearing = cell("bearing").filter(|bearing| *bearing >= 0.0);
        Some(GnssFix {
            time: nanoseconds(*row.get(time)?)?,
            position: from_degrees((*row.get(latitude)?, *row.get(longitude)?)),
            height_m: cell("altitude"),
            velocity_en_mps: speed.zip(bearing).map(from_course),
            velocity_up_mps: None,
            sigma: fix_sigma([
                cell("horizontalAccuracy").map(|radius_m| radius_m / RADIUS_68_SIGMAS),
                cell("verticalAccuracy"),
                cell("speedAccuracy"),
                None,
            ]),
        })
    };
    table.parsed(read, path, notes)
}

fn nanoseconds(time: f64) -> Option<Time> {
    Time::from_seconds(1e-9 * time)
}
