//! An error model identified from several logs, and used in simulations.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use host_sim::identify::run::identify;
use host_sim::log::{self, BodyAxes, Compression, Grade, Log, Meta};
use host_sim::sim::errors::Outage;
use host_sim::sim::{DriveConfig, ErrorModel, SimulatedDrive, simulate};
use indicatif::ProgressBar;
use ins_core::{Config, GnssOutcome, ImuSample};
use serde_json::Value;

fn host_sim(home: &Path, arguments: &[&str]) -> bool {
    command(home, arguments).status.success()
}

fn command(home: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command
        .current_dir(home)
        .args(arguments)
        .stderr(Stdio::inherit());
    command.output().unwrap()
}

#[test]
fn an_identified_model_can_be_simulated() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    for (seed, out) in [("1", "a/log"), ("2", "b/log")] {
        let drive = ["drive", "--minutes", "8", "--seed", seed, "--out", out];
        assert!(host_sim(home, &drive));
    }
    let found = command(home, &["identify", "a/log", "b/log", "--out", "found"]);
    let stdout = String::from_utf8(found.stdout).unwrap();
    let verdicts = ["seed 1", "seed 2"].map(|seed| format!("simulated drive, {seed}: Verdict: "));
    assert!(verdicts.iter().all(|one| stdout.contains(one)), "{stdout}");
    let page = fs::read_to_string(home.join("found/report.html")).unwrap();
    assert!(verdicts.iter().all(|one| page.contains(one)));
    assert!(home.join("found/error-model.toml").is_file());
    let folders = fs::read_dir(home.join("found")).unwrap();
    let reports = folders.map(|entry| entry.unwrap().path()).filter(|path| {
        let report = fs::read_to_string(path.join("report.html"));
        report.is_ok_and(|page| page.contains("<li>Verdict: ") && page.contains("Latency drift"))
            && path.join("error-model.toml").is_file()
    });
    assert_eq!(reports.count(), 2);
    // The identified model is accepted as it is.
    let again = ["drive", "--minutes", "1", "--out", "c", "--errors"];
    assert!(host_sim(
        home,
        &[&again[..], &["found/error-model.toml"]].concat()
    ));
    // The log states the class of its sensors, not the default class.
    let consumer = ["drive", "--minutes", "1", "--out", "d", "--errors", "mems"];
    assert!(host_sim(home, &consumer));
    let meta = fs::read_to_string(home.join("d/meta.toml")).unwrap();
    assert!(meta.contains("grade = \"mems\""), "{meta}");
    assert!(!host_sim(
        home,
        &["identify", "a/log", "b/log", "--out", "found"]
    ));
    // Earlier results of one or several logs may be overwritten.
    for logs in [&["a/log"][..], &["a/log", "b/log"]] {
        let again = [&["identify"], logs, &["--out", "found", "--force"]].concat();
        assert!(host_sim(home, &again));
    }
    // Using a drive twice would understate the uncertainty.
    assert!(!host_sim(
        home,
        &["identify", "a/log", "a/log", "--out", "twice"]
    ));
}

/// Output of `tune` for a drive of so many minutes.
fn tuned(home: &Path, minutes: &str, more: &[&str]) -> Value {
    let drive = [&["drive", "--minutes", minutes, "--out", "log"], more].concat();
    assert!(host_sim(home, &drive));
    let tuned = command(home, &["tune", "log", "--format", "json"]);
    serde_json::from_slice(&tuned.stdout).unwrap()
}

/// Differences of close positions are noisier than velocities, of distant ones less noisy.
#[test]
fn velocities_are_not_mistaken_for_position_differences() {
    let home = tempfile::tempdir().unwrap();
    let tuned = tuned(home.path(), "1", &[]);
    assert_eq!(tuned["warnings"], Value::Array(Vec::new()));
}

#[test]
fn a_drive_without_gnss_is_not_mistaken_for_rest() {
    let home = tempfile::tempdir().unwrap();
    let mut model = ErrorModel::hg1700();
    model.gnss.outages = vec![Outage {
        start_s: 100.0,
        duration_s: 1000.0,
    }];
    let text = toml::to_string(&model).unwrap();
    fs::write(home.path().join("outage.toml"), text).unwrap();
    let tuned = tuned(
        home.path(),
        "6",
        &["--errors", "outage.toml", "--seed", "2"],
    );
    // Of 7.5 deg/h/sqrt(Hz), in rad/s/sqrt(Hz).
    let noise = tuned["gyro_noise"]["value"].as_f64();
    assert!(
        noise.is_none_or(|noise| (2.5e-5..5e-5).contains(&noise)),
        "{noise:?}"
    );
}

/// A gap near the end of the log differs from a log in which levelling failed.
#[test]
fn a_log_ending_after_a_gap_gets_its_own_message() {
    let home = tempfile::tempdir().unwrap();
    let config = DriveConfig::new(2, Grade::Hg1700, 3.0);
    let SimulatedDrive { mut imu, gnss, .. } = simulate(&config);
    let later = |sample: &ImuSample| ImuSample {
        time: sample.time.plus_seconds(300.0),
        ..*sample
    };
    let after: Vec<ImuSample> = imu[..100].iter().map(later).collect();
    imu.extend(after);
    let log = Log {
        meta: Meta::new(BodyAxes::Frd, config.recording.errors.imu.output),
        imu: imu.into(),
        gnss,
        baro: Vec::new(),
        truth: Vec::new(),
    };
    log::write(&log, home.path(), Compression::Plain).unwrap();
    let tuned = command(home.path(), &["tune", ".", "--format", "json"]);
    let tuned: Value = serde_json::from_slice(&tuned.stdout).unwrap();
    let against = tuned["verdict"]["against"].to_string();
    assert!(against.contains("not found anew"), "{against}");
}

/// A navigating core queues a fix first; its outcome is known later.
#[test]
fn queued_fixes_are_counted_by_their_final_outcome() {
    let config = DriveConfig::new(3, Grade::Hg1700, 6.0);
    let mut drive = simulate(&config);
    let mut outliers = 0;
    for fix in drive.gnss.iter_mut().skip(3000).step_by(50) {
        if let Some(velocity_mps) = &mut fix.velocity_en_mps {
            velocity_mps.x += 40.0;
        }
        fix.position = None;
        fix.height_m = None;
        fix.velocity_up_mps = None;
        outliers += 1;
    }
    let imu_output = config.recording.errors.imu.output;
    let log = drive.into_log(BodyAxes::Rfu, imu_output);
    let config = Config {
        imu_output,
        ..Config::hg1700()
    };
    let found = identify(&log, config, &ProgressBar::hidden()).unwrap();
    let outcomes = found.gnss_outcomes();
    let mut rejected = outcomes.iter().filter(|one| one.0 == GnssOutcome::Outlier);
    let rejected = rejected.next().map_or(0, |(_, count)| *count);
    // An outlier also causes the rejection of the fix averaged with it.
    assert!(
        (outliers..=2 * outliers).contains(&rejected),
        "{rejected} of {outliers}"
    );
}
