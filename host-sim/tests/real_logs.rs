//! Recorded drives, where they are at hand: `INS_LOGS`, or `../shared/data` beside the workspace.

use std::env;
use std::path::{Path, PathBuf};

use host_sim::log::read;

fn logs() -> Vec<PathBuf> {
    let default = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = env::var_os("INS_LOGS").map_or(default, PathBuf::from);
    let Ok(entries) = folder.read_dir() else {
        println!(
            "No recorded logs in {}: set INS_LOGS to test with them.",
            folder.display()
        );
        return Vec::new();
    };
    let mut logs: Vec<PathBuf> = entries
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.is_dir())
        .collect();
    logs.sort();
    logs
}

#[test]
fn every_recorded_log_reads() {
    for path in logs() {
        let (log, warnings) = read(&path).unwrap_or_else(|e| panic!("{e}\n{}", e.cause));
        for warning in warnings {
            println!("warning: {warning}\n  -> {}", warning.cause);
        }
        println!(
            "{}: {:.1} s, {} fixes",
            path.display(),
            log.duration_s(),
            log.gnss.len()
        );
        assert!(log.duration_s() > 10.0 && log.gnss.len() > 10);
    }
}
