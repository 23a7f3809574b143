//! Recorded logs, where they are at hand: `INS_LOGS`, or `../shared/data` beside the repository.

use std::env;
use std::io::Write as _;
use std::path::PathBuf;

use crate::cargo::repository;

/// Folder of a recorded log. Says so, past the test harness, if it is not there.
pub fn recorded_log(name: &str) -> Option<PathBuf> {
    let default = || repository().join("../shared/data");
    let folder = env::var_os("INS_LOGS").map_or_else(default, PathBuf::from);
    let log = folder.join(name);
    if log.is_dir() {
        return Some(log);
    }
    let _ = writeln!(
        std::io::stderr(),
        "NOT TESTED: no log {}; name the folder of recorded logs in INS_LOGS",
        log.display()
    );
    None
}
