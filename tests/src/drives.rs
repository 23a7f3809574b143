//! Runs for tests: simulated ones with enough motion for all estimates, with their configurations, and recorded logs
//! if available.

use std::env;
use std::io::Write as _;
use std::path::PathBuf;

use host_sim::identify::configure;
use host_sim::log::{BodyAxes, Grade, Log};
use host_sim::sim::drive::Recording;
use host_sim::sim::{DriveConfig, ErrorModel, SimulatedDrive, record, simulate};
use host_sim::study::flights::route::Route;
use ins_core::Config;

use crate::cargo::repository;

/// A drive: rest, a minute if needed for gyrocompassing, then starts and turns.
pub fn drive(grade: Grade, minutes: f64) -> (Config, Log) {
    let rest_s = match grade {
        Grade::Mems => 12.0,
        Grade::Hg1700 => 62.0,
    };
    let drive = DriveConfig {
        initial_rest_s: Some([rest_s, rest_s + 1.0]),
        ..DriveConfig::new(3, grade, minutes)
    };
    with_config(simulate(&drive), &drive.recording, grade)
}

/// A flight: climbs, turns and changes of speed in turbulence, heading given.
pub fn flight(minutes: f64) -> Result<(Config, Log), Box<dyn std::error::Error>> {
    let route = Route::cessna172()?;
    let recording = Recording {
        seed: 3,
        duration_s: 60.0 * minutes,
        imu_hz: 100.0,
        truth_every: 100,
        origin: route.plan().start.position,
        errors: ErrorModel::hg1700(),
    };
    let run = record(route.flight(3, recording.duration_s)?, &recording);
    Ok(with_config(run, &recording, Grade::Hg1700))
}

fn with_config(run: SimulatedDrive, recording: &Recording, class: Grade) -> (Config, Log) {
    let log = run.into_log(BodyAxes::Rfu, recording.errors.imu.output);
    (configure::config(&log, class), log)
}

/// Folder of a recorded log, in that of `INS_LOGS` or in `../shared/data` beside the repository. Prints a note, past
/// the test harness, if it is missing.
pub fn recorded_log(name: &str) -> Option<PathBuf> {
    let default = || repository().join("../shared/data");
    let folder = env::var_os("INS_LOGS").map_or_else(default, PathBuf::from);
    if_available(
        folder.join(name),
        "; name the folder of recorded logs in INS_LOGS",
    )
}

/// A recording of another program, in `../shared/formats` beside the repository; likewise.
pub fn recording(name: &str) -> Option<PathBuf> {
    if_available(repository().join("../shared/formats").join(name), "")
}

fn if_available(path: PathBuf, help: &str) -> Option<PathBuf> {
    if path.exists() {
        return Some(path);
    }
    let _ = writeln!(std::io::stderr(), "NOT TESTED: no {}{help}", path.display());
    None
}
