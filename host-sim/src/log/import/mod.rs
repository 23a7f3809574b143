//! Recordings of other programs: recognised by content, converted to a [`Log`].
//!
//! A module per family of formats returns all inertial sensors and receivers, unmodified.

mod autopilots;
mod columns;
mod receivers;
mod recording;
mod ros;
mod sensor_logger;
mod texts;
mod ubx;

use std::io::Read;
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};

use recording::{Recording, decompressed, unreadable};

use crate::log::{self, Log, LogError};
pub use recording::Choice;

/// Reads a log folder, or a recording of any known format.
pub fn open(path: &Path) -> Result<(Log, Vec<LogError>), LogError> {
    open_all(&[path.to_owned()], Choice::default())
}

pub fn open_all(paths: &[PathBuf], choice: Choice) -> Result<(Log, Vec<LogError>), LogError> {
    match paths {
        [folder] if !folder.is_file() && format(folder)?.is_none() => {
            if choice.imu.or(choice.gnss).is_some() {
                let cause = "--imu and --gnss choose among those of a recording: leave them out";
                let found = "a log folder, which has one of each";
                let expected = "a recording of several sensors or receivers";
                return Err(LogError::file(folder, expected, found, cause));
            }
            log::read(folder)
        }
        _ => read(paths, choice),
    }
}

/// Reads a log from one recording, or from one of inertial sensors and one of GNSS.
pub fn read(paths: &[PathBuf], choice: Choice) -> Result<(Log, Vec<LogError>), LogError> {
    let mut all = Recording::default();
    for path in paths {
        let format = format(path)?.ok_or_else(|| unknown(path))?;
        let recording = recording(path, format)?;
        all.imus.extend(recording.imus);
        all.receivers.extend(recording.receivers);
        if all.baro.is_empty() {
            all.baro = recording.baro;
        }
        if all.truth.is_empty() {
            all.truth = recording.truth;
        }
        all.meta = all.meta.or(recording.meta);
        all.parameters.extend(recording.parameters);
        all.notes.extend(recording.notes);
    }
    let path = paths.first().map_or(Path::new(""), PathBuf::as_path);
    all.log(path, choice)
}

/// Numbers of the inertial sensors of a recording, except the default.
pub(crate) fn other_imus(path: &Path) -> Result<Vec<usize>, LogError> {
    let of_format = |format: &Format| Ok(recording(path, format)?.other_imus());
    format(path)?.map_or(Ok(Vec::new()), of_format)
}

/// Reads a file. External parsers may panic on damaged files, which is made an error of the file.
fn recording(path: &Path, (_, read): &Format) -> Result<Recording, LogError> {
    catch_unwind(|| read(path)).unwrap_or_else(|_| {
        let cause = "a damaged file: copy it again, or repair it with the tools of its format";
        let found = "data on which its parser fails";
        Err(LogError::file(path, "a readable recording", found, cause))
    })
}

/// Recognises a format by path and first bytes of the file; reads a file of it.
type Format = (
    fn(&Path, &[u8]) -> bool,
    fn(&Path) -> Result<Recording, LogError>,
);

/// Unambiguous ones first.
const FORMATS: [Format; 13] = [
    (autopilots::is_ulog, autopilots::read_ulog),
    (autopilots::is_dataflash, autopilots::read_dataflash),
    (ros::is_bag, ros::read_bag),
    (ros::is_mcap, ros::read_mcap),
    (ubx::recognised, ubx::read),
    (columns::recognised, columns::read),
    (sensor_logger::recognised, sensor_logger::read),
    (texts::is_gnss_ins_sim, texts::read_gnss_ins_sim),
    (texts::is_kitti, texts::read_kitti),
    (receivers::is_nmea, receivers::read_nmea),
    (receivers::is_rtklib, receivers::read_rtklib),
    (texts::is_euroc, texts::read_euroc),
    (texts::is_kf_gins, texts::read_kf_gins),
];

/// The format of a file or folder; none for a log folder or something unknown.
fn format(path: &Path) -> Result<Option<&'static Format>, LogError> {
    let mut start = Vec::new();
    if path.is_file() {
        let source = decompressed(path)?.take(64 * 1024).read_to_end(&mut start);
        source.map_err(|e| unreadable(path, &e))?;
    } else if !path.is_dir() {
        return Ok(None);
    }
    let mut formats = FORMATS.iter();
    Ok(formats.find(|(recognised, _)| recognised(path, &start)))
}

fn unknown(path: &Path) -> LogError {
    let is_log = |folder: &Path| folder.join("meta.toml").is_file();
    let cause =
        "for any other table write a meta.toml beside it, with [columns], and give the folder";
    let folder = if path.is_dir() {
        Some(path)
    } else {
        path.parent()
    };
    let tables = folder.filter(|folder| is_log(folder) && !columns::recognised(folder, &[]));
    let missing_table = tables.and_then(missing_table);
    let is_empty = std::fs::metadata(path).is_ok_and(|file| file.is_file() && file.len() == 0);
    let (found, cause) = if !path.exists() {
        ("nothing of this name", "a wrong or misspelt path")
    } else if is_empty {
        (
            "an empty file",
            "the logger never wrote to it, or a copy failed",
        )
    } else if let Some(missing_table) = &missing_table {
        ("part of a log folder", missing_table.as_str())
    } else if is_log(path) {
        (
            "a log folder",
            "a log already, with sensors and receiver: give it alone, to any command but `import`",
        )
    } else if path.parent().is_some_and(is_log) {
        ("a file of a log folder", "give the folder")
    } else {
        ("none of them", cause)
    };
    LogError::file(
        path,
        "PX4 ULog, ArduPilot DataFlash, ROS 1 bag, MCAP, UBX, NMEA, RTKLIB .pos, EuRoC, KF-GINS, or a \
         folder of Sensor Logger, gnss-ins-sim or KITTI",
        found,
        cause,
    )
}

/// The first missing table of a log folder, and the remedy.
fn missing_table(folder: &Path) -> Option<String> {
    let mut tables = ["imu.csv", "gnss.csv"].into_iter();
    let missing = tables.find(|name| matches!(log::read::find_table(folder, name), Ok(None)))?;
    Some(format!(
        "the folder has no {missing}: write it there, with the columns of a log, and give the folder alone"
    ))
}
