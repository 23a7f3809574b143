//! Campaigns from outside: threads and kills leave no trace in the results; `slurm.rs` has shards.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const PLAN: &str = "
    seed = 3
    units = 2
    drives = 1
    drive_minutes = 6
    flights = 2
    minutes_aided = 6
    minutes_free = 4
    unit_spread = 0.3
";

fn host_sim(threads: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command
        .env("RAYON_NUM_THREADS", threads)
        .stdout(Stdio::null());
    command
}

fn campaign(threads: &str, home: &Path, out: &str) -> Command {
    let mut command = host_sim(threads);
    command
        .current_dir(home)
        .args(["campaign", "plan.toml", "--out", out]);
    command
}

fn text(file: &Path) -> String {
    fs::read_to_string(file).unwrap()
}

fn sorted_lines(file: &Path) -> Vec<String> {
    let mut lines: Vec<String> = text(file).lines().map(str::to_owned).collect();
    lines.sort();
    lines
}

#[test]
fn threads_and_kills_leave_no_trace() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    fs::write(home.join("plan.toml"), PLAN).unwrap();
    assert!(campaign("1", home, "one").status().unwrap().success());
    let summary = text(&home.join("one/campaign.json"));
    let lines = sorted_lines(&home.join("one/runs.jsonl"));
    // Two models, and two flights of each unit with each model.
    assert_eq!(lines.len(), 2 + 8);

    // Killed once some runs are done, and torn in the middle of a line; then on two threads.
    let mut killed = campaign("2", home, "killed").spawn().unwrap();
    let runs = home.join("killed/runs.jsonl");
    let start = Instant::now();
    let done = || fs::read_to_string(&runs).map_or(0, |text| text.matches('\n').count());
    while done() < 4 {
        assert!(
            start.elapsed() < Duration::from_mins(2),
            "nothing gets done"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();
    let before = done();
    assert!(before < lines.len(), "too late for this test");
    let torn = text(&runs) + "{\"run\":\"fli";
    fs::write(&runs, torn).unwrap();
    assert!(campaign("2", home, "killed").status().unwrap().success());
    assert_eq!(sorted_lines(&runs), lines);
    assert_eq!(text(&home.join("killed/campaign.json")), summary);

    // Another plan does not go on there.
    let other = PLAN.replace("seed = 3", "seed = 4");
    fs::write(home.join("other.toml"), other).unwrap();
    let mut command = host_sim("1");
    command
        .current_dir(home)
        .args(["campaign", "other.toml", "--out", "killed"]);
    assert!(!command.stderr(Stdio::null()).status().unwrap().success());
}
