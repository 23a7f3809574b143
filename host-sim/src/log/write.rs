//! Writing a log folder.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use flate2::write::GzEncoder;
use ins_core::{GnssFix, ImuSample, Solution};

use super::Log;
use super::axes::BodyAxes;
use super::error::LogError;
use super::order::decimal;

/// Whether the tables are packed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compression {
    /// `imu.csv` and so on.
    #[default]
    Plain,
    /// `imu.csv.gz` and so on.
    Gzip,
}

/// Writes a log into an existing folder, in the axes its metadata names.
pub fn write(log: &Log, folder: &Path, compression: Compression) -> Result<(), LogError> {
    let axes = log.meta.body_axes;
    let sigmas: Vec<_> = SIGMAS
        .into_iter()
        .filter(|(_, part)| log.gnss.iter().any(|fix| part(fix).is_some()))
        .collect();
    let names: Vec<_> = sigmas.iter().map(|(name, _)| *name).collect();
    let names = [&["t_s,lat_deg,lon_deg,h_m,ve,vn,vu"], names.as_slice()].concat();
    let table = |name: &str, header: &str, rows: &mut dyn Iterator<Item = String>| {
        write_table(folder, name, compression, header, rows)
    };
    table(
        "imu.csv",
        "t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z",
        &mut log.imu.iter().map(|sample| imu_row(&sample, axes)),
    )?;
    table(
        "gnss.csv",
        &names.join(","),
        &mut log.gnss.iter().map(|fix| gnss_row(fix, &sigmas)),
    )?;
    if !log.truth.is_empty() {
        table(
            "truth.csv",
            "t_s,lat_deg,lon_deg,h_m,ve,vn,vu,roll_deg,pitch_deg,heading_deg",
            &mut log.truth.iter().map(truth_row),
        )?;
    }
    let path = folder.join("meta.toml");
    std::fs::write(&path, log.meta.to_toml()).map_err(|e| cannot_write(&path, &e))
}

fn imu_row(sample: &ImuSample, axes: BodyAxes) -> String {
    let (gyro, accel) = (axes.from_rfu(sample.gyro), axes.from_rfu(sample.accel));
    joined(
        decimal(sample.time),
        gyro.iter().chain(&accel).map(|&x| Some(x)),
    )
}

type Part = fn(&GnssFix) -> Option<f64>;

/// Columns of the noise that receivers state, written where one does.
const SIGMAS: [(&str, Part); 5] = [
    ("sd_n", |fix| fix.sigma.position_m),
    ("sd_e", |fix| fix.sigma.position_m),
    ("sd_u", |fix| fix.sigma.height_m),
    ("sd_v", |fix| fix.sigma.velocity_mps),
    ("sd_vu", |fix| fix.sigma.velocity_up_mps),
];

fn gnss_row(fix: &GnssFix, sigmas: &[(&str, Part)]) -> String {
    let position = fix.position;
    let velocity = fix.velocity_en_mps;
    let cells = [
        position.map(|p| p.latitude_rad.to_degrees()),
        position.map(|p| p.longitude_rad.to_degrees()),
        fix.height_m,
        velocity.map(|v| v.x),
        velocity.map(|v| v.y),
        fix.velocity_up_mps,
    ];
    let sigmas = sigmas.iter().map(|(_, part)| part(fix));
    joined(decimal(fix.time), cells.into_iter().chain(sigmas))
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

fn truth_row(truth: &Solution) -> String {
    joined(decimal(truth.time), numbers(truth).into_iter().map(Some))
}

fn joined(mut row: String, cells: impl Iterator<Item = Option<f64>>) -> String {
    for cell in cells {
        row.push(',');
        if let Some(value) = cell {
            // The shortest decimal that reads back as the same f64.
            row.push_str(&value.to_string());
        }
    }
    row
}

fn write_table(
    folder: &Path,
    name: &str,
    compression: Compression,
    header: &str,
    rows: &mut dyn Iterator<Item = String>,
) -> Result<(), LogError> {
    let suffix = if compression == Compression::Gzip {
        ".gz"
    } else {
        ""
    };
    let path = folder.join(format!("{name}{suffix}"));
    let file = File::create(&path).map_err(|e| cannot_write(&path, &e))?;
    let result = match compression {
        Compression::Plain => write_lines(BufWriter::new(file), header, rows).map(drop),
        Compression::Gzip => {
            let packed = GzEncoder::new(BufWriter::new(file), flate2::Compression::default());
            write_lines(packed, header, rows)
                .and_then(GzEncoder::finish)
                .and_then(|mut w| w.flush())
        }
    };
    result.map_err(|e| cannot_write(&path, &e))
}

fn write_lines<W: Write>(
    mut to: W,
    header: &str,
    rows: &mut dyn Iterator<Item = String>,
) -> io::Result<W> {
    writeln!(to, "{header}")?;
    for row in rows {
        writeln!(to, "{row}")?;
    }
    to.flush()?;
    Ok(to)
}

fn cannot_write(path: &Path, error: &io::Error) -> LogError {
    LogError::file(
        path,
        "to write this file",
        error.to_string(),
        "a missing folder, permissions or a full disk",
    )
}
