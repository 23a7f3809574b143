//! KITTI raw drives: a folder `oxts` with stamps and a text of numbers for each moment; forward,
//! left, up. Position and velocity are the OXTS unit's own solution, not those of a receiver.

use std::fs;
use std::path::Path;

use ins_core::{GnssFix, Time};
use nalgebra::{Vector2, Vector3};

use super::recording::{Imu, Receiver, Recording, degrees, stated, unreadable};
use super::text::{content, number};
use crate::log::{BodyAxes, LogError};

pub(super) fn recognised(path: &Path, _: &[u8]) -> bool {
    path.join("oxts/timestamps.txt").is_file()
}

pub(super) fn read(path: &Path) -> Result<Recording, LogError> {
    let folder = path.join("oxts");
    let stamps = content(&folder.join("timestamps.txt"))?;
    let data = folder.join("data");
    let entries = fs::read_dir(&data).map_err(|e| unreadable(&data, &e))?;
    let mut files: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
    files.sort();
    let (mut samples, mut fixes) = (Vec::new(), Vec::new());
    for (stamp, file) in stamps.lines().zip(&files) {
        let cells: Vec<f64> = content(file)?.split_whitespace().map(number).collect();
        let (Some(time), Some(cells)) = (time(stamp), cells.first_chunk::<25>()) else {
            continue;
        };
        let vector = |at: usize| Vector3::new(cells[at], cells[at + 1], cells[at + 2]);
        samples.push(BodyAxes::Flu.sample(time, vector(17), vector(11)));
        fixes.push(GnssFix {
            time,
            position: degrees((cells[0], cells[1])),
            height_m: Some(cells[2]),
            velocity_en_mps: Some(Vector2::new(cells[7], cells[6])),
            velocity_up_mps: Some(cells[10]),
            sigma: stated([Some(cells[23]), None, Some(cells[24]), None]),
        });
    }
    let imu = Imu::of_rates(&folder, "OXTS", BodyAxes::Flu, samples);
    let receiver = Receiver::new(&folder, "OXTS", fixes);
    Ok(Recording::of(vec![imu], vec![receiver]))
}

/// `2011-09-26 13:02:25.964389445`, s since 1970.
fn time(stamp: &str) -> Option<Time> {
    let stamp = chrono::NaiveDateTime::parse_from_str(stamp.trim(), "%Y-%m-%d %H:%M:%S%.f").ok()?;
    Some(Time::from_micros(stamp.and_utc().timestamp_micros()))
}
