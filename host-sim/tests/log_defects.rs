//! Every kind of bad log, and the message it gets.

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::Path;

use flate2::write::GzEncoder;
use host_sim::log::{LogError, read};

const META: &str = "name = \"test drive\"\n\n[log]\nbody_axes = \"FRD\"\nimu = \"rates\"\n";
const IMU_STEP_S: f64 = 0.02;
const SPEED_MPS: f64 = 10.0;

/// The files of a log as text, to be spoilt.
struct Files {
    imu: String,
    gnss: String,
    meta: String,
}

/// A car at constant speed on a winding road for two minutes, 50 Hz and 5 Hz.
fn drive() -> Files {
    let mut imu = "t_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n".to_owned();
    let mut gnss = "t_s,lat_deg,lon_deg,h_m,ve,vn,vu,nsat\n".to_owned();
    let (mut course, mut east_m, mut north_m) = (0.4_f64, 0.0, 0.0);
    for step in 0..6000_i32 {
        let time = f64::from(step) * IMU_STEP_S;
        let rate = 0.2 * (0.13 * time).sin() + 0.15 * (0.031 * time * time / 4.0).cos();
        let (ve, vn) = (SPEED_MPS * course.sin(), SPEED_MPS * course.cos());
        writeln!(
            imu,
            "{time:.3},0.001,-0.002,{rate:.6},0.05,{:.5},-9.81",
            SPEED_MPS * rate
        )
        .unwrap();
        if step % 10 == 0 {
            // Metres per degree at 45 degrees north.
            let (lat, lon) = (45.0 + north_m / 111_130.0, 9.0 + east_m / 78_850.0);
            writeln!(
                gnss,
                "{time:.3},{lat:.9},{lon:.9},200.0,{ve:.4},{vn:.4},0.0,9"
            )
            .unwrap();
        }
        east_m += ve * IMU_STEP_S;
        north_m += vn * IMU_STEP_S;
        course += rate * IMU_STEP_S;
    }
    Files {
        imu,
        gnss,
        meta: META.to_owned(),
    }
}

/// Applies `f` to a column of numbers.
fn convert(text: &mut String, name: &str, f: impl Fn(f64) -> f64) {
    let header = text.lines().next().unwrap().to_owned();
    let column = header.split(',').position(|cell| cell == name).unwrap();
    let mut converted = header;
    for line in text.lines().skip(1) {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        cells[column] = f(cells[column].parse().unwrap()).to_string();
        write!(converted, "\n{}", cells.join(",")).unwrap();
    }
    *text = converted + "\n";
}

fn convert_all(text: &mut String, names: &[&str], f: impl Fn(f64) -> f64 + Copy) {
    for name in names {
        convert(text, name, f);
    }
}

/// Replaces a line, counted from one.
fn set_line(text: &mut String, line: usize, with: &str) {
    let mut lines: Vec<&str> = text.lines().collect();
    lines[line - 1] = with;
    *text = lines.join("\n") + "\n";
}

fn swap_columns(text: &mut String, a: usize, b: usize) {
    let swapped: Vec<String> = text
        .lines()
        .enumerate()
        .map(|(index, line)| {
            let mut cells: Vec<&str> = line.split(',').collect();
            if index > 0 {
                cells.swap(a, b);
            }
            cells.join(",")
        })
        .collect();
    *text = swapped.join("\n") + "\n";
}

const GYRO: [&str; 3] = ["gyro_x", "gyro_y", "gyro_z"];
const ACCEL: [&str; 3] = ["accel_x", "accel_y", "accel_z"];

fn put(files: &Files, folder: &Path) {
    fs::write(folder.join("imu.csv"), &files.imu).unwrap();
    fs::write(folder.join("gnss.csv"), &files.gnss).unwrap();
    fs::write(folder.join("meta.toml"), &files.meta).unwrap();
}

fn told(error: &LogError, folder: &Path) -> String {
    let text = format!("{error}\n-> {}", error.cause);
    text.replace(&format!("{}/", folder.display()), "")
        .replace(&folder.display().to_string(), "LOG")
}

/// What is said of a drive spoilt by `spoil`: the error, or else all warnings.
#[allow(dead_code)]
fn said(spoil: impl Fn(&mut Files)) -> String {
    said_of(|files, folder| {
        spoil(files);
        put(files, folder);
    })
}

fn said_of(make: impl Fn(&mut Files, &Path)) -> String {
    let folder = tempfile::tempdir().unwrap();
    make(&mut drive(), folder.path());
    match read(folder.path()) {
        Err(error) => told(&error, folder.path()),
        Ok((_, warnings)) => {
            let told: Vec<String> = warnings.iter().map(|w| told(w, folder.path())).collect();
            format!("warning: {}", told.join("\n"))
        }
    }
}

#[track_caller]
fn same(said: &str, expected: &str) {
    assert_eq!(
        said, expected,
        "\n--- said\n{said}\n--- expected\n{expected}\n"
    );
}

#[test]
fn a_good_log_gets_no_message() {
    same(&said(|_| {}), "warning: ");
}
