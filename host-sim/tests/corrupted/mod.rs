//! Logs as text, to be modified.
#![allow(dead_code)] // Each test uses its part.

use std::fmt::Write as _;
use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use flate2::read::MultiGzDecoder;

/// The files of a log as text.
#[derive(Clone)]
pub struct Files {
    pub imu: String,
    pub gnss: String,
    pub meta: String,
}

impl Files {
    /// A recorded log, if available.
    pub fn recorded(name: &str) -> Option<Self> {
        let folder = recorded_logs().join(name);
        if !folder.is_dir() {
            println!("No {}: set INS_LOGS to test with it.", folder.display());
            return None;
        }
        Some(Self {
            imu: unpacked(&folder.join("imu.csv.gz")),
            gnss: unpacked(&folder.join("gnss.csv.gz")),
            meta: fs::read_to_string(folder.join("meta.toml")).unwrap(),
        })
    }

    pub fn write_to(&self, folder: &Path) {
        fs::write(folder.join("imu.csv"), &self.imu).unwrap();
        fs::write(folder.join("gnss.csv"), &self.gnss).unwrap();
        fs::write(folder.join("meta.toml"), &self.meta).unwrap();
    }
}

/// Where recorded logs are: `INS_LOGS`, or `../shared/data` beside the workspace.
pub fn recorded_logs() -> PathBuf {
    let default = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    std::env::var_os("INS_LOGS").map_or(default, PathBuf::from)
}

fn unpacked(path: &Path) -> String {
    let mut text = String::new();
    let mut file = MultiGzDecoder::new(fs::File::open(path).unwrap());
    file.read_to_string(&mut text).unwrap();
    text
}

/// Applies `f` to a column of numbers; empty cells stay.
pub fn convert(text: &mut String, name: &str, f: impl Fn(f64) -> f64) {
    let header = text.lines().next().unwrap().to_owned();
    let column = header.split(',').position(|cell| cell == name).unwrap();
    let mut converted = header;
    for line in text.lines().skip(1) {
        for (index, cell) in line.split(',').enumerate() {
            converted.push(if index == 0 { '\n' } else { ',' });
            match cell.parse::<f64>() {
                Ok(number) if index == column => write!(converted, "{}", f(number)).unwrap(),
                _ => converted.push_str(cell),
            }
        }
    }
    *text = converted + "\n";
}

pub fn convert_all(text: &mut String, names: &[&str], f: impl Fn(f64) -> f64 + Copy) {
    for name in names {
        convert(text, name, f);
    }
}

/// Replaces a line, counted from one.
pub fn set_line(text: &mut String, line: usize, with: &str) {
    let mut lines: Vec<&str> = text.lines().collect();
    lines[line - 1] = with;
    *text = lines.join("\n") + "\n";
}

/// Modifies each row, given by its index from zero and its cells; false deletes it.
pub fn each_row(text: &mut String, mut f: impl FnMut(usize, &mut Vec<String>) -> bool) {
    let mut changed = text.lines().next().unwrap().to_owned() + "\n";
    for (index, line) in text.lines().skip(1).enumerate() {
        let mut cells = line.split(',').map(str::to_owned).collect();
        if f(index, &mut cells) {
            changed += &(cells.join(",") + "\n");
        }
    }
    *text = changed;
}

pub fn swap_columns(text: &mut String, a: usize, b: usize) {
    each_row(text, |_, cells| {
        cells.swap(a, b);
        true
    });
}

/// Replaces cells by those of an earlier row, chosen by index.
pub fn hold(text: &mut String, columns: std::ops::Range<usize>, source: impl Fn(usize) -> usize) {
    let mut rows: Vec<Vec<String>> = Vec::new();
    each_row(text, |index, cells| {
        rows.push(cells.clone());
        cells[columns.clone()].clone_from_slice(&rows[source(index)][columns.clone()]);
        true
    });
}

/// Rotates the sensors about their y axis (right), nose down.
pub fn pitch_sensors(imu: &mut String, down_deg: f64) {
    let (s, c) = down_deg.to_radians().sin_cos();
    each_row(imu, |_, cells| {
        let cell = |index: usize| cells[index].parse::<f64>().unwrap();
        let along = |x: f64, z: f64| (c * x + s * z, c * z - s * x);
        let (gyro, accel) = (along(cell(1), cell(3)), along(cell(4), cell(6)));
        for (index, value) in [(1, gyro.0), (3, gyro.1), (4, accel.0), (6, accel.1)] {
            cells[index] = value.to_string();
        }
        true
    });
}
