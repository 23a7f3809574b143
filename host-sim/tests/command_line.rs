//! Command-line behaviour: exit codes, output, files.

use std::fs::{self, File};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Output};
use std::thread::sleep;
use std::time::{Duration, Instant};

fn host_sim() -> Command {
    Command::new(env!("CARGO_BIN_EXE_host-sim"))
}

fn run(arguments: &[&str]) -> Output {
    host_sim().args(arguments).output().unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn entries(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect()
}

#[test]
#[cfg(unix)]
fn stopped_commands_leave_no_partial_output() {
    for (command, out, within) in [("drive", "log", "."), ("demo", "a/b", "a/b")] {
        assert_nothing_left_if_stopped(&[command, "--minutes", "120", "--out", out], within);
    }
}

/// Stops a command while a folder is being written.
#[cfg(unix)]
fn assert_nothing_left_if_stopped(arguments: &[&str], within: &str) {
    let home = tempfile::tempdir().unwrap();
    let mut drive = host_sim()
        .current_dir(home.path())
        .args(arguments)
        .spawn()
        .unwrap();
    let start = Instant::now();
    while !entries(&home.path().join(within))
        .iter()
        .any(|name| name.starts_with(".building-"))
    {
        assert!(
            start.elapsed() < Duration::from_mins(5),
            "nothing was begun"
        );
        sleep(Duration::from_millis(5));
    }
    let stopped = Command::new("kill")
        .args(["-TERM", &drive.id().to_string()])
        .status();
    assert!(stopped.unwrap().success());
    assert_eq!(drive.wait().unwrap().code(), Some(130));
    assert_eq!(entries(home.path()), Vec::<String>::new());
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_causes_an_error_not_a_panic() {
    for arguments in [&["aircraft"][..], &["completions", "bash"]] {
        let full = File::options().write(true).open("/dev/full").unwrap();
        let output = host_sim().args(arguments).stdout(full).output().unwrap();
        let stderr = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{stderr}");
        assert!(
            stderr.contains("No space left") && !stderr.contains("panicked"),
            "{stderr}"
        );
    }
}

#[test]
fn a_demo_may_be_repeated() {
    let home = tempfile::tempdir().unwrap();
    for _ in 0..2 {
        let demo = host_sim()
            .current_dir(home.path())
            .args(["demo", "--minutes", "3"])
            .output();
        let demo = demo.unwrap();
        assert!(demo.status.success(), "{}", stderr(&demo));
    }
    // But it does not overwrite a folder that it did not write.
    fs::remove_file(home.path().join("out/demo/log/errors.toml")).unwrap();
    let demo = host_sim()
        .current_dir(home.path())
        .args(["demo", "--minutes", "3"])
        .output();
    assert!(!demo.unwrap().status.success());
}

#[test]
fn invalid_arguments_are_reported() {
    let nowhere = stderr(&run(&["hil", "log", "--out", "results"]));
    assert!(
        nowhere.contains("--port") && nowhere.contains("--qemu"),
        "{nowhere}"
    );
    let seed = u64::MAX.to_string();
    let seeds = stderr(&run(&[
        "study",
        "flights",
        "--runs",
        "1",
        "--first-seed",
        &seed,
    ]));
    assert!(seeds.contains("--first-seed"), "{seeds}");
    let place = ["rehearse", "drive", "--plan", "plan.toml", "--out", "out"];
    let renamed = stderr(&run(&[&place[..], &["--with", "mine=core"]].concat()));
    assert!(renamed.contains("core goes by its own name"), "{renamed}");
    let misspelt = stderr(&run(&[&place[..], &["--with", "kalmann"]].concat()));
    assert!(
        misspelt.contains("core-open, kalman, hil, or a"),
        "{misspelt}"
    );
    let formless = ["--form", "literal", "--kalman", "1"];
    let formless = stderr(&run(&[&["study", "accuracy"], &formless[..]].concat()));
    assert!(formless.contains("cannot be used with"), "{formless}");
    let turned = stderr(&run(&[&place[..], &["--heading-sigma", "500"]].concat()));
    assert!(turned.contains("a number from 0 to 180"), "{turned}");
    let negative = stderr(&run(&["drive", "--minutes", "-1", "--out", "log"]));
    assert!(negative.contains("minutes from 1 to 1440"), "{negative}");
}

#[test]
fn a_comparison_without_result_fails() {
    let home = tempfile::tempdir().unwrap();
    let command = |arguments: &[&str]| host_sim().current_dir(&home).args(arguments).output();
    let drive = [
        "drive",
        "--minutes",
        "1",
        "--errors",
        "mems",
        "--out",
        "log",
    ];
    command(&drive).unwrap();
    let table = home.path().join("log/imu.csv");
    let packed = table.with_added_extension("gz");
    let rows = flate2::read::GzDecoder::new(File::open(&packed).unwrap());
    let first: Vec<String> = BufReader::new(rows).lines().take(200).flatten().collect();
    fs::write(&table, first.join("\n")).unwrap();
    fs::remove_file(packed).unwrap();
    let compared = command(&["compare", "log", "--out", "out"]).unwrap();
    let stderr = stderr(&compared);
    assert_eq!(compared.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("No method ever navigates"), "{stderr}");
    assert!(!home.path().join("out").exists());
}

#[test]
fn a_class_that_contradicts_the_error_model_causes_a_warning() {
    let home = tempfile::tempdir().unwrap();
    let drive = |errors: &str| {
        let arguments = ["drive", "--minutes", "1", "--grade", "mems", "--force"];
        let mut command = host_sim();
        command.current_dir(home.path()).args(arguments);
        let drive = command.args(["--errors", errors, "--out", "log"]).output();
        stderr(&drive.unwrap())
    };
    let stderr = drive("hg1700");
    assert!(
        stderr.contains("--grade mems with --errors hg1700"),
        "{stderr}"
    );
    let stderr = drive("mems");
    assert!(!stderr.contains("warning"), "{stderr}");
}

#[test]
fn errors_are_reported_once_in_unbroken_lines() {
    let home = tempfile::tempdir().unwrap();
    let file = home
        .path()
        .join("a file whose name is so long that a line of eighty would break it");
    fs::write(&file, "").unwrap();
    let file = file.to_str().unwrap();
    let stderr = stderr(&run(&["man", "--out", file]));
    assert_eq!(stderr.matches("os error").count(), 1, "{stderr}");
    assert!(
        stderr.contains(&format!("cannot write {file}: ")),
        "{stderr}"
    );
}

#[test]
fn an_empty_study_fails() {
    let nothing = run(&["study", "conditions", "--kinds", "boat", "--judges"]);
    assert!(!nothing.status.success() && nothing.stdout.is_empty());
    assert!(stderr(&nothing).contains("no kind of boat judges"));
    let home = tempfile::tempdir().unwrap();
    let nowhere = home.path().join("nowhere");
    let nowhere = nowhere.to_str().unwrap();
    let failed = run(&["study", "logs", nowhere]);
    assert!(!failed.status.success() && failed.stdout.is_empty());
    assert!(stderr(&failed).contains("1 of 1 logs cannot be used"));
    let refused = run(&["study", "recordings", nowhere]);
    assert!(!refused.status.success() && !refused.stdout.is_empty());
    assert!(stderr(&refused).contains("1 of 1 recordings cannot be used"));
    let nothing = run(&["study", "logs", nowhere, "--development"]);
    assert!(!nothing.status.success() && nothing.stdout.is_empty());
    assert!(stderr(&nothing).contains("no log of those given is developed on"));
}

#[test]
fn a_table_overwrites_nothing_unless_forced() {
    let home = tempfile::tempdir().unwrap();
    let file = home.path().join("mine.csv");
    fs::write(&file, "precious").unwrap();
    let study = |csv: &Path, more: &[&str]| {
        let mut command = host_sim();
        let brief = ["study", "conditions", "--kinds", "boat", "--seeds", "1"];
        let brief = command
            .args(brief)
            .args(["--class", "mems", "--brief", "--csv"]);
        brief.arg(csv).args(more).output().unwrap()
    };
    // Rejected before anything is run.
    let refused = study(&file, &[]);
    assert!(!refused.status.success() && refused.stdout.is_empty());
    assert!(stderr(&refused).contains("exists already"));
    assert_eq!(fs::read_to_string(&file).unwrap(), "precious");
    let refused = study(&home.path().join("nowhere/mine.csv"), &[]);
    assert!(!refused.status.success() && refused.stdout.is_empty());
    // `--force` only overwrites tables.
    let refused = study(&file, &["--force"]);
    assert!(!refused.status.success() && refused.stdout.is_empty());
    assert_eq!(fs::read_to_string(&file).unwrap(), "precious");
    fs::write(&file, "").unwrap();
    assert!(study(&file, &["--force"]).status.success());
    assert!(study(&file, &["--force"]).status.success());
    assert!(fs::read_to_string(&file).unwrap().starts_with("kind,"));
    assert_eq!(entries(home.path()), ["mine.csv"]);
}

#[test]
fn completions_and_manual_pages_are_written() {
    let completions = run(&["completions", "bash"]);
    assert!(String::from_utf8_lossy(&completions.stdout).contains("identify"));
    let home = tempfile::tempdir().unwrap();
    let out = home.path().to_str().unwrap();
    assert!(run(&["man", "--out", out]).status.success());
    let page = fs::read_to_string(home.path().join("host-sim-identify.1")).unwrap();
    assert!(page.contains("\\-\\-bias\\-model"), "{page}");
}

#[test]
fn every_recording_has_a_row() {
    let home = tempfile::tempdir().unwrap();
    let drive = host_sim()
        .current_dir(home.path())
        .args(["drive", "--minutes", "6", "--seed", "2", "--out", "drive"])
        .output();
    assert!(drive.unwrap().status.success());
    fs::write(home.path().join("letter.txt"), "Dear log,\n").unwrap();
    let study = host_sim()
        .current_dir(home.path())
        .args(["study", "recordings", "drive", "./drive", "letter.txt"])
        .arg("--json")
        .output();
    let study = study.unwrap();
    assert!(study.status.success(), "{}", stderr(&study));
    assert!(stderr(&study).contains("./drive: named twice, counted once"));
    let rows: serde_json::Value = serde_json::from_slice(&study.stdout).unwrap();
    let used = &rows[0]["outcome"]["used"];
    // Of eight; gyros of 1 deg/h take longer.
    assert!(used["known"].as_u64().unwrap() >= 5, "{rows}");
    assert_eq!(used["against"], serde_json::json!([]), "{rows}");
    // A latency of 50 to 300 ms was drawn.
    let latency_ms = used["latency_ms"][0].as_f64().unwrap();
    assert!((40.0..310.0).contains(&latency_ms), "{rows}");
    assert!(rows[1]["outcome"]["refused"].is_string(), "{rows}");
}

#[test]
fn force_is_rejected_where_nothing_is_overwritten() {
    for command in [&["tune"][..], &["study", "logs"]] {
        let output = run(&[command, &["nowhere", "--force"]].concat());
        assert!(stderr(&output).contains("--force"), "{}", stderr(&output));
    }
}
