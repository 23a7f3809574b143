//! Folders of gnss-ins-sim: a table for each quantity, units in the headers, front-right-down.

use std::path::Path;

use ins_core::{GnssFix, Time};
use nalgebra::{Vector2, Vector3};

use super::recording::{Imu, Receiver, Recording, degrees};
use super::text::Table;
use crate::log::{BodyAxes, LogError};

pub(super) fn recognised(path: &Path, _: &[u8]) -> bool {
    ["time.csv", "gyro-0.csv", "accel-0.csv"]
        .iter()
        .all(|name| path.join(name).is_file())
}

pub(super) fn read(path: &Path) -> Result<Recording, LogError> {
    let times = column(&path.join("time.csv"))?;
    let mut imus = Vec::new();
    let mut receivers = Vec::new();
    // One of each for every run of the simulation.
    for run in 0.. {
        let of = |name: &str| path.join(format!("{name}-{run}.csv"));
        let (gyro, accel) = (of("gyro"), of("accel"));
        if !gyro.is_file() || !accel.is_file() {
            break;
        }
        let rows = times.iter().zip(vectors(&gyro)?).zip(vectors(&accel)?);
        let samples = rows.filter_map(|((time, gyro), accel)| {
            Some(BodyAxes::Frd.sample(Time::from_seconds(*time)?, gyro, accel))
        });
        let name = format!("run {run}");
        imus.push(Imu::of_rates(&gyro, name, BodyAxes::Frd, samples.collect()));
        let gps = of("gps");
        if gps.is_file() {
            receivers.push(receiver(&path.join("gps_time.csv"), &gps, run)?);
        }
    }
    Ok(Recording::of(imus, receivers))
}

fn receiver(times: &Path, path: &Path, run: i32) -> Result<Receiver, LogError> {
    let times = column(times)?;
    let table = Table::read(path)?;
    let fix = |(time, row): (&f64, &Vec<f64>)| {
        let [latitude, longitude, height, north, east, down] = *row.first_chunk::<6>()?;
        Some(GnssFix {
            time: Time::from_seconds(*time)?,
            position: degrees((latitude, longitude)),
            height_m: Some(height),
            velocity_en_mps: Some(Vector2::new(east, north)),
            velocity_up_mps: Some(-down),
            ..GnssFix::default()
        })
    };
    let fixes = times.iter().zip(&table.rows).filter_map(fix).collect();
    Ok(Receiver::new(path, format!("run {run}"), fixes))
}

fn column(path: &Path) -> Result<Vec<f64>, LogError> {
    let table = Table::read(path)?;
    Ok(table
        .rows
        .iter()
        .filter_map(|row| row.first().copied())
        .collect())
}

/// Rates in rad/s where the header has degrees.
fn vectors(path: &Path) -> Result<Vec<Vector3<f64>>, LogError> {
    let table = Table::read(path)?;
    let degrees = table.names.first().is_some_and(|name| name.contains("deg"));
    let scale = if degrees { 1_f64.to_radians() } else { 1.0 };
    let vector = |row: &Vec<f64>| row.first_chunk::<3>().map(|v| scale * Vector3::from(*v));
    Ok(table.rows.iter().filter_map(vector).collect())
}
