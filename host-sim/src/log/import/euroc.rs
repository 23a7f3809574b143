//! EuRoC (ASL) tables of inertial samples, as Kalibr and VINS take them, with a GNSS file beside.

use std::path::Path;

use ins_core::{ImuOutput, ImuSample, Time};
use nalgebra::Vector3;

use super::recording::{Imu, Recording};
use super::text::Table;
use crate::log::{BodyAxes, LogError};

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
            Some(Vector3::new(
                *row.get(at)?,
                *row.get(at + 1)?,
                *row.get(at + 2)?,
            ))
        };
        let (gyro, accel) = (vector(1)?, vector(4)?);
        let finite = gyro.iter().chain(&accel).all(|x| x.is_finite());
        let time = Time::from_seconds(1e-9 * row.first()?)?;
        finite.then(|| ImuSample {
            time,
            gyro: BodyAxes::Flu.to_rfu(gyro),
            accel: BodyAxes::Flu.to_rfu(accel),
        })
    };
    let imu = Imu {
        path: path.to_owned(),
        name: "EuRoC".to_owned(),
        // The format names none; the check of gravity says if they are others.
        axes: BodyAxes::Flu,
        output: ImuOutput::Rates,
        samples: table.rows.iter().filter_map(sample).collect(),
    };
    Ok(Recording::of(vec![imu], Vec::new()))
}
