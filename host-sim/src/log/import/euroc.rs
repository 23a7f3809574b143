//! EuRoC (ASL) tables of inertial samples, as Kalibr and VINS take them, with a GNSS file beside.

use std::path::Path;

use ins_core::Time;
use nalgebra::Vector3;

use super::recording::{Imu, Recording};
use super::text::Table;
use crate::log::{BodyAxes, LogError};

/// The format names none; the check of gravity says if they are others.
const AXES: BodyAxes = BodyAxes::Flu;

/// The header names stamp and rates.
pub(super) fn recognised(start: &[u8]) -> bool {
    let text = String::from_utf8_lossy(start);
    let header = text.lines().next().unwrap_or_default();
    header.starts_with("#timestamp") && header.contains("w_RS_S_x")
}

pub(super) fn read(path: &Path) -> Result<Recording, LogError> {
    let table = Table::read(path)?;
    let sample = |row: &Vec<f64>| {
        let vector = |at: usize| {
            let vector: &[f64; 3] = row.get(at..)?.first_chunk()?;
            Some(Vector3::from(*vector))
        };
        let (gyro, accel) = (vector(1)?, vector(4)?);
        let finite = gyro.iter().chain(&accel).all(|x| x.is_finite());
        let time = Time::from_seconds(1e-9 * row.first()?)?;
        finite.then(|| AXES.sample(time, gyro, accel))
    };
    let samples = table.rows.iter().filter_map(sample).collect();
    let imu = Imu::of_rates(path, "EuRoC", AXES, samples);
    Ok(Recording::of(vec![imu], Vec::new()))
}
