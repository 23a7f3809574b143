//! Memory use is independent of the number of samples of a log.

#![cfg(target_os = "linux")]

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use host_sim::log::{self, BodyAxes, Compression, Grade, Log};
use host_sim::sim::{DriveConfig, simulate};

const MINUTES: f64 = 20.0;
const IMU_HZ: f64 = 1000.0;
/// Limit for history, solutions and fixes of a second, bytes; its samples are 56 000.
const BYTES_PER_SECOND: f64 = 8000.0;

/// A high rate, so that samples dominate.
fn drive() -> Log {
    let mut config = DriveConfig::new(1, Grade::Mems, MINUTES);
    config.recording.imu_hz = IMU_HZ;
    config.recording.truth_every = u32::MAX;
    config.recording.errors.gnss.rate_hz = 1.0;
    let output = config.recording.errors.imu.output;
    let log = simulate(&config).into_log(BodyAxes::Frd, output);
    Log {
        truth: Vec::new(),
        ..log
    }
}

/// Peak memory of `identify`, bytes.
fn peak_memory(home: &Path, log: &Log, name: &str) -> f64 {
    let folder = home.join(name);
    fs::create_dir(&folder).unwrap();
    log::write(log, &folder, Compression::Plain).unwrap();
    let mut identify = Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .current_dir(home)
        .args(["identify", name, "--out", &format!("{name}-found")])
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut peak = 0.0;
    while identify.try_wait().unwrap().is_none() {
        peak = high_water(&identify).unwrap_or(peak);
        sleep(Duration::from_millis(2));
    }
    assert!(identify.wait().unwrap().success());
    assert!(home.join(format!("{name}-found/report.html")).is_file());
    peak
}

fn high_water(process: &Child) -> Option<f64> {
    let status = fs::read_to_string(format!("/proc/{}/status", process.id())).ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(1024.0 * kilobytes)
}

#[test]
fn memory_does_not_grow_with_samples() {
    let home = tempfile::tempdir().unwrap();
    let whole = drive();
    let first = whole.imu.first().unwrap().time;
    let quarter = whole.between(first, first.plus_seconds(15.0 * MINUTES));
    let [short, long] = [("short", &quarter), ("long", &whole)].map(|(name, log)| {
        let peak = peak_memory(home.path(), log, name);
        println!("{} samples: {:.1} MB", log.imu.len(), 1e-6 * peak);
        peak
    });
    let more_s = whole.duration_s() - quarter.duration_s();
    let samples = more_s * IMU_HZ;
    assert!(short > 0.0 && samples > 8e5);
    assert!(
        long - short < BYTES_PER_SECOND * more_s,
        "{:.0} bytes a sample",
        (long - short) / samples
    );
}
