//! Simulated runs that show everything soon, and the configurations for them.

use host_sim::identify::configure;
use host_sim::log::{self, BodyAxes, Log};
use host_sim::sim::drive::Recording;
use host_sim::sim::{DriveConfig, ErrorModel, Grade, SimulatedDrive, record, simulate};
use host_sim::study::flights::route::Route;
use ins_core::Config;

/// A drive: rest, a minute where a gyrocompass wants it, then starts and turns with everything
/// running.
pub fn drive(grade: Grade, minutes: f64) -> (Config, Log) {
    let (class, rest_s) = match grade {
        Grade::Mems => (log::Grade::Mems, 12.0),
        Grade::Hg1700 | Grade::Ideal => (log::Grade::Hg1700, 62.0),
    };
    let drive = DriveConfig {
        initial_rest_s: Some([rest_s, rest_s + 1.0]),
        ..DriveConfig::new(3, grade, minutes)
    };
    configured(simulate(&drive), &drive.recording, class)
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
    Ok(configured(run, &recording, log::Grade::Hg1700))
}

fn configured(run: SimulatedDrive, recording: &Recording, class: log::Grade) -> (Config, Log) {
    let log = run.into_log(BodyAxes::Rfu, recording.errors.imu.output);
    (configure::config(&log, class), log)
}
