//! Several logs, one error model, and the model used again.

use std::path::Path;
use std::process::{Command, Stdio};

fn host_sim(home: &Path, arguments: &[&str]) -> bool {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command
        .current_dir(home)
        .args(arguments)
        .stdout(Stdio::null());
    command.status().unwrap().success()
}

#[test]
fn a_model_of_several_logs_drives_again() {
    let home = tempfile::tempdir().unwrap();
    let home = home.path();
    for (seed, out) in [("1", "a/log"), ("2", "b/log")] {
        let drive = ["drive", "--minutes", "8", "--seed", seed, "--out", out];
        assert!(host_sim(home, &drive));
    }
    assert!(host_sim(
        home,
        &["identify", "a/log", "b/log", "--out", "found"]
    ));
    let model = home.join("found/error-model.toml");
    assert!(model.is_file() && home.join("found/report.html").is_file());
    let folders = std::fs::read_dir(home.join("found")).unwrap();
    let reports = folders.map(|entry| entry.unwrap().path()).filter(|path| {
        path.join("report.html").is_file() && path.join("error-model.toml").is_file()
    });
    assert_eq!(reports.count(), 2);
    // What was found is taken as it stands; what is no model is not.
    let again = ["drive", "--minutes", "1", "--out", "c", "--errors"];
    assert!(host_sim(
        home,
        &[&again[..], &["found/error-model.toml"]].concat()
    ));
    assert!(!host_sim(
        home,
        &["identify", "a/log", "b/log", "--out", "found"]
    ));
    assert!(host_sim(
        home,
        &["identify", "a/log", "b/log", "--out", "found", "--force"]
    ));
    // Counted twice a drive would look surer than it is.
    assert!(!host_sim(
        home,
        &["identify", "a/log", "a/log", "--out", "twice"]
    ));
}
