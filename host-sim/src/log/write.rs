//! Writing a log folder.

use std::fs::File;
use std::io;
use std::path::Path;

use flate2::write::GzEncoder;
use ins_core::{BaroHeight, GnssFix, ImuSample, Solution, Time};

use super::Log;
use super::error::LogError;
use super::meta::BodyAxes;
use super::order::decimal;
use crate::page::write_csv;

/// Whether the tables are gzip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compression {
    /// `imu.csv` and so on.
    #[default]
    Plain,
    /// `imu.csv.gz` and so on.
    Gzip,
}

/// Writes a log into an existing folder, in the axes of its metadata.
pub fn write(log: &Log, folder: &Path, compression: Compression) -> Result<(), LogError> {
    let axes = log.meta.body_axes;
    let mut sigmas = SIGMAS.to_vec();
    sigmas.retain(|(_, part)| log.gnss.iter().any(|fix| part(fix).is_some()));
    let mut fixes = "t_s,lat_deg,lon_deg,h_m,ve,vn,vu".to_owned();
    for (name, _) in &sigmas {
        fixes = fixes + "," + name;
    }
    let table = |name: &str, header: &str, rows: &mut dyn Iterator<Item = Vec<String>>| {
        write_table(folder, name, compression, header, rows)
    };
    let samples = "t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z";
    let mut rows = log.imu.iter().map(|sample| imu_row(&sample, axes));
    table("imu.csv", samples, &mut rows)?;
    let mut rows = log.gnss.iter().map(|fix| gnss_row(fix, &sigmas));
    table("gnss.csv", &fixes, &mut rows)?;
    if !log.baro.is_empty() {
        let row =
            |height: &BaroHeight| cells(height.time, [height.height_m, height.sigma_m].map(Some));
        table("baro.csv", "t_s,h_m,sd_h", &mut log.baro.iter().map(row))?;
    }
    if !log.truth.is_empty() {
        let motion = "t_s,lat_deg,lon_deg,h_m,ve,vn,vu,roll_deg,pitch_deg,heading_deg";
        let row = |truth: &Solution| cells(truth.time, numbers(truth).map(Some));
        table("truth.csv", motion, &mut log.truth.iter().map(row))?;
    }
    let path = folder.join("meta.toml");
    std::fs::write(&path, log.meta.to_toml()).map_err(|e| cannot_write(&path, &e))
}

fn imu_row(sample: &ImuSample, axes: BodyAxes) -> Vec<String> {
    let (gyro, accel) = (axes.from_rfu(sample.gyro), axes.from_rfu(sample.accel));
    cells(sample.time, gyro.iter().chain(&accel).map(|&x| Some(x)))
}

type Part = fn(&GnssFix) -> Option<f64>;

/// Columns of the stated sigmas, written where there are any.
const SIGMAS: [(&str, Part); 5] = [
    ("sd_n", |fix| fix.sigma.position_m),
    ("sd_e", |fix| fix.sigma.position_m),
    ("sd_u", |fix| fix.sigma.height_m),
    ("sd_v", |fix| fix.sigma.velocity_mps),
    ("sd_vu", |fix| fix.sigma.velocity_up_mps),
];

fn gnss_row(fix: &GnssFix, sigmas: &[(&str, Part)]) -> Vec<String> {
    let position = fix.position;
    let velocity = fix.velocity_en_mps;
    let motion = [
        position.map(|p| p.latitude_rad.to_degrees()),
        position.map(|p| p.longitude_rad.to_degrees()),
        fix.height_m,
        velocity.map(|v| v.x),
        velocity.map(|v| v.y),
        fix.velocity_up_mps,
    ];
    let sigmas = sigmas.iter().map(|(_, part)| part(fix));
    cells(fix.time, motion.into_iter().chain(sigmas))
}

/// Latitude, longitude, height, velocity, roll, pitch, heading: degrees, metres and m/s.
pub(crate) fn numbers(solution: &Solution) -> [f64; 9] {
    let (p, v) = (solution.position, solution.velocity_enu_mps);
    let angles = solution.euler();
    [
        p.latitude_rad.to_degrees(),
        p.longitude_rad.to_degrees(),
        p.height_m,
        v.x,
        v.y,
        v.z,
        angles.roll_rad.to_degrees(),
        angles.pitch_rad.to_degrees(),
        angles.heading_rad.to_degrees().rem_euclid(360.0),
    ]
}

fn cells(time: Time, numbers: impl IntoIterator<Item = Option<f64>>) -> Vec<String> {
    // The shortest decimal that reads back as the same f64.
    let cell = |number: Option<f64>| number.map_or(String::new(), |value| value.to_string());
    let numbers = numbers.into_iter().map(cell);
    [decimal(time)].into_iter().chain(numbers).collect()
}

fn write_table(
    folder: &Path,
    name: &str,
    compression: Compression,
    header: &str,
    rows: &mut dyn Iterator<Item = Vec<String>>,
) -> Result<(), LogError> {
    let suffix = match compression {
        Compression::Plain => "",
        Compression::Gzip => ".gz",
    };
    let path = folder.join(format!("{name}{suffix}"));
    let write = || {
        let file = File::create(&path)?;
        match compression {
            Compression::Plain => write_csv(file, header, rows).map(drop),
            Compression::Gzip => {
                let gzip = GzEncoder::new(file, flate2::Compression::default());
                write_csv(gzip, header, rows)?.finish().map(drop)
            }
        }
    };
    write().map_err(|e| cannot_write(&path, &e))
}

fn cannot_write(path: &Path, error: &io::Error) -> LogError {
    let cause = "a missing folder, permissions or a full disk";
    LogError::file(path, "to write this file", error.to_string(), cause)
}
