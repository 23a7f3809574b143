//! The program as a shell sees it.

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

fn said(output: &Output) -> String {
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
fn what_is_stopped_leaves_nothing_half_done() {
    for (command, out, within) in [("drive", "log", "."), ("demo", "a/b", "a/b")] {
        stopped_in_the_middle(&[command, "--minutes", "120", "--out", out], within);
    }
}

/// Stops a command while a folder is being written.
#[cfg(unix)]
fn stopped_in_the_middle(arguments: &[&str], within: &str) {
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
fn a_full_disk_behind_the_output_is_no_panic() {
    for arguments in [&["aircraft"][..], &["completions", "bash"]] {
        let full = File::options().write(true).open("/dev/full").unwrap();
        let output = host_sim().args(arguments).stdout(full).output().unwrap();
        let said = said(&output);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(
            said.contains("No space left") && !said.contains("panicked"),
            "{said}"
        );
    }
}

#[test]
fn a_demo_runs_again() {
    let home = tempfile::tempdir().unwrap();
    for _ in 0..2 {
        let demo = host_sim()
            .current_dir(home.path())
            .args(["demo", "--minutes", "3"])
            .output();
        let demo = demo.unwrap();
        assert!(demo.status.success(), "{}", said(&demo));
    }
    // But not over what something else has written.
    fs::remove_file(home.path().join("out/demo/log/errors.toml")).unwrap();
    let demo = host_sim()
        .current_dir(home.path())
        .args(["demo", "--minutes", "3"])
        .output();
    assert!(!demo.unwrap().status.success());
}

#[test]
fn arguments_that_cannot_be_used_are_named() {
    let nowhere = said(&run(&["hil", "log", "--out", "results"]));
    assert!(
        nowhere.contains("--port") && nowhere.contains("--qemu"),
        "{nowhere}"
    );
    let seed = u64::MAX.to_string();
    let seeds = said(&run(&[
        "study",
        "flights",
        "--runs",
        "1",
        "--first-seed",
        &seed,
    ]));
    assert!(seeds.contains("--first-seed"), "{seeds}");
    let place = ["rehearse", "drive", "--plan", "plan.toml", "--out", "out"];
    let renamed = said(&run(&[&place[..], &["--with", "mine=core"]].concat()));
    assert!(renamed.contains("core goes by its own name"), "{renamed}");
    let misspelt = said(&run(&[&place[..], &["--with", "kalmann"]].concat()));
    assert!(
        misspelt.contains("core-open, kalman, hil, or a"),
        "{misspelt}"
    );
    let formless = ["--form", "literal", "--kalman", "1"];
    let formless = said(&run(&[&["study", "accuracy"], &formless[..]].concat()));
    assert!(formless.contains("cannot be used with"), "{formless}");
    let turned = said(&run(&[&place[..], &["--heading-sigma", "500"]].concat()));
    assert!(turned.contains("a number from 0 to 180"), "{turned}");
    let negative = said(&run(&["drive", "--minutes", "-1", "--out", "log"]));
    assert!(negative.contains("minutes from 1 to 1440"), "{negative}");
}

#[test]
fn a_comparison_of_nothing_is_a_failure() {
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
    let said = said(&compared);
    assert_eq!(compared.status.code(), Some(1), "{said}");
    assert!(said.contains("No method ever navigates"), "{said}");
    assert!(!home.path().join("out").exists());
}

#[test]
fn a_log_of_another_class_than_its_sensors_is_warned_of() {
    let home = tempfile::tempdir().unwrap();
    let drive = |errors: &str| {
        let arguments = ["drive", "--minutes", "1", "--grade", "mems", "--force"];
        let mut command = host_sim();
        command.current_dir(home.path()).args(arguments);
        let drive = command.args(["--errors", errors, "--out", "log"]).output();
        said(&drive.unwrap())
    };
    let told = drive("hg1700");
    assert!(told.contains("--grade mems with --errors hg1700"), "{told}");
    let told = drive("mems");
    assert!(!told.contains("warning"), "{told}");
}

#[test]
fn an_error_is_said_once_and_in_lines_that_can_be_copied() {
    let home = tempfile::tempdir().unwrap();
    let file = home
        .path()
        .join("a file whose name is so long that a line of eighty would break it");
    fs::write(&file, "").unwrap();
    let file = file.to_str().unwrap();
    let told = said(&run(&["man", "--out", file]));
    assert_eq!(told.matches("os error").count(), 1, "{told}");
    assert!(told.contains(&format!("cannot write {file}: ")), "{told}");
}

#[test]
fn a_study_of_nothing_fails() {
    let nothing = run(&["study", "conditions", "--kinds", "boat", "--judges"]);
    assert!(!nothing.status.success() && nothing.stdout.is_empty());
    assert!(said(&nothing).contains("no kind of boat judges"));
    let home = tempfile::tempdir().unwrap();
    let nowhere = home.path().join("nowhere");
    let nowhere = nowhere.to_str().unwrap();
    let failed = run(&["study", "logs", nowhere]);
    assert!(!failed.status.success() && failed.stdout.is_empty());
    assert!(said(&failed).contains("1 of 1 logs cannot be used"));
    let refused = run(&["study", "recordings", nowhere]);
    assert!(!refused.status.success() && !refused.stdout.is_empty());
    assert!(said(&refused).contains("1 of 1 recordings cannot be used"));
    let nothing = run(&["study", "logs", nowhere, "--development"]);
    assert!(!nothing.status.success() && nothing.stdout.is_empty());
    assert!(said(&nothing).contains("no log of those given is developed on"));
}

#[test]
fn a_table_goes_over_nothing_unless_forced() {
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
    // Before anything is run.
    let refused = study(&file, &[]);
    assert!(!refused.status.success() && refused.stdout.is_empty());
    assert!(said(&refused).contains("exists already"));
    assert_eq!(fs::read_to_string(&file).unwrap(), "precious");
    let refused = study(&home.path().join("nowhere/mine.csv"), &[]);
    assert!(!refused.status.success() && refused.stdout.is_empty());
    // Force is for tables.
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
fn a_shell_completes_and_a_manual_explains() {
    let completions = run(&["completions", "bash"]);
    assert!(String::from_utf8_lossy(&completions.stdout).contains("identify"));
    let home = tempfile::tempdir().unwrap();
    let out = home.path().to_str().unwrap();
    assert!(run(&["man", "--out", out]).status.success());
    let page = fs::read_to_string(home.path().join("host-sim-identify.1")).unwrap();
    assert!(page.contains("\\-\\-bias\\-model"), "{page}");
}

#[test]
fn of_recordings_each_has_its_row() {
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
    assert!(study.status.success(), "{}", said(&study));
    assert!(said(&study).contains("./drive: named twice, counted once"));
    let rows: serde_json::Value = serde_json::from_slice(&study.stdout).unwrap();
    let used = &rows[0]["outcome"]["used"];
    // Of eight, gyros of 1 deg/h take longer.
    assert!(used["known"].as_u64().unwrap() >= 5, "{rows}");
    assert_eq!(used["against"], serde_json::json!([]), "{rows}");
    // A latency of 50 to 300 ms was drawn.
    let latency_ms = used["latency_ms"][0].as_f64().unwrap();
    assert!((40.0..310.0).contains(&latency_ms), "{rows}");
    assert!(rows[1]["outcome"]["refused"].is_string(), "{rows}");
}

#[test]
fn force_is_refused_where_nothing_is_replaced() {
    for command in [&["tune"][..], &["study", "logs"]] {
        let output = run(&[command, &["nowhere", "--force"]].concat());
        assert!(said(&output).contains("--force"), "{}", said(&output));
    }
}
